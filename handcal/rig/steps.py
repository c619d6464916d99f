"""Steps of a headset's offline calibration, used by the commands and the rig wizard.

The first rig holds only what the headset itself reports: the sizes of the displays and T_V_H. Its
parts are calibrated one after the other, each with its origin; each can be calibrated again later.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from textwrap import shorten

import numpy as np

from handcal.core.errors import FileError, HandcalError
from handcal.core.types import CameraIdentity, Eye, Float64, Intrinsics, Origin, Rig, RigPart
from handcal.rig.boards.views import BoardImage, ViewsError, used
from handcal.rig.displays.grid import GridView, grid_on, on_display
from handcal.rig.displays.homography import (
    DISPLAY_PARAMETERS,
    DisplayCalibration,
    DisplaySettings,
    Screen,
    calibrate_display,
    fit_homography,
    pixel_size_m,
)
from handcal.rig.formats import (
    read_camera,
    read_identity,
    read_intrinsics,
    read_pose,
    read_stereo,
    read_tracked,
)
from handcal.rig.lens.camera import LensChoice
from handcal.rig.lens.fit import CalibrationVerdict
from handcal.rig.lens.lens import as_pinhole
from handcal.rig.lens.stereo import StereoCalibration, calibrate_stereo
from handcal.rig.lens.viewpoint import ViewpointPose, viewpoint_from_stereo, viewpoint_from_tracked
from handcal.rig.plausible import MAX_TEXT, check_view

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


ASKED_GRIDS, ASKED_BOARDS = 3, 8
"""Images of the grid and of the tracked board that a display asks for; fewer are not *good*."""


@dataclass(frozen=True, slots=True)
class DisplayInputs:
    """Numbers and files for the calibration of one eye's display, besides the images."""

    square_px: int = 80
    """Side of the grid's squares."""
    distance_m: float | None = 2.0
    """z(C0→S) as measured, or None to solve it from `square_arcmin`."""
    square_arcmin: float = 112.0
    nominal_m: float = 2.0
    """Angle that a square subtends at the nominal distance of the virtual image."""
    pose_V_H: Path | None = None
    """File of T_V_H as reported by the headset, or None to use that of the rig."""

    @property
    def settings(self) -> DisplaySettings:
        """Settings with the distance of the display, or with the size of its pixels."""
        if self.distance_m is not None:
            return DisplaySettings(distance_m=self.distance_m)
        angle_rad = float(np.radians(self.square_arcmin / 60.0))
        return DisplaySettings(pixel_m=pixel_size_m(angle_rad, self.square_px, self.nominal_m))


def calibrate_depth_camera(
    pairs: Sequence[tuple[BoardImage, BoardImage]],
    lens: LensChoice,
    depth_intrinsics: Path | None,
    headset_intrinsics: Path | None,
) -> StereoCalibration:
    """Calibrate the pose of the depth camera in the headset from pairs of views of a board.

    Parameters
    ----------
    pairs : sequence of (BoardImage, BoardImage)
        By the depth camera and by the headset's.
    lens : LensChoice
        Lens model of intrinsics that are solved.
    depth_intrinsics, headset_intrinsics : Path or None
        Files; None to solve them from the images.
    """
    return calibrate_stereo(
        pairs,
        None if depth_intrinsics is None else read_camera(depth_intrinsics),
        None if headset_intrinsics is None else read_camera(headset_intrinsics),
        lens,
    )


def calibrate_viewpoint(
    board_views: Sequence[BoardImage], camera: Intrinsics, stereo: Path | None, tracked: Path | None
) -> ViewpointPose:
    """Calibrate the pose of the viewpoint camera in the headset.

    Parameters
    ----------
    board_views : sequence of BoardImage
        By the viewpoint camera, of the tracked board; not used with `stereo`.
    camera : Intrinsics
        The viewpoint camera.
    stereo : Path or None
        Stereo calibration with the viewpoint camera as its depth camera.
    tracked : Path or None
        Poses of the board in `board_views`.

    Raises
    ------
    HandcalError
        If both files are missing, one cannot be read, or the views do not suffice.
    """
    if stereo is not None:
        return viewpoint_from_stereo(read_stereo(stereo))
    if tracked is None:
        raise HandcalError("tracked poses of the board are missing: choose their file")
    pose = viewpoint_from_tracked(board_views, read_tracked(tracked), camera)
    views = len(pose.residuals_px)
    return replace(
        pose, verdict=pose.verdict.unless_few(views, ASKED_BOARDS, "images of the board")
    )


def calibrate_eye_display(
    rig: Rig,
    eye: Eye,
    grid_views: Sequence[BoardImage],
    camera: Intrinsics,
    viewpoint: ViewpointPose,
    inputs: DisplayInputs,
) -> DisplayCalibration:
    """Calibrate one eye's display from views of its grid.

    Parameters
    ----------
    rig : Rig
        Gives the size of the display and, unless `inputs` does, T_V_H.
    eye : {"left", "right"}
    grid_views : sequence of BoardImage
        By the viewpoint camera, of the grid's board.
    camera : Intrinsics
        The viewpoint camera.
    viewpoint : ViewpointPose
        Pose of the viewpoint camera while it saw the grid.
    inputs : DisplayInputs

    Raises
    ------
    HandcalError
        If no view shows the grid, or the display has no room for it.
    """
    screen = screen_of(rig, eye)
    grid = grid_on(screen.width_px, screen.height_px, inputs.square_px)
    seen = {name: on_display(found, grid) for name, found in used(grid_views, 1).items()}
    display = _calibrated(screen, seen, camera, viewpoint, inputs)
    verdict = display.verdict.unless_few(len(seen), ASKED_GRIDS, "images of the grid")
    return replace(display, verdict=verdict)


def calibrate_by_gray_code(
    rig: Rig,
    eye: Eye,
    seen: GridView,
    camera: Intrinsics,
    viewpoint: ViewpointPose,
    inputs: DisplayInputs,
) -> DisplayCalibration:
    """Calibrate one eye's display from Gray-code patterns (`read_gray_code`) in place of the grid.

    Raises
    ------
    HandcalError
        If the images are not of the camera's size.
    """
    return _calibrated(screen_of(rig, eye), {"Gray code": seen}, camera, viewpoint, inputs)


def _calibrated(
    screen: Screen,
    seen: Mapping[str, GridView],
    camera: Intrinsics,
    viewpoint: ViewpointPose,
    inputs: DisplayInputs,
) -> DisplayCalibration:
    if inputs.pose_V_H is not None:
        screen = replace(screen, T_V_H=view_in(inputs.pose_V_H))
    homography = fit_homography(seen, camera, screen.width_px, screen.height_px)
    return calibrate_display(homography, camera, viewpoint, screen, inputs.settings)


def intrinsics_in(path: Path | None) -> Intrinsics | None:
    """Return the intrinsics in a file; None without one."""
    return None if path is None else read_intrinsics(path)


def identity_in(path: Path | None) -> CameraIdentity:
    """Return the identity of the camera in a file of its intrinsics; empty without one."""
    return CameraIdentity() if path is None else read_identity(path)


def view_in(path: Path) -> Float64:
    """Return T_V_H in a file; FileError if it cannot be read, or is implausible."""
    T_V_H = read_pose(path)
    try:
        check_view("T_V_H", T_V_H)
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error
    return T_V_H


def pose_in(path: Path | None) -> Float64 | None:
    """Return the pose (4, 4) in a file; None without one."""
    return None if path is None else read_pose(path)
