"""A rig assembled from its calibrated parts, each with its origin.

The first rig holds only what the headset itself reports: the sizes of the displays and T_V_H. Its
parts are calibrated one after the other; each can be calibrated again later.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from textwrap import shorten

import numpy as np

from handcal.core.types import CameraIdentity, Eye, Float64, Intrinsics, Origin, Rig, RigPart
from handcal.rig.boards.views import ViewsError
from handcal.rig.displays.homography import DISPLAY_PARAMETERS, DisplayCalibration, Screen
from handcal.rig.lens.fit import CalibrationVerdict
from handcal.rig.lens.lens import as_pinhole
from handcal.rig.lens.stereo import StereoCalibration
from handcal.rig.plausible import MAX_TEXT

STEREO_PARAMETERS = ("turn_x_rad", "turn_y_rad", "turn_z_rad", "x_m", "y_m", "z_m")
"""Parameters of the covariance of T_H_D."""


def screen_of(rig: Rig, eye: Eye) -> Screen:
    """Return the data of an eye's display that the headset itself reports."""
    display = rig.eyes[eye]
    return Screen(display.width_px, display.height_px, display.T_V_H)


def with_display(
    rig: Rig, eye: Eye, calibration: DisplayCalibration, made: str | None = None
) -> Rig:
    """Return `rig` with one eye's display calibrated.

    Parameters
    ----------
    rig : Rig
    eye : {"left", "right"}
    calibration : DisplayCalibration
    made : str, optional
        When, ISO 8601; now if not given.
    """
    homography = calibration.homography
    origin = _origin(
        "grid on the display, viewpoint camera",
        made,
        len(homography.residuals_px),
        homography.rms_px,
        calibration.verdict,
        DISPLAY_PARAMETERS,
        calibration.covariance,
    )
    eyes = {**rig.eyes, eye: calibration.display}
    return _with_origin(replace(rig, eyes=eyes), eye, origin)


def with_stereo(
    rig: Rig,
    stereo: StereoCalibration,
    made: str | None = None,
    *,
    depth_intrinsics: Intrinsics | None = None,
    T_C_D: Float64 | None = None,
    depth_camera: CameraIdentity = CameraIdentity(),
) -> Rig:
    """Return `rig` with the pose of the depth camera calibrated.

    Depth check and edges of `rig` are removed: they may be of another camera.

    Parameters
    ----------
    rig : Rig
    stereo : StereoCalibration
    made : str, optional
        When, ISO 8601; now if not given.
    depth_intrinsics, T_C_D : Intrinsics, (4, 4) float64, optional
        Required if the stereo calibration is of the depth camera's colour imager and depth is not
        aligned to it: the depth imager's own intrinsics, and the transform from the depth to the
        colour imager, as the device reports them.
    depth_camera : CameraIdentity
        Of the camera that took the images, where it is known.

    Raises
    ------
    ViewsError
        If the pairs do not determine the pose.
    """
    if stereo.covariance is None:
        raise ViewsError("these pairs do not determine the pose of the depth camera: add others")
    origin = _origin(
        "stereo calibration with the headset's camera",
        made,
        len(stereo.residuals_px),
        stereo.rms_px,
        stereo.verdict,
        STEREO_PARAMETERS,
        stereo.covariance,
    )
    T_H_D = stereo.T_H_D if T_C_D is None else stereo.T_H_D @ T_C_D
    intrinsics = depth_intrinsics or as_pinhole(stereo.depth, "the depth camera")
    calibrated = replace(
        rig,
        T_H_D=T_H_D,
        depth_intrinsics=intrinsics,
        depth_camera=depth_camera,
        depth_check=None,
        depth_edges=None,
    )
    return _with_origin(calibrated, "T_H_D", origin)


def with_factory_pose(
    rig: Rig, T_H_D: Float64, depth_intrinsics: Intrinsics, depth_camera: CameraIdentity
) -> Rig:
    """Return `rig` with the headset's own depth camera, as its factory calibrated it.

    Nothing is known of that calibration's accuracy, so T_H_D has no origin. Depth check and
    edges of `rig` are removed: they may be of another camera.

    Parameters
    ----------
    rig : Rig
    T_H_D : (4, 4) float64
    depth_intrinsics : Intrinsics
    depth_camera : CameraIdentity
    """
    origins = dict(rig.origins)
    origins.pop("T_H_D", None)
    return replace(
        rig,
        T_H_D=T_H_D,
        depth_intrinsics=depth_intrinsics,
        depth_camera=depth_camera,
        depth_check=None,
        depth_edges=None,
        origins=origins,
    )


def _origin(
    method: str,
    made: str | None,
    views: int,
    rms_px: float,
    verdict: CalibrationVerdict,
    parameters: tuple[str, ...],
    covariance: Float64,
) -> Origin:
    return Origin(
        method=method,
        made=made or datetime.now(UTC).isoformat(timespec="seconds"),
        views=views,
        rms_px=rms_px,
        verdict=verdict.name,
        reason=shorten(verdict.reason, MAX_TEXT, placeholder=" …"),
        parameters=parameters,
        covariance=0.5 * (covariance + np.transpose(covariance)),
    )


def _with_origin(rig: Rig, part: RigPart, origin: Origin) -> Rig:
    return replace(rig, origins={**rig.origins, part: origin})
