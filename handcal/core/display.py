"""The eye-display model: the projection to render for an eye that has moved.

Pixel of world point v seen from the offline viewpoint C0: ``ζ m = K H0 E0 v``. Moving the eye by
φ from C0 to C1, in E's axes, puts the update matrix UQ between H0 and E0 (paper, eq. for UQ).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from handcal.core.frozen import readonly, require_kind
from handcal.core.geometry import invert, project, rigid, transform
from handcal.core.types import EYES, Bool, Eye, EyeDisplay, Float64, Rig, Solved

TARGET_SIDE_M = 0.08
TARGET_DEPTHS_M = (0.4, 0.5, 0.6)
"""Distances of the user test's target (Hu et al. 2021, user test)."""


def as_shifts(shifts_m: Mapping[Any, ArrayLike]) -> dict[Eye, Float64]:
    """Return φ of each eye given as a read-only (3,) array.

    Raises
    ------
    ValueError
        For an unknown eye, or a φ that is not three finite numbers.
    """
    unknown = set(shifts_m) - set(EYES)
    if unknown:
        raise ValueError(f"an eye is left or right, not {unknown.pop()!r}")
    read = {eye: readonly(shifts_m[eye], np.float64, (3,)) for eye in EYES if eye in shifts_m}
    if not all(np.isfinite(shift_m).all() for shift_m in read.values()):
        raise ValueError("φ must be finite")
    return read


