"""Rotation-constrained ICP as published, its three-row form, and plain ICP as the baseline.

All three pair each hand point with its nearest cursor point, start from coinciding means, and
ignore cuts, outliers and rotations of the hand. They serve for comparison.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from small_gicp import KdTree

from handcal.core.errors import HandcalError, extra_advice
from handcal.core.geometry import rigid, transform
from handcal.core.types import Float64
from handcal.register.model import fit_shift, predict
from handcal.register.surface import nearest

Checkpoint: TypeAlias = Callable[[], object]
MAX_ITERATIONS = 800
# The paper stops when the ratio of successive errors exceeds this value.
PAPER_RATIO = 0.9999
# Pairs that coincide to a nanometre leave only rounding errors, whose ratio is meaningless.
_EXACT_M2 = 1e-18
# The three-row form and ICP stop when no pair changes any more.
TOLERANCE_M = 1e-7
_ANY_DISTANCE_M = 1e9


@dataclass(frozen=True, slots=True, eq=False)
class Iterated:
    """The end of an iteration: φ, the moved hand, its partners and the reason for stopping."""

    shift_m: Float64
    moved_m: Float64
    partner_m: Float64
    history_m2: Float64
    converged: bool
    stop_reason: str
    best_shift_m: Float64
    """φ of the iteration with the smallest mean squared distance of the pairs."""


def solve_paper(
    cursor_m: Float64, hand_m: Float64, distance_m: float, checkpoint: Checkpoint = lambda: None
) -> Iterated:
    """Solve as in Hu et al. 2021: rows contracted with λ, SVD, stop at 1 > e_k/e_(k-1) > 0.9999.

    With a rotated hand it can alternate between two states up to the last iteration; the result
    then depends on the number of iterations, but `Iterated.best_shift_m` does not.

    Parameters
    ----------
    cursor_m, hand_m : (N, 3), (M, 3) float64
        In E0(t_b).
    distance_m : float
        z(C0→S).
    checkpoint : callable
        Called before each iteration; any exception it raises ends the solving.
    """
    phi_4 = 1.0 / distance_m
    tree = KdTree(cursor_m)
    shift_m = hand_m.mean(axis=0) - cursor_m.mean(axis=0)
    moved = hand_m - shift_m
    history: list[float] = []
    best_m = shift_m
    while True:
        checkpoint()
        partner, error_m2 = _pair(tree, cursor_m, moved)
        if not history or error_m2 < min(history):
            best_m = shift_m
        history.append(error_m2)
        if error_m2 < _EXACT_M2:
            return _ended(shift_m, moved, partner, history, "pairs coincide", best_m)
        if len(history) > 1 and 1.0 > history[-1] / history[-2] > PAPER_RATIO:
            return _ended(shift_m, moved, partner, history, "error ratio above 0.9999", best_m)
        if len(history) == MAX_ITERATIONS:
            return _ended(shift_m, moved, partner, history, None, best_m)
        lam = moved - partner
        pull = 1.0 - phi_4 * hand_m[:, 2]
        A = -np.column_stack(
            [
                lam[:, 0] * pull,
                lam[:, 1] * pull,
                phi_4 * np.sum(lam[:, :2] * hand_m[:, :2], axis=1) + lam[:, 2],
            ]
        )
        b = np.sum((partner - hand_m) * lam, axis=1)
        shift_m = np.linalg.lstsq(A, b, rcond=None)[0]
        moved = predict(hand_m, shift_m, distance_m, exact=False)


def solve_linear(
    cursor_m: Float64, hand_m: Float64, distance_m: float, checkpoint: Checkpoint = lambda: None
) -> Iterated:
    """Solve the paper's model with all three rows of each pair; parameters as in `solve_paper`."""
    tree = KdTree(cursor_m)
    shift_m = hand_m.mean(axis=0) - cursor_m.mean(axis=0)
    moved = hand_m - shift_m
    history: list[float] = []
    while True:
        checkpoint()
        partner, error_m2 = _pair(tree, cursor_m, moved)
        history.append(error_m2)
        previous_m = shift_m
        shift_m = fit_shift(partner, hand_m, distance_m, exact=False)
        moved = predict(hand_m, shift_m, distance_m, exact=False)
        if np.abs(shift_m - previous_m).max() < TOLERANCE_M:
            return _ended(shift_m, moved, partner, history, "step below 0.1 µm")
        if len(history) == MAX_ITERATIONS:
            return _ended(shift_m, moved, partner, history, None)


