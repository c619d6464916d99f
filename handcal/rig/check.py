"""Plausibility of a rig: checks of every field, with the error and the expected value."""

from __future__ import annotations

from dataclasses import asdict, astuple, fields
from string import hexdigits

import numpy as np

from handcal.core.geometry import is_rigid
from handcal.core.types import (
    EYES,
    RIG_PARTS,
    CameraIdentity,
    DepthCheck,
    DepthEdges,
    DisplayCheck,
    EyeDisplay,
    Float64,
    HeadsetIdentity,
    Intrinsics,
    Origin,
    Rig,
)

MAX_DEVICE_SIDE_PX = 16384
MAX_NAME, MAX_TEXT = 200, 500
MAX_PARAMETERS = 12
MAX_RANGES = 20
MAX_ID = 128
_FOCAL_SIDES = 0.1, 10.0
"""Focal length by the side of the image: 157° and 6° across."""
_AXIS_SHARES = 1 / 7, 6 / 7
"""Range of the axis in the image, beyond which it is for a size entered the wrong way round."""
_MOST_ASPECT = 1.5
_ACROSS_DEG = 10.0, 120.0
"""Field of view of a display."""
_FARTHEST_VIEW_M = 0.3
_MOST_TURNED_DEG = 90.0


def check_rig(rig: Rig) -> None:
    """Raise ValueError, naming the field and what is expected, if `rig` is implausible."""
    _check_line("name", rig.name, MAX_NAME)
    for eye in EYES:
        _check_display(eye, rig.eyes[eye])
    _check_rigid("T_H_D", rig.T_H_D)
    check_intrinsics("depth_camera", rig.depth_intrinsics)
    check_identity("depth_camera", rig.depth_camera)
    if rig.headset is not None:
        check_headset(rig.headset)
    if rig.depth_check is not None:
        _check_depth_check(rig.depth_check)
    if rig.depth_edges is not None:
        _check_depth_edges(rig.depth_edges)
    if rig.display_check is not None:
        _check_display_check(rig.display_check)
    for part, origin in rig.origins.items():
        require(part in RIG_PARTS, f"origins may be of {', '.join(RIG_PARTS)}, not of {part}")
        _check_origin(f"origins.{part}", origin)


def check_intrinsics(name: str, intrinsics: Intrinsics) -> None:
    """Raise ValueError, naming the field of `name` and what is expected, if implausible."""
    _check_size(name, intrinsics.width, intrinsics.height)
    _check_optics(name, *astuple(intrinsics)[:6])
    require(
        len(intrinsics.distortion) in (0, 4, 5, 8, 12, 14)
        and bool(np.isfinite(intrinsics.distortion).all()),
        f"{name}.distortion must hold 0, 4, 5, 8, 12 or 14 finite numbers (OpenCV's order)",
    )


def check_identity(name: str, identity: CameraIdentity) -> None:
    """Raise ValueError, naming the field of `name`, unless each is one line, which may be empty."""
    for field, text in asdict(identity).items():
        _check_line(f"{name}.{field}", text, MAX_NAME, may_be_empty=True)


def identity_from_json(value: object, name: str) -> CameraIdentity:
    """Return the identity in a JSON value; empty for None.

    Raises
    ------
    ValueError
        If it is neither None nor an object of texts; the message names the field of `name`.
    """
    require(isinstance(value, dict | None), f"{name} must be an object")
    texts = value if isinstance(value, dict) else {}
    identity = CameraIdentity(*(texts.get(one.name, "") for one in fields(CameraIdentity)))
    check_identity(name, identity)
    return identity


def require(condition: bool, problem: str) -> None:
    """Raise ValueError with `problem` unless `condition` holds."""
    if not condition:
        raise ValueError(problem)


def check_view(name: str, T_V_H: Float64) -> None:
    """Raise ValueError, naming what is expected, unless it may be a rendering camera's pose."""
    _check_rigid(name, T_V_H)
    far_m = float(np.linalg.norm(T_V_H[:3, 3]))
    require(
        far_m < _FARTHEST_VIEW_M,
        f"{name}: the rendering camera is {far_m:.3g} m from the headset's rig, but must be nearer "
        f"than {_FARTHEST_VIEW_M:g} m",
    )
    away_deg = float(np.degrees(np.arccos(np.clip(T_V_H[2, 2], -1.0, 1.0))))
    require(
        away_deg < _MOST_TURNED_DEG,
        f"{name}: the rendering camera looks {away_deg:.0f}° away from where the headset's rig "
        f"looks, but must be within {_MOST_TURNED_DEG:g}°: use OpenCV's axes (z forward), not "
        "those of OpenGL or Unity",
    )


