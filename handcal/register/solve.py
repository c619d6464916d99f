"""The solvers behind one interface: two clouds in, an eye shift out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from handcal.core.geometry import is_rigid, transform
from handcal.core.types import METHODS, Alignment, Bool, Eye, EyeShift, Float64, Method, Rig
from handcal.register.consistent import fit_match, match_hands
from handcal.register.model import cursor_displacement, design
from handcal.register.rcicp import (
    Checkpoint,
    solve_icp,
    solve_icp_open3d,
    solve_linear,
    solve_paper,
)
from handcal.register.surface import mean_point

MIN_POINTS = 100
MAX_POINTS = 2_000_000
_LEAST_WIDTH_M = 1e-4
_FARTHEST_M = 1e6
_WIDEST_M = 1.0  # root mean square distance from the middle: of a hand in millimetres it is 70
_FARTHEST_SHIFT_M = 0.1
_LARGEST_ROTATION_RAD = 2.0 * np.pi
# Of a single solved eye: the eye box is about 2 cm wide (paper).
_WIDE_EYE_BOX_M = 0.010


def solve_eye_shift(
    cursor_m: ArrayLike,
    hand_m: ArrayLike,
    *,
    display_distance_m: float,
    T_E_W: ArrayLike | None = None,
    method: Method = "consistent",
    cursor_cut: ArrayLike | None = None,
    hand_cut: ArrayLike | None = None,
) -> EyeShift:
    """Solve one eye's shift from C0 to C1 from one alignment of the hand with its cursor.

    Parameters
    ----------
    cursor_m, hand_m : (N, 3), (M, 3) array_like
        The hand at t_a and at t_b, unordered, in W, or in E0(t_b) if `T_E_W` is None.
    display_distance_m : float
        z(C0→S), from C0 to the display's focal plane.
    T_E_W : (4, 4) array_like, optional
        World to E at t_b.
    method : {"consistent", "paper", "linear", "icp", "icp-open3d"}
        ``paper``: Hu et al. 2021 as published. ``linear``: its model, all three rows of each
        pair. ``consistent``: exact factor, robust to cuts, sampling and a rotated hand.
        ``icp``: rigid, the paper's baseline. ``icp-open3d``: the same by Open3D. ``consistent``
        also has the eye box as a wide prior, which matters only for weak alignments, as with a
        strongly rotated hand.
    cursor_cut, hand_cut : (N,), (M,) array_like of bool, optional
        Points beside a cut edge, where the hand or arm continues beyond the cloud. Used only by
        ``consistent``.

    Returns
    -------
    EyeShift

    Raises
    ------
    ValueError
        For an unknown method, wrong shapes, fewer than 100 points, NaN or infinity, points on
        one line, or a distance that is not positive.
    HandError
        If nearly all points lie beside cut edges.
    HandcalError
        If ``icp-open3d`` is chosen and Open3D is not installed.

    Examples
    --------
    >>> import handcal
    >>> session = handcal.example_session()
    >>> alignment = session.alignments[1]
    >>> shift = handcal.solve_eye_shift(
    ...     alignment.cursor_m,
    ...     alignment.hand_m,
    ...     display_distance_m=session.rig.eyes["left"].z_C0_S_m,
    ...     T_E_W=alignment.T_E_W["left"],
    ...     cursor_cut=alignment.cursor_is_cut,
    ...     hand_cut=alignment.hand_is_cut,
    ... )
    >>> print(shift)
    φ = (+5.20 ± 0.92, -4.64 ± 0.54, +3.84 ± 1.99) mm; rms 1.55 mm, 97 % inliers, converged
    """
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}: choose from {', '.join(METHODS)}")
    if not (np.isfinite(display_distance_m) and display_distance_m > 0):
        raise ValueError(f"display_distance_m must be positive, got {display_distance_m}")
    cursor = check_cloud("cursor_m", cursor_m)
    hand = check_cloud("hand_m", hand_m)
    T_E = _check_pose(np.eye(4) if T_E_W is None else T_E_W)
    if method == "consistent":
        cuts = _check_cut("cursor_cut", cursor_cut, cursor), _check_cut("hand_cut", hand_cut, hand)
        return with_eye_box(fit_match(match_hands(cursor, hand, *cuts), T_E, display_distance_m))
    return _solve_baseline(transform(T_E, cursor), transform(T_E, hand), display_distance_m, method)


def solve_alignment(
    alignment: Alignment,
    rig: Rig,
    method: Method = "consistent",
    checkpoint: Checkpoint = lambda: None,
) -> Mapping[Eye, EyeShift]:
    """Solve every eye that took part in an alignment.

    ``consistent`` registers the hand once for both eyes, as its motion is the same for either. It
    adds no prior; `fuse_alignments` does. The other methods may take seconds and call `checkpoint`
    before each iteration; any exception it raises ends the solving.

    Raises
    ------
    ValueError
        For a cloud or pose that `solve_eye_shift` refuses, or no eye.
    HandError
        If nearly all points lie beside cut edges.
    """
    check_alignment(alignment)
    if method == "consistent":
        match = match_hands(
            alignment.cursor_m, alignment.hand_m, alignment.cursor_is_cut, alignment.hand_is_cut
        )
    shifts: dict[Eye, EyeShift] = {}
    for eye in alignment.eyes:
        distance_m = rig.eyes[eye].z_C0_S_m
        T_E = alignment.T_E_W[eye]
        T_drawn = cursor_displacement(alignment.drawn_shift_m[eye], distance_m)
        if method == "consistent":
            shifts[eye] = fit_match(match, T_E, distance_m, T_drawn)
        else:
            cursor = transform(T_drawn @ T_E, alignment.cursor_m)
            hand = transform(T_E, alignment.hand_m)
            shifts[eye] = _solve_baseline(cursor, hand, distance_m, method, checkpoint)
    return shifts


def check_alignment(alignment: Alignment) -> None:
    """Raise ValueError, which names the fault, if an alignment cannot be solved with any rig.

    Times are not compared: those of a recording start again with each loop.
    """
    check_cloud("cursor_m", alignment.cursor_m)
    check_cloud("hand_m", alignment.hand_m)
    for T_E_W in alignment.T_E_W.values():
        _check_pose(T_E_W)
    known = alignment.T_E_W.keys() & alignment.drawn_shift_m.keys()
    if not alignment.eyes or not known.issuperset(alignment.eyes):
        raise ValueError("the alignment names no eye, or one without pose or drawn shift")
    shifts_m = list(alignment.drawn_shift_m.values())
    if not (np.abs(shifts_m) < _FARTHEST_SHIFT_M).all():
        raise ValueError("drawn_shift_m must be three numbers below 0.1 m")
    if not (np.abs(alignment.rotation_rad) < _LARGEST_ROTATION_RAD).all():
        raise ValueError("rotation_rad must be three numbers below one turn")


def check_cloud(name: str, points_m: ArrayLike) -> Float64:
    """Return `points_m` as (N, 3) float64; ValueError names the fault."""
    cloud = np.asarray(points_m, dtype=np.float64)
    if cloud.ndim != 2 or cloud.shape[1] != 3:
        raise ValueError(f"{name} must have shape (N, 3), got {cloud.shape}")
    if not MIN_POINTS <= len(cloud) <= MAX_POINTS:
        raise ValueError(
            f"{name} has {len(cloud)} points; between {MIN_POINTS} and {MAX_POINTS:,} are needed"
        )
    if not (cloud.max() < _FARTHEST_M and cloud.min() > -_FARTHEST_M):
        raise ValueError(f"{name} contains NaN or infinity, or points as far away")
    centred = cloud - mean_point(cloud)
    scatter_m2 = centred.T @ centred / len(cloud)
    if np.linalg.eigvalsh(scatter_m2)[1] < _LEAST_WIDTH_M**2:
        raise ValueError(f"{name} has all its points on one line; a hand's surface is needed")
    if np.trace(scatter_m2) > _WIDEST_M**2:
        raise ValueError(f"{name} looks like millimetres: it is wider than any hand in metres")
    return cloud


def _check_pose(T_E_W: ArrayLike) -> Float64:
    T_E = np.asarray(T_E_W, dtype=np.float64)
    if T_E.shape != (4, 4) or not is_rigid(T_E, _FARTHEST_M):
        raise ValueError("T_E_W must be a rigid transform, a 4×4 matrix in metres")
    return T_E


def _check_cut(name: str, cut: ArrayLike | None, cloud: Float64) -> Bool | None:
    if cut is None:
        return None
    flags = np.asarray(cut)
    if flags.shape != (len(cloud),) or flags.dtype != np.bool_:
        raise ValueError(f"{name} must hold one bool for each of the {len(cloud)} points")
    return flags


def _solve_baseline(
    cursor_m: Float64,
    hand_m: Float64,
    distance_m: float,
    method: Method,
    checkpoint: Checkpoint = lambda: None,
) -> EyeShift:
    """Solve by one of the published methods, in E0(t_b).

    The covariance is that of least squares with independent pairs, which is optimistic for every
    ICP (Censi 2007); only ``consistent`` does better.
    """
    if method in ("icp", "icp-open3d"):
        register = solve_icp if method == "icp" else solve_icp_open3d
        ended = register(cursor_m, hand_m, checkpoint)
    else:
        solver = solve_paper if method == "paper" else solve_linear
        ended = solver(cursor_m, hand_m, distance_m, checkpoint)
    residuals_m = np.linalg.norm(ended.moved_m - ended.partner_m, axis=1)
    A = design(ended.partner_m, hand_m, distance_m, exact=False).reshape(-1, 3)
    variance_m2 = float(residuals_m @ residuals_m) / (3 * len(hand_m) - 3)
    return EyeShift(
        shift_m=ended.shift_m,
        covariance_m2=np.asarray(variance_m2 * np.linalg.inv(A.T @ A)),
        rms_m=float(np.sqrt(np.mean(residuals_m**2))),
        residuals_m=residuals_m,
        inlier_ratio=1.0,
        iterations=len(ended.history_m2),
        converged=ended.converged,
        stop_reason=ended.stop_reason,
        history_m2=ended.history_m2,
        method=method,
    )


def with_eye_box(shift: EyeShift) -> EyeShift:
    """Return the estimate with a wide eye box as prior: uncertain components shrink towards C0."""
    prior = np.eye(3) / _WIDE_EYE_BOX_M**2
    covariance_m2 = np.asarray(np.linalg.inv(np.linalg.inv(shift.covariance_m2) + prior))
    return replace(
        shift,
        shift_m=covariance_m2 @ np.linalg.solve(shift.covariance_m2, shift.shift_m),
        covariance_m2=covariance_m2,
    )
