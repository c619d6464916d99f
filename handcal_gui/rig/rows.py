"""The rig's numbers as table rows, in practical units and with standard deviations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.types import EYES, Eye, Float64, Rig
from handcal.rig.compare import compare_rigs
from handcal.rig.displays.homography import DISPLAY_PARAMETERS, DisplayCalibration
from handcal.rig.lens.camera import CameraCalibration
from handcal.rig.lens.stereo import StereoCalibration
from handcal.rig.steps import STEREO_PARAMETERS
from handcal_gui.app.translation import tr
from handcal_gui.rig.project_folder import LENSES
from handcal_gui.widgets.number_label import UNKNOWN
from handcal_gui.widgets.sentence import sentence
from handcal_gui.widgets.table import Row

COLUMNS = (tr("Value"), "± σ")
LENS_COLUMNS = (tr("Images left out, px"), tr("Edge, px"))
_COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
_INTRINSICS = {
    "fx": tr("Focal length fx"),
    "fy": tr("Focal length fy"),
    "cx": tr("Centre cx"),
    "cy": tr("Centre cy"),
}
_SIDES: dict[Eye, str] = {"left": tr("Left"), "right": tr("Right")}
_TURN = tr(
    "Rotation of the depth camera relative to the headset's camera, from T_H_D: axis times angle."
)
_SHIFT = tr(
    "Position of the depth camera relative to the headset's camera, from T_H_D: x right, y down, "
    "z forward."
)
_T_C0_V = tr(
    "Position of the headset's rendering camera relative to the viewpoint of the offline "
    "calibration, t(C0→V): x right, y down, z forward."
)
_Z_C0_S = tr(
    "Distance of the virtual screen from the viewpoint of the offline calibration, z(C0→S)."
)


def camera_rows(result: CameraCalibration) -> tuple[Row, ...]:
    """Return a camera's intrinsics."""
    solved = result.intrinsics
    sigmas = [*result.sigma, *[np.inf] * len(solved.distortion)]
    values = (solved.fx, solved.fy, solved.cx, solved.cy)
    rows = [
        _row(name, value, sigma, "px", 2, tr("In pixels; σ from the residuals."))
        for name, value, sigma in zip(_INTRINSICS.values(), values, sigmas, strict=False)
    ]
    rows += [
        _row(
            tr("Distortion {}").format(name),
            value,
            sigma,
            "",
            5,
            tr("Distortion coefficient of OpenCV's model."),
        )
        for name, value, sigma in zip(_COEFFICIENTS, solved.distortion, sigmas[4:], strict=False)
    ]
    rows.append(
        Row(
            tr("Pixel"),
            (f"{result.arcmin_per_px:.2f}′", ""),
            tr("Angle of a pixel at the image centre."),
        )
    )
    return (_rms(result.rms_px), *rows)


def lens_rows(result: CameraCalibration, camera: str = "") -> tuple[Row, ...]:
    """Return the lens models compared; `camera` names the camera, if there are two."""
    tooltip = tr(
        "Images left out: RMS error on images that were not used to solve. Edge: standard "
        "deviation of a pixel at the edge of the image. The one chosen is ticked."
    )
    rows = []
    for one in result.compared:
        label = f"{camera}: {LENSES[one.lens]}" if camera else LENSES[one.lens]
        tick = " ✓" if one.lens == result.lens else ""
        edge = f"± {one.edge_px:.2f}" if np.isfinite(one.edge_px) else UNKNOWN
        rows.append(Row(f"{label}{tick}", (f"{one.held_out_px:.3f}", edge), tooltip))
    return tuple(rows)


def stereo_rows(result: StereoCalibration, square_m: float) -> tuple[Row, ...]:
    """Return the depth camera's pose, which is in proportion to the squares' entered side."""
    spread = f"{np.degrees(result.spread_rad):.2f}°, {1e3 * result.spread_m:.1f} mm"
    return (
        _rms(result.rms_px),
        *_place_rows(result.T_H_D, _sigmas(result.covariance, len(STEREO_PARAMETERS))),
        Row(
            tr("If a square is"),
            (f"{1e3 * square_m:.2f} mm", tr("exactly")),
            tr("The position is in proportion to the squares' side, which the images do not tell."),
        ),
        Row(
            tr("Each pair alone"),
            (spread, ""),
            tr("RMS difference from the pose by each pair alone."),
        ),
    )