def _check_optics(
    name: str, width: int, height: int, fx: float, fy: float, cx: float, cy: float
) -> None:
    """Raise ValueError unless pixels are about square, and field of view and axis usual ones."""
    for key, focal_px, centre_px, side_px in (("x", fx, cx, width), ("y", fy, cy, height)):
        require(
            _FOCAL_SIDES[0] * side_px <= focal_px <= _FOCAL_SIDES[1] * side_px,
            f"{name}: f{key} is {focal_px:g} px, but must lie between "
            f"{_FOCAL_SIDES[0] * side_px:g} and {_FOCAL_SIDES[1] * side_px:g} for {side_px} px "
            "(a field of view of 6° to 157°)",
        )
        require(
            _AXIS_SHARES[0] * side_px <= centre_px <= _AXIS_SHARES[1] * side_px,
            f"{name}: c{key} is {centre_px:g} px, but must lie near the middle of {side_px} px, "
            f"between {_AXIS_SHARES[0] * side_px:.0f} and {_AXIS_SHARES[1] * side_px:.0f}: are the "
            "intrinsics those of another size of image?",
        )
    require(
        1.0 / _MOST_ASPECT <= fx / fy <= _MOST_ASPECT,
        f"{name}: fx is {fx:g} px and fy {fy:g} px, but pixels are about square: one may be at "
        f"most {_MOST_ASPECT:g} times the other",
    )


def _check_display(eye: str, display: EyeDisplay) -> None:
    K, H0 = display.K, display.H0
    _check_camera(f"{eye}.K", K)
    require(
        bool((np.abs(H0) < 10).all())
        and H0[2, 2] == 1
        and min(H0[0, 0], H0[1, 1], np.linalg.det(H0)) > 0.01,
        f"{eye}.H0 must be a homography near the identity, with H0[2, 2] = 1",
    )
    require(
        bool((np.abs(display.t_C0_V_m) < 0.1).all()),
        f"{eye}.t_C0_V_m must be three numbers below 0.1 (metres)",
    )
    require(
        0.1 <= display.z_C0_S_m <= 100,
        f"{eye}.z_C0_S_m must lie between 0.1 and 100 (metres), got {display.z_C0_S_m}",
    )
    _check_size(eye, display.width_px, display.height_px)
    _check_optics(
        f"{eye}.K", display.width_px, display.height_px, K[0, 0], K[1, 1], K[0, 2], K[1, 2]
    )
    across_deg = float(np.degrees(2.0 * np.arctan(0.5 * display.width_px / K[0, 0])))
    require(
        _ACROSS_DEG[0] <= across_deg <= _ACROSS_DEG[1],
        f"{eye}.K: the display is {across_deg:.0f}° across, but must be {_ACROSS_DEG[0]:g}° to "
        f"{_ACROSS_DEG[1]:g}°: fx is {K[0, 0]:g} px for {display.width_px} px",
    )
    check_view(f"{eye}.T_V_H", display.T_V_H)


def _check_origin(name: str, origin: Origin) -> None:
    for field in ("method", "made", "verdict", "reason"):
        _check_line(f"{name}.{field}", getattr(origin, field), MAX_TEXT)
    require(origin.views > 0, f"{name}.views must be above 0")
    require(0 <= origin.rms_px < np.inf, f"{name}.rms_px must be a number that is not negative")
    require(
        0 < len(origin.parameters) <= MAX_PARAMETERS,
        f"{name}.parameters must hold 1 to {MAX_PARAMETERS} names",
    )
    for parameter in origin.parameters:
        _check_line(f"{name}.parameters", parameter, MAX_NAME)
    _check_covariance(f"{name}.covariance", origin.covariance)


def check_headset(headset: HeadsetIdentity) -> None:
    """Raise ValueError, naming the field and what is expected, if a report is implausible."""
    require(
        0 < len(headset.device_id) <= MAX_ID and set(headset.device_id) <= set(hexdigits),
        f"headset.device_id must be 1 to {MAX_ID} hexadecimal digits",
    )
    for field in ("name", "runtime", "app"):
        _check_line(f"headset.{field}", getattr(headset, field), MAX_NAME, may_be_empty=True)
    require(0 <= headset.protocol < 2**16, "headset.protocol must lie between 0 and 65535")
    require(
        headset.eye_distance_m is None or 0.03 <= headset.eye_distance_m <= 0.1,
        "headset.eye_distance_m must lie between 0.03 and 0.1 (metres)",
    )
    for eye, view in headset.views.items():
        name = f"headset.{eye}"
        check_view(f"{name}.T_V_H", view.T_V_H)
        _check_size(name, view.width_px, view.height_px)
        left, right, up, down = view.tangents
        require(
            bool((np.abs(view.tangents) < 10).all()) and left < right and up < down,
            f"{name}.tangents must be left, right, up and down edge of the view, below 10, with "
            "left < right and up < down",
        )
        fx, fy = view.width_px / (right - left), view.height_px / (down - up)
        centre = -left * fx - 0.5, -up * fy - 0.5
        _check_optics(f"{name}.tangents", view.width_px, view.height_px, fx, fy, *centre)


