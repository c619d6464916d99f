"""Plausibility of a rig: checks of every field, with the error and the expected value."""

from __future__ import annotations

import numpy as np

from handcal.geometry import is_rigid
from handcal.types import EYES, RIG_PARTS, EyeDisplay, Float64, Intrinsics, Origin, Rig

MAX_SIDE_PX = 16384
MAX_NAME, MAX_TEXT = 200, 500
MAX_PARAMETERS = 12


def check_rig(rig: Rig) -> None:
    """Raise ValueError, naming the field and what is expected, if `rig` is implausible."""
    _check_line("name", rig.name, MAX_NAME)
    for eye in EYES:
        _check_display(eye, rig.eyes[eye])
    _check_rigid("T_H_D", rig.T_H_D)
    check_intrinsics("depth_camera", rig.depth_intrinsics)
    for part, origin in rig.origins.items():
        require(part in RIG_PARTS, f"origins may be of {', '.join(RIG_PARTS)}, not of {part}")
        _check_origin(f"origins.{part}", origin)


def check_intrinsics(name: str, intrinsics: Intrinsics) -> None:
    """Raise ValueError, naming the field of `name` and what is expected, if implausible."""
    _check_size(name, intrinsics.width, intrinsics.height)
    fx, fy, cx, cy = intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy
    _check_camera(name, np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]))
    require(
        len(intrinsics.distortion) in (0, 4, 5, 8, 12, 14)
        and bool(np.isfinite(intrinsics.distortion).all()),
        f"{name}.distortion must hold 0, 4, 5, 8, 12 or 14 finite numbers (OpenCV's order)",
    )


def require(condition: bool, problem: str) -> None:
    """Raise ValueError with `problem` unless `condition` holds."""
    if not condition:
        raise ValueError(problem)


def _check_display(eye: str, display: EyeDisplay) -> None:
    K, H0 = display.K, display.H0
    _check_camera(f"{eye}.K", K)
    require(
        bool((np.abs(H0) < 10).all()) and H0[2, 2] == 1 and np.linalg.det(H0) > 0,
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
    _check_rigid(f"{eye}.T_V_H", display.T_V_H)


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
    covariance = origin.covariance
    require(
        bool(np.isfinite(covariance).all())
        and np.allclose(covariance, covariance.T, rtol=1e-6, atol=0.0)
        and bool((np.diag(covariance) >= 0).all()),
        f"{name}.covariance must be finite and symmetric, with variances that are not negative",
    )


def _check_line(name: str, text: str, longest: int) -> None:
    require(
        0 < len(text) <= longest and text.isprintable(),
        f"{name} must be one line of 1 to {longest} printable characters",
    )


def _check_camera(name: str, K: Float64) -> None:
    require(
        bool((np.abs(K) < 1e6).all())
        and np.array_equal(np.tril(K, -1), np.zeros((3, 3)))
        and K[0, 0] > 0
        and K[1, 1] > 0
        and K[2, 2] == 1,
        f"{name} must be finite and upper triangular with positive focal lengths (pixels) and 1 "
        "at the lower right",
    )


def _check_size(name: str, width: int, height: int) -> None:
    require(
        1 <= width <= MAX_SIDE_PX and 1 <= height <= MAX_SIDE_PX,
        f"{name}: width_px and height_px must lie between 1 and {MAX_SIDE_PX}, "
        f"got {width} and {height}",
    )


def _check_rigid(name: str, T: Float64) -> None:
    require(
        is_rigid(T, reach_m=np.inf),
        f"{name} must be a rigid transform: an orthonormal, right-handed rotation over 0 0 0 1",
    )
    require(bool((np.abs(T[:3, 3]) < 1).all()), f"{name}: the translation must be below 1 (metres)")