def display_rows(result: DisplayCalibration) -> tuple[Row, ...]:
    """Return one eye's display calibration."""
    display, sigmas = result.display, _sigmas(result.covariance, len(DISPLAY_PARAMETERS))
    return (
        _rms(result.homography.rms_px),
        Row(
            tr("Corners"),
            (f"{result.homography.sigma_px:.2f} px", ""),
            tr("σ of the least certain corner of the display, in its pixels."),
        ),
        *_display_rows(display.t_C0_V_m, display.z_C0_S_m, sigmas),
        Row(
            tr("Focal length"),
            (f"{display.K[0, 0]:.1f} px", ""),
            tr("Focal length of K, on the display's axis."),
        ),
        Row(
            tr("Rotation"),
            (f"{np.degrees(result.turn_rad):.2f}°", ""),
            tr("Angle between the axes of the display and of the headset's V; included in H0."),
        ),
    )


def rig_rows(rig: Rig) -> tuple[Row, ...]:
    """Return a whole rig's numbers; σ is known for parts calibrated with handcal."""
    return tuple(_rig_rows(rig))


def difference_rows(a: Rig, b: Rig) -> tuple[Row, ...]:
    """Return the differences between two rigs."""
    return tuple(
        Row(
            sentence(one.name),
            (_with_unit(one.value, one.unit, 3),),
            tr("Never negative; 0 if both agree."),
        )
        for one in compare_rigs(a, b)
    )


def _rig_rows(rig: Rig) -> Iterator[Row]:
    for eye in EYES:
        display, origin = rig.eyes[eye], rig.origins.get(eye)
        sigmas = _sigmas(origin.covariance if origin else None, len(DISPLAY_PARAMETERS))
        for row in _display_rows(display.t_C0_V_m, display.z_C0_S_m, sigmas):
            yield Row(f"{_SIDES[eye]}: {row.label}", row.cells, row.tooltip)
        yield Row(
            f"{_SIDES[eye]}: {tr('Focal length')}",
            (f"{display.K[0, 0]:.1f} px", UNKNOWN),
            tr("Focal length of K, on the display's axis."),
        )
    origin = rig.origins.get("T_H_D")
    sigmas = _sigmas(origin.covariance if origin else None, len(STEREO_PARAMETERS))
    for row in _place_rows(rig.T_H_D, sigmas):
        yield Row(tr("Depth camera: {}").format(row.label), row.cells, row.tooltip)
    camera = rig.depth_intrinsics
    for name, label in _INTRINSICS.items():
        value = f"{getattr(camera, name):.2f} px"
        yield Row(
            tr("Depth camera: {}").format(label),
            (value, UNKNOWN),
            tr("From the depth camera's intrinsics."),
        )


def _display_rows(t_C0_V_m: Float64, z_C0_S_m: float, sigmas: Sequence[float]) -> Iterator[Row]:
    for axis, value, sigma in zip("xyz", t_C0_V_m, sigmas, strict=False):
        yield _row(
            tr("Rendering camera {}").format(axis), 1e3 * value, 1e3 * sigma, "mm", 2, _T_C0_V
        )
    yield _row(tr("Screen's distance"), z_C0_S_m, sigmas[3], "m", 3, _Z_C0_S)


def _place_rows(T_H_D: Float64, sigmas: Sequence[float]) -> Iterator[Row]:
    turn_deg = np.degrees(Rotation.from_matrix(T_H_D[:3, :3]).as_rotvec())
    for axis, value, sigma in zip("xyz", turn_deg, np.degrees(sigmas[:3]), strict=True):
        yield _row(tr("Rotation {}").format(axis), value, sigma, "°", 3, _TURN)
    for axis, value, sigma in zip("xyz", T_H_D[:3, 3], sigmas[3:], strict=True):
        yield _row(tr("Position {}").format(axis), 1e3 * value, 1e3 * sigma, "mm", 2, _SHIFT)


def _sigmas(covariance: Float64 | None, count: int) -> list[float]:
    """Return the deviations; infinite if unknown, or of other parameters than this method's."""
    if covariance is None or len(covariance) != count:
        return [np.inf] * count
    return list(np.sqrt(np.diag(covariance)))


def _rms(rms_px: float) -> Row:
    return Row(
        tr("RMS"),
        (f"{rms_px:.3f} px", ""),
        tr("Root mean square distance between detected and expected corners."),
    )


def _row(label: str, value: float, sigma: float, unit: str, decimals: int, tooltip: str) -> Row:
    known = _with_unit(sigma, unit, decimals) if np.isfinite(sigma) else UNKNOWN
    return Row(label, (_with_unit(value, unit, decimals), known), tooltip)


def _with_unit(value: float, unit: str, decimals: int) -> str:
    blank = "" if unit in ("°", "′", "") else " "
    return f"{value:.{decimals}f}{blank}{unit}"