def update_matrix(shift_m: ArrayLike, display_distance_m: float) -> Float64:
    """Return UQ, the update of the offline model for an eye shift.

    Parameters
    ----------
    shift_m : (3,) array_like
        φ from C0 to C1 in E's axes.
    display_distance_m : float
        z(C0→S), from C0 to the display's focal plane.

    Returns
    -------
    (4, 4) float64
        ``UQ = [[1-φ3φ4, 0, φ1φ4, -φ1], [0, 1-φ3φ4, φ2φ4, -φ2], [0, 0, 1, -φ3], [0, 0, 0, 1]]``
        with φ4 = 1/z(C0→S) (Hu et al. 2021, eq. for UQ).

    Raises
    ------
    ValueError
        If the shift is not three finite numbers, the distance is not positive, or the eye
        would lie on or beyond the focal plane.

    Examples
    --------
    >>> import handcal
    >>> handcal.update_matrix([0.002, 0.0, 0.01], display_distance_m=2.0)
    array([[ 0.995,  0.   ,  0.001, -0.002],
           [ 0.   ,  0.995,  0.   , -0.   ],
           [ 0.   ,  0.   ,  1.   , -0.01 ],
           [ 0.   ,  0.   ,  0.   ,  1.   ]])
    """
    shift = np.asarray(shift_m, dtype=np.float64)
    if shift.shape != (3,) or not np.isfinite(shift).all():
        raise ValueError("shift_m must be three finite numbers in metres")
    if not (np.isfinite(display_distance_m) and display_distance_m > 0):
        raise ValueError(f"display_distance_m must be positive, got {display_distance_m}")
    if shift[2] >= display_distance_m:
        raise ValueError("the shifted eye would lie on or beyond the display's focal plane")
    phi_1, phi_2, phi_3 = shift
    phi_4 = 1.0 / display_distance_m
    scale = 1.0 - phi_3 * phi_4
    return np.array(
        [
            [scale, 0.0, phi_1 * phi_4, -phi_1],
            [0.0, scale, phi_2 * phi_4, -phi_2],
            [0.0, 0.0, 1.0, -phi_3],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def view_of_eye(display: EyeDisplay, T_W_H: Float64) -> Float64:
    """Return ``T_E_W`` for a headset pose: ``[I t(C0→V)] T_V_H T_H_W``."""
    T_E_H = rigid(translation_m=display.t_C0_V_m) @ display.T_V_H
    T_E_W: Float64 = T_E_H @ invert(T_W_H)
    return T_E_W


def eye_projection(display: EyeDisplay, shift_m: ArrayLike = (0.0, 0.0, 0.0)) -> Float64:
    """Return ``K H0 UQ`` (3, 4): pixels on the display from points in E."""
    UQ = update_matrix(shift_m, display.z_C0_S_m)
    P: Float64 = display.K @ display.H0 @ UQ[:3]
    return P


def projection_matrix(display: EyeDisplay, shift_m: ArrayLike = (0.0, 0.0, 0.0)) -> Float64:
    """Return P1 (3, 4), the projection that the headset renders with: pixels from points in V.

    ``P1 = K H0 UQ [I t(C0→V); 0 1]`` (Hu et al. 2021, eq. for P1). A zero shift gives the offline
    calibration.
    """
    P: Float64 = eye_projection(display, shift_m) @ rigid(translation_m=display.t_C0_V_m)
    return P


def projections(rig: Rig, results: Solved) -> dict[Eye, Float64]:
    """Return P1 of both eyes, what the headset renders with after a calibration.

    ``P1 = K H0 UQ [I t(C0→V); 0 1]`` (Hu et al. 2021, eq. for P1). An eye that was not solved keeps
    its offline calibration, φ = 0.

    Parameters
    ----------
    rig : Rig
        The one that the alignments were made with, ``session.rig``.
    results : Results
        From `handcal.solve`; anything with `eyes`, φ of each solved eye.

    Returns
    -------
    dict of eye to (3, 4) float64
        Pixels on the eye's display from points in V, the headset's rendering camera, in metres:
        ``ζ m = P [p_V; 1]``. OpenCV's axes: x right, y down, z forward.

    Raises
    ------
    ValueError
        If an eye would lie on or beyond its display's focal plane.
    TypeError
        If `rig` is no `Rig`.

    Examples
    --------
    >>> import handcal
    >>> session = handcal.example_session()
    >>> P = handcal.projections(session.rig, handcal.solve(session))
    >>> P["left"].shape
    (3, 4)
    >>> u, v, depth = P["left"] @ [0.0, 0.0, 0.5, 1.0]  # half a metre ahead of V
    >>> print(f"{u / depth:.0f} {v / depth:.0f} px")
    614 369 px
    """
    require_kind("rig", rig, Rig)
    solved = results.eyes
    return {
        eye: projection_matrix(display, solved[eye].shift_m)
        if eye in solved
        else projection_matrix(display)
        for eye, display in rig.eyes.items()
    }


def is_on_display(display: EyeDisplay, pixels: Float64) -> Bool:
    """Return (N,): True for pixels (N, 2) within the display."""
    last_px = display.width_px - 0.5, display.height_px - 0.5
    return np.asarray(((pixels >= -0.5) & (pixels <= last_px)).all(axis=1))


def arcmin_from_px(display: EyeDisplay, error_px: ArrayLike) -> Float64:
    """Convert distances on the display's centre from pixels to arcminutes."""
    focal_px = (display.K @ display.H0)[0, 0]
    arcmin: Float64 = 60.0 * np.degrees(np.arctan(np.asarray(error_px) / focal_px))
    return arcmin


def target_corners_m(depth_m: float) -> Float64:
    """Return the corners of the user test's target, (4, 3) in E, clockwise from the upper left.

    A square straight ahead of the offline viewpoint, `depth_m` away.
    """
    half_m = 0.5 * TARGET_SIDE_M
    x = half_m * np.array([-1.0, 1.0, 1.0, -1.0])
    y = half_m * np.array([-1.0, -1.0, 1.0, 1.0])
    return np.column_stack([x, y, np.full(4, depth_m)])


@dataclass(frozen=True, slots=True)
class DrawnMove:
    """The movement of the user test's target on the display when φ changes."""

    right_px: float
    up_px: float
    right_arcmin: float
    up_arcmin: float
    size_ratio: float
    """Above 1 if the target is drawn larger."""


def effect_at(
    display: EyeDisplay, from_shift_m: ArrayLike, to_shift_m: ArrayLike, depth_m: float
) -> DrawnMove:
    """Return the effect of a change of φ on a target at a distance from the offline viewpoint."""
    corners_E_m = target_corners_m(depth_m)
    before_px, after_px = (
        project(eye_projection(display, shift_m), corners_E_m)
        for shift_m in (from_shift_m, to_shift_m)
    )
    right_px, down_px = (after_px - before_px).mean(axis=0)
    right_arcmin, up_arcmin = arcmin_from_px(display, (right_px, -down_px))
    diagonal_px = [float(np.linalg.norm(px[2] - px[0])) for px in (before_px, after_px)]
    return DrawnMove(
        right_px=float(right_px),
        up_px=float(-down_px),
        right_arcmin=float(right_arcmin),
        up_arcmin=float(up_arcmin),
        size_ratio=diagonal_px[1] / diagonal_px[0],
    )


def reprojection_arcmin(
    rig: Rig,
    shifts_m: Mapping[Eye, Float64],
    true_shifts_m: Mapping[Eye, Float64],
    worn_rig: Rig | None = None,
    eyes: Sequence[Eye] = EYES,
) -> float:
    """Return the mean reprojection error seen by the true eyes, in arcmin.

    Evaluated at the corners of the user test's target at its three distances, as tracked by the
    depth camera.

    Parameters
    ----------
    rig : Rig
        The one rendered with.
    shifts_m : mapping of eye to (3,) float64
        φ rendered with, from the C0 of `rig`.
    true_shifts_m : mapping of eye to (3,) float64
        φ of the true eyes, from the C0 of `worn_rig`.
    worn_rig : Rig, optional
        The true rig, if it differs.
    eyes : sequence of eye
        Those that the mean is over.
    """
    worn_rig = worn_rig or rig
    corners_E_m = np.concatenate([target_corners_m(depth_m) for depth_m in TARGET_DEPTHS_M])
    T_H_H = rig.T_H_D @ invert(worn_rig.T_H_D)  # error of the tracked target
    errors = []
    for eye in eyes:
        worn = worn_rig.eyes[eye]
        T_E_H = view_of_eye(worn, np.eye(4))
        target_V_m = transform(worn.T_V_H @ T_H_H @ invert(T_E_H), corners_E_m)
        drawn_px = project(projection_matrix(rig.eyes[eye], shifts_m[eye]), target_V_m)
        needed_px = project(eye_projection(worn, true_shifts_m[eye]), corners_E_m)
        errors.append(arcmin_from_px(worn, np.linalg.norm(drawn_px - needed_px, axis=1)))
    return float(np.mean(errors))