def solve_icp(
    cursor_m: Float64, hand_m: Float64, checkpoint: Checkpoint = lambda: None
) -> Iterated:
    """Register rigidly, point to point (Besl & McKay 1992), and read φ from the translation.

    UQ's translation is -φ at E's origin. This is the paper's baseline. Parameters as in
    `solve_paper`.
    """
    tree = KdTree(cursor_m)
    T = rigid(translation_m=cursor_m.mean(axis=0) - hand_m.mean(axis=0))
    history: list[float] = []
    while True:
        checkpoint()
        moved = transform(T, hand_m)
        partner, error_m2 = _pair(tree, cursor_m, moved)
        history.append(error_m2)
        step = best_rigid(moved, partner)
        T = step @ T
        if np.abs(transform(step, moved) - moved).max() < TOLERANCE_M:
            return _ended(-T[:3, 3], moved, partner, history, "step below 0.1 µm")
        if len(history) == MAX_ITERATIONS:
            return _ended(-T[:3, 3], moved, partner, history, None)


def solve_icp_open3d(
    cursor_m: Float64, hand_m: Float64, checkpoint: Checkpoint = lambda: None
) -> Iterated:
    """Solve as `solve_icp`, with Open3D's point-to-point registration.

    Start and stop rule are the same, and no pair is too far apart, so that only the implementation
    differs. Parameters as in `solve_paper`.

    Raises
    ------
    HandcalError
        If Open3D is not installed.
    """
    try:
        import open3d
    except ImportError as error:
        raise HandcalError(
            "the method icp-open3d needs Open3D", f"{extra_advice('3d')}, or choose icp"
        ) from error
    registration = open3d.pipelines.registration
    cursor, hand = (
        open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.array(cloud_m)))
        for cloud_m in (cursor_m, hand_m)
    )
    estimation = registration.TransformationEstimationPointToPoint()
    once = registration.ICPConvergenceCriteria(max_iteration=1)
    T = rigid(translation_m=cursor_m.mean(axis=0) - hand_m.mean(axis=0))
    moved = transform(T, hand_m)
    history: list[float] = []
    while True:
        checkpoint()
        found = registration.registration_icp(hand, cursor, _ANY_DISTANCE_M, T, estimation, once)
        T, before = np.array(found.transformation), moved
        moved = transform(T, hand_m)
        history.append(found.inlier_rmse**2)
        is_still = np.abs(moved - before).max() < TOLERANCE_M
        if is_still or len(history) == MAX_ITERATIONS:
            partner = np.empty_like(hand_m)
            pairs = np.asarray(found.correspondence_set)
            partner[pairs[:, 0]] = cursor_m[pairs[:, 1]]
            reason = "step below 0.1 µm" if is_still else None
            return _ended(-T[:3, 3], moved, partner, history, reason)


def best_rigid(source_m: Float64, target_m: Float64) -> Float64:
    """Return the least-squares rigid ``T_target_source`` of pairs (Kabsch 1976)."""
    source_mean, target_mean = source_m.mean(axis=0), target_m.mean(axis=0)
    R = best_rotation(source_m - source_mean, target_m - target_mean)
    return rigid(R, target_mean - R @ source_mean)


def best_rotation(source_m: Float64, target_m: Float64) -> Float64:
    """Return the (3, 3) rotation that brings centred `source_m` closest to `target_m`."""
    U, _, Vt = np.linalg.svd(target_m.T @ source_m)
    turn: Float64 = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    return turn


def _pair(tree: KdTree, cursor_m: Float64, moved_m: Float64) -> tuple[Float64, float]:
    distance_m, index = nearest(tree, moved_m)
    return cursor_m[index], float(distance_m @ distance_m) / len(moved_m)


def _ended(
    shift_m: Float64,
    moved: Float64,
    partner: Float64,
    history: list[float],
    reason: str | None,
    best_m: Float64 | None = None,
) -> Iterated:
    return Iterated(
        shift_m,
        moved,
        partner,
        np.array(history),
        reason is not None,
        reason or f"limit of {MAX_ITERATIONS} iterations",
        shift_m if best_m is None else best_m,
    )
