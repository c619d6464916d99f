"""Rigid transforms and the pinhole camera: pure functions on arrays.

Transforms are (4, 4) float64, ``T_dst_src``; points are rows of (N, 3) arrays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import ArrayLike

from handcal.core.types import Float64, Intrinsics

_ROTATION_TOLERANCE = 1e-5


def rigid(rotation: ArrayLike | None = None, translation_m: ArrayLike | None = None) -> Float64:
    """Build a transform from a rotation, (3, 3) matrix or (3,) vector in rad, and a translation."""
    T = np.eye(4)
    if rotation is not None:
        R = np.asarray(rotation, dtype=np.float64)
        T[:3, :3] = rotation_matrix(R) if R.shape == (3,) else R
    if translation_m is not None:
        T[:3, 3] = translation_m
    return T


def invert(T_dst_src: Float64) -> Float64:
    """Return ``T_src_dst`` of a rigid ``T_dst_src``."""
    R = T_dst_src[:3, :3]
    return rigid(R.T, -R.T @ T_dst_src[:3, 3])


def rotation_matrix(rotation_rad: Float64) -> Float64:
    """Return the matrix of a rotation vector, (3,); SciPy takes ten times as long."""
    return np.asarray(cv2.Rodrigues(rotation_rad)[0], dtype=np.float64)


def rotation_vector(R: Float64) -> Float64:
    """Return the vector, (3,), rad, of a rotation by less than half a turn.

    SciPy, which makes any matrix a rotation first, takes sixty times as long.
    """
    (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = R.tolist()
    axis = 0.5 * (r21 - r12), 0.5 * (r02 - r20), 0.5 * (r10 - r01)
    sine, cosine = math.hypot(*axis), 0.5 * (r00 + r11 + r22 - 1.0)
    scale = math.atan2(sine, cosine) / sine if sine > 0.0 else 1.0
    return np.array([scale * part for part in axis])


def is_rigid(T: Float64, reach_m: float, tolerance: float = _ROTATION_TOLERANCE) -> bool:
    """Return whether an untrusted (4, 4) matrix, which may hold NaN, is a rigid transform.

    Its rotation must be right-handed and orthonormal to `tolerance`, by default the accuracy of
    float32, and each component of its translation below `reach_m`.
    """
    *upper, last = T.tolist()  # NumPy takes five times as long for so few numbers
    (x, y, z) = rows = [row[:3] for row in upper]
    return (
        last == [0.0, 0.0, 0.0, 1.0]
        and all(abs(row[3]) < reach_m for row in upper)
        and all(abs(value) < 2.0 for row in rows for value in row)
        and all(abs(_dot(row, row) - 1.0) < tolerance for row in rows)
        and all(abs(_dot(*pair)) < tolerance for pair in ((x, y), (y, z), (z, x)))
        and _dot(_cross(x, y), z) > 0.0
    )


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def transform(T_dst_src: Float64, points: ArrayLike) -> Float64:
    """Map (N, 3) points by a (4, 4) affine transform."""
    moved: Float64 = np.asarray(points, dtype=np.float64) @ T_dst_src[:3, :3].T + T_dst_src[:3, 3]
    return moved


def project(P: Float64, points: ArrayLike) -> Float64:
    """Project (N, 3) points by a (3, 4) matrix to (N, 2) pixels.

    Points on or behind the principal plane give NaN.
    """
    homogeneous = np.asarray(points, dtype=np.float64) @ P[:, :3].T + P[:, 3]
    depth = homogeneous[:, 2:]
    pixels: Float64 = homogeneous[:, :2] / np.where(depth > 0, depth, np.nan)
    return pixels


def camera_matrix(intrinsics: Intrinsics) -> Float64:
    """Return the (3, 3) camera matrix K."""
    return np.array(
        [
            [intrinsics.fx, 0.0, intrinsics.cx],
            [0.0, intrinsics.fy, intrinsics.cy],
            [0.0, 0.0, 1.0],
        ]
    )


def image_points(points_m: ArrayLike, intrinsics: Intrinsics) -> Float64:
    """Project (N, 3) points in a camera's frame to (N, 2) pixels, lens distortion included."""
    if not any(intrinsics.distortion):  # several times faster than OpenCV
        return project(np.hstack([camera_matrix(intrinsics), np.zeros((3, 1))]), points_m)
    pixels, _ = cv2.projectPoints(
        np.asarray(points_m, dtype=np.float64),
        np.zeros(3),
        np.zeros(3),
        camera_matrix(intrinsics),
        np.array(intrinsics.distortion),
    )
    return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)


def interpolate_pose(T_0: Float64, T_1: Float64, fraction: float) -> Float64:
    """Interpolate between two poses: the translation linearly, the rotation by slerp.

    They differ by less than half a turn.

    Parameters
    ----------
    T_0, T_1 : (4, 4) float64
    fraction : float
        0 gives `T_0`, 1 gives `T_1`.

    Raises
    ------
    ValueError
        If `fraction` lies outside 0 to 1; poses are not extrapolated.
    """
    if not 0.0 <= fraction <= 1.0:
        raise ValueError(f"fraction {fraction} lies outside 0..1; poses are not extrapolated")
    # SciPy's Slerp, made for many keyframes, is ten times slower.
    turn_rad = rotation_vector(T_0[:3, :3].T @ T_1[:3, :3])
    R = T_0[:3, :3] @ rotation_matrix(fraction * turn_rad)
    return rigid(R, (1.0 - fraction) * T_0[:3, 3] + fraction * T_1[:3, 3])