def _check_depth_check(check: DepthCheck) -> None:
    name = "depth_check"
    _check_line(f"{name}.made", check.made, MAX_TEXT)
    require(check.views > 0, f"{name}.views must be above 0")
    require(0.5 <= check.scale <= 2.0, f"{name}.scale must lie between 0.5 and 2")
    require(abs(check.offset_m) <= 1.0, f"{name}.offset_m must lie between -1 and 1 (metres)")
    _check_covariance(f"{name}.covariance", check.covariance)
    edges_m = check.ranges_m.ravel()
    require(
        0 < len(check.ranges_m) <= MAX_RANGES
        and bool((np.diff(edges_m) >= 0).all())
        and 0 <= edges_m[0] <= edges_m[-1] <= 100,
        f"{name}.flatness must hold 1 to {MAX_RANGES} ranges of depth, ascending, of 0 to 100 "
        "(metres)",
    )
    values_m = np.concatenate([check.flatness_m, check.flatness_sigma_m])
    require(
        bool(((values_m >= 0) & (values_m < 1)).all()),
        f"{name}.flatness must be at least 0 and below 1 (metres), and so its σ",
    )


def _check_depth_edges(edges: DepthEdges) -> None:
    name = "depth_edges"
    require(edges.source == "measured", f"{name} must be measured ones")
    _check_line(f"{name}.made", edges.made, MAX_TEXT)
    require(edges.views > 0, f"{name}.views must be above 0")
    require(abs(edges.fatten_px) <= 20.0, f"{name}.fatten_px must lie between -20 and 20")
    require(0.0 < edges.sigma_px <= 20.0, f"{name}.sigma_px must be above 0, and 20 at most")


def _check_display_check(check: DisplayCheck) -> None:
    name = "display_check"
    _check_line(f"{name}.made", check.made, MAX_TEXT)
    for field in ("device_id", "runtime", "app"):
        _check_line(f"{name}.{field}", getattr(check, field), MAX_NAME, may_be_empty=True)
    require(bool(check.problems), f"{name} must be of at least one eye")
    for eye, problem in check.problems.items():
        _check_line(f"{name}.{eye}", problem, MAX_TEXT, may_be_empty=True)


def _check_covariance(name: str, covariance: Float64) -> None:
    require(
        bool(np.isfinite(covariance).all())
        and np.allclose(covariance, covariance.T, rtol=1e-6, atol=0.0)
        and bool((np.diag(covariance) >= 0).all()),
        f"{name} must be finite and symmetric, with variances that are not negative",
    )


def _check_line(name: str, text: object, longest: int, *, may_be_empty: bool = False) -> None:
    require(
        isinstance(text, str)
        and (may_be_empty or bool(text))
        and len(text) <= longest
        and text.isprintable(),
        f"{name} must be one line of {0 if may_be_empty else 1} to {longest} printable characters",
    )


def _check_camera(name: str, K: Float64) -> None:
    require(
        bool((np.abs(K) < 1e6).all())
        and np.array_equal(np.tril(K, -1), np.zeros((3, 3)))
        and K[0, 0] >= 1
        and K[1, 1] >= 1
        and K[2, 2] == 1,
        f"{name} must be finite and upper triangular with positive focal lengths, at least 1 "
        "pixel, and 1 at the lower right",
    )


def _check_size(name: str, width: int, height: int) -> None:
    require(
        1 <= width <= MAX_DEVICE_SIDE_PX and 1 <= height <= MAX_DEVICE_SIDE_PX,
        f"{name}: width_px and height_px must lie between 1 and {MAX_DEVICE_SIDE_PX}, "
        f"got {width} and {height}",
    )


def _check_rigid(name: str, T: Float64) -> None:
    require(
        is_rigid(T, reach_m=np.inf),
        f"{name} must be a rigid transform: an orthonormal, right-handed rotation over 0 0 0 1",
    )
    require(bool((np.abs(T[:3, 3]) < 1).all()), f"{name}: the translation must be below 1 (metres)")
