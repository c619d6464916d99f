"""The default solver: register the hand rigidly, then fit φ to the registered pairs.

A rotation of the hand between the two moments is a nuisance parameter of the hand, not of the eye.
So is a change of its apparent size: bones do not grow, and the prior says so, but exact pairs may
overrule it (the paper's own simulated data shrink the hand by 1 - φ3φ4).

The segmentation cuts the forearm of each frame where it found the wrist. Points that only one of
the clouds has, and a centroid that moves with the cut, would become part of φ. So both clouds are
cut by one plane across the forearm, fixed in the hand.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np
from small_gicp import KdTree

from handcal.core.display import update_matrix
from handcal.core.geometry import rotation_matrix, rotation_vector, transform
from handcal.core.types import Bool, EyeShift, Float64
from handcal.register.model import balance, balanced_turn, design, predict
from handcal.register.rcicp import best_rotation
from handcal.register.rigid import (
    RigidResult,
    RigidSettings,
    find_patches,
    motion_covariance,
    register_rigid,
)
from handcal.register.shape import Opening, ShapeChange, measure_opening, measure_shape_change
from handcal.register.surface import (
    Indices,
    clip_surface,
    describe_surface,
    mean_point,
    near_cut_edge,
    nearest,
    point_spacing_m,
    quantile,
)

# Points this near the common cut count as beside it.
CUT_BAND_M = 0.002
# Cut edges farther than this from most of them, such as a finger at the image border, are others.
_ONE_EDGE_M = 0.05
# A cut edge is not straight: its innermost part counts.
_INNERMOST, _OUTERMOST = 0.1, 0.99
# What would cut off more of a cloud than a wrist and some palm is no cut across the forearm.
_LEAST_KEPT = 0.6
# The limit is the coordinate of a point; this much beyond it, no rounding leaves that point out.
_BEYOND_POINT_M = 1e-9


def common_cut(
    cursor_m: Float64,
    hand_m: Float64,
    cursor_cut: Bool | None,
    hand_cut: Bool | None,
    T_cursor_hand: Float64,
) -> tuple[Float64, float] | None:
    """Find one plane across the forearm by which two registered clouds can be cut.

    Parameters
    ----------
    cursor_m, hand_m : (M, 3), (N, 3) float64
    cursor_cut, hand_cut : (M,), (N,) bool or None
        Points beside a cut edge; None if unknown.
    T_cursor_hand : (4, 4) float64

    Returns
    -------
    tuple of direction and limit, or None
        The forearm continues along the direction, (3,), of which the limit, m, is the coordinate of
        the plane, in the cursor's frame; None if neither cloud has a cut edge, or it is not across
        the forearm.
    """
    clouds = cursor_m, transform(T_cursor_hand, hand_m)
    given = [
        np.zeros(len(cloud), np.bool_) if cut is None else cut
        for cloud, cut in zip(clouds, (cursor_cut, hand_cut), strict=True)
    ]
    edges = [cloud[cut] for cloud, cut in zip(clouds, given, strict=True)]
    edge_m = np.concatenate(edges)
    if not len(edge_m):
        return None
    wrist_m = edge_m.mean(axis=0)
    near = np.linalg.norm(edge_m - wrist_m, axis=1) < _ONE_EDGE_M
    wrist_m = edge_m[near].mean(axis=0) if near.any() else wrist_m
    middle_m = np.mean([mean_point(cloud) for cloud in clouds], axis=0)
    along = (wrist_m - middle_m) / max(float(np.linalg.norm(wrist_m - middle_m)), 1e-9)
    places = [cloud @ along for cloud in clouds]
    ends = [quantile(place, _OUTERMOST) for place in places]
    for edge in edges:
        at_wrist = edge[np.linalg.norm(edge - wrist_m, axis=1) < _ONE_EDGE_M]
        if len(at_wrist):
            ends.append(quantile(at_wrist @ along, _INNERMOST))
    limit = min(ends) + _BEYOND_POINT_M
    if min(float(np.mean(place <= limit)) for place in places) < _LEAST_KEPT:
        return None
    return along, limit


_POINTS = 1000
# Number of points at which the distance between neighbours of a whole cloud is measured.
_SPACING_POINTS = 200
# First a coarse registration, to cut both clouds at the same place, then a fine one.
_COARSE = RigidSettings(tolerance_m=1e-3)
_FINE = RigidSettings()
# Standard deviation of the hand's apparent change of size between cursor and alignment.
_SIZE_SIGMA = 3e-4
# Effective number of independent pairs: neighbours share the sensor's error.
_INDEPENDENT_PAIRS = 100.0
# A pair farther apart than this many medians is an outlier, unless it is within a point spacing.
_OUTLIER_MEDIANS = 3.0
# Pairs are searched again while that lowers their mean square by more than this: once on measured
# clouds, on exact ones until every point has found its counterpart.
_GAIN = 0.01
# Clouds of which this share is paired one to one hold the same points, as simulated ones may. Other
# points measure nothing along the surface: pairing them would draw two clouds of one pixel grid
# together by up to a pixel.
_SAME_POINTS = 0.97
# An error of φ, over the measured change of shape: which part of a bent hand is the hand, nobody
# can tell. Fitted to pairs of frames of color_aligned_640 and _b.
_SHAPE_SHARE = 1.6
# Lower bound of a registration's error, whatever its residuals say, and the share of the hand's
# movement by a rotation that becomes an error in every direction.
_LEAST_SIGMA_M = 5e-5
_TURNED_SHARE = 0.03
# Probability that a wearer who turned the hand balanced its outline on the cursor, rather than
# turning it about some point. Nobody has measured it.
_BALANCE_SHARE = 0.5


Pairs: TypeAlias = tuple[Float64, Indices, Bool]
"""Each hand point's distance to its partner, m, the partner's index, and if the pair counts."""


@dataclass(frozen=True, slots=True, eq=False)
class HandMatch:
    """Cursor and hand registered rigidly; the same for both eyes."""

    cursor_m: Float64
    """(M, 3)."""
    hand_m: Float64
    """(N, 3); both clouds in one frame."""
    find_pairs: Callable[[Float64], Pairs]
    """Pair (N, 3) places of the hand's points with the cursor's."""
    pairs: Pairs
    """Of the registered hand."""
    same_points: bool
    """True if nearly all points are paired one to one, so that both clouds hold the same points."""
    rigid: RigidResult
    """Its target is the cursor, its source the hand."""
    covariance: Float64
    """(6, 6); of `rigid`, see `motion_covariance`."""
    shape: ShapeChange
    """From the hand to the cursor, without the opening as far as that is known."""
    opening: Opening
    """Change of size from the hand to the cursor."""
    opened: float
    """Share of it that is expected."""
    opening_sigma: float
    """Standard deviation of the rest, as a share of the hand's size."""
    thinned_m: Float64
    """(K, 3); the hand's points within the common cut, thinned."""
    outline_m: Float64
    """(K, 3); the cursor's outline, which the wearer sees."""


class _Turn(NamedTuple):
    """The rotation by which a hand returned, as seen by one eye."""

    turned_rad: Float64
    """(3,)."""
    share: float
    """Share of its square that noise and a change of shape do not explain."""
    scatter_m2: Float64
    """(3, 3); mean of the products of the points' coordinates about the centroid."""


def match_hands(
    cursor_m: Float64,
    hand_m: Float64,
    cursor_cut: Bool | None,
    hand_cut: Bool | None,
) -> HandMatch:
    """Register the hand at t_b to the cursor, (M, 3) and (N, 3) float64 in any common frame."""
    hand = describe_surface(hand_m, hand_cut, _POINTS)
    cursor = describe_surface(cursor_m, cursor_cut, _POINTS)
    outline_m = cursor.points_m[cursor.outline]
    T_cursor_hand = register_rigid(hand, cursor, _COARSE).T_target_source
    tree = KdTree(cursor_m)
    spacing_m = point_spacing_m(tree, cursor_m[:: 1 + len(cursor_m) // _SPACING_POINTS])
    near_cut = near_cut_edge(cursor_m, cursor_m, cursor_cut, spacing_m)
    is_common = np.ones(len(hand_m), np.bool_)
    cut = common_cut(cursor_m, hand_m, cursor_cut, hand_cut, T_cursor_hand)
    if cut is not None:
        along, limit_m = cut
        hand_beyond_m = transform(T_cursor_hand, hand.points_m) @ along - limit_m
        hand = clip_surface(hand, hand_beyond_m, CUT_BAND_M)
        cursor = clip_surface(cursor, cursor.points_m @ along - limit_m, CUT_BAND_M)
        is_common = transform(T_cursor_hand, hand_m) @ along <= limit_m
        near_cut |= cursor_m @ along > limit_m - CUT_BAND_M - spacing_m
    fine = register_rigid(hand, cursor, _FINE, T_cursor_hand)
    patches = find_patches(hand, fine.T_target_source)
    opening = measure_opening(hand, cursor, fine, patches)
    shape = measure_shape_change(hand, cursor, fine)
    rest_m = shape.without_opening(1.0).rms_m
    T_cursor_hand = fine.T_target_source
    find = partial(_pairs, tree, near_cut, is_common, spacing_m)
    pairs = find(transform(T_cursor_hand, hand_m))
    partners = pairs[1][pairs[2]]
    paired_once = np.count_nonzero(np.bincount(partners, minlength=1))
    same_points = bool(paired_once > _SAME_POINTS * len(partners))
    # Of clouds that hold the same points, the fit to their pairs tells more of the size.
    opened, opening_sigma = (0.0, 0.0) if same_points else opening.known(rest_m)
    return HandMatch(
        cursor_m=cursor_m,
        hand_m=hand_m,
        find_pairs=find,
        pairs=pairs,
        same_points=same_points,
        rigid=fine,
        covariance=motion_covariance(fine.rows, hand, T_cursor_hand, patches),
        shape=shape.without_opening(opened),
        opening=opening,
        opened=opened,
        opening_sigma=opening_sigma,
        thinned_m=hand.points_m,
        outline_m=outline_m,
    )


def fit_match(
    match: HandMatch, T_E: Float64, distance_m: float, T_drawn: Float64 | None = None
) -> EyeShift:
    """Fit one eye's φ to registered clouds.

    Parameters
    ----------
    match : HandMatch
    T_E : (4, 4) float64
        To E0(t_b) from the frame of the clouds in `match`.
    distance_m : float
        z(C0→S).
    T_drawn : (4, 4) float64, optional
        Map to the cursor as drawn, if not with the offline calibration: see
        `model.cursor_displacement`.
    """
    T_cursor = T_E if T_drawn is None else T_drawn @ T_E
    gap_m, index, kept = match.pairs
    history = [float(np.mean(gap_m[kept] ** 2))]
    inliers, residuals_m = kept, np.where(kept, gap_m, np.nan)
    # All points of clouds that hold different points were moved by one motion: fewer say as much.
    hand_m = match.hand_m[kept] if match.same_points else match.thinned_m
    seen_m = transform(T_E, hand_m)
    # A hand of the cursor's size would be as much nearer or farther, over the same pixels.
    paired = np.exp(match.opened * match.opening.log_size) * seen_m
    T_fit = (1.0 - match.opened) * match.rigid.T_target_source
    T_fit += match.opened * match.opening.T_target_source
    # The cursor points are those of the hand, moved: the rotation between them is taken out first.
    R, unturned = _unturned(paired, transform(T_cursor @ T_fit, hand_m))
    turn = _measure_turn(match, T_E, R, paired)
    R_turned = rotation_matrix(turn.share * turn.turned_rad)
    outline_m = transform(T_cursor, match.outline_m)
    moved_m = _BALANCE_SHARE * balanced_turn(outline_m, R_turned, mean_point(unturned))
    unturned += moved_m
    rigid_fit_m, _ = _fit_pairs(unturned, paired, distance_m, history[0] / 3.0)
    shift_m = balance(unturned, seen_m, rigid_fit_m, distance_m)
    aspect_m = shift_m - rigid_fit_m
    same_points = match.same_points
    if same_points:
        hand = transform(T_E, match.hand_m)
        shape = predict(hand, shift_m, distance_m, exact=True)
        cursor = transform(T_cursor, match.cursor_m)
        T_back = np.asarray(np.linalg.inv(T_cursor))
        kept = kept & _is_nearest(index, gap_m)
    # Clouds of the same points, as simulated ones: pair, fit and move until no pair changes. The
    # fit to exact pairs leaves nothing to balance.
    while same_points:
        fitted = hand[kept]
        _, partner = _unturned(shape[kept], cursor[index[kept]])
        fit_m, factor = _fit_pairs(partner, fitted, distance_m, history[-1] / 3.0)
        shape = transform(update_matrix(fit_m, distance_m), hand) / factor
        R_next, _ = _unturned(shape[kept], cursor[index[kept]])
        centre = shape[kept].mean(axis=0)
        turned = centre + (shape - centre) @ R_next.T
        gap_m, index, kept = match.find_pairs(transform(T_back, turned))
        kept &= _is_nearest(index, gap_m)
        error_m2 = float(np.mean(gap_m[kept] ** 2))
        if error_m2 >= (1.0 - _GAIN) * history[-1]:
            break
        history.append(error_m2)
        inliers, residuals_m = kept, np.where(kept, gap_m, np.nan)
        R, unturned, paired = R_next, partner, fitted
        shift_m, aspect_m, moved_m = fit_m, np.zeros(3), np.zeros(3)
    if len(history) > 1:
        turn = _measure_turn(match, T_E, R, paired)
    # Of one measure: the registration's is along normals and outlines, and smaller.
    history_m2 = np.array(history) if same_points else match.rigid.history_m2
    return EyeShift(
        shift_m=shift_m,
        covariance_m2=_covariance(match, T_E, turn, moved_m, unturned, paired, distance_m)
        + np.outer(aspect_m, aspect_m),
        rms_m=float(np.sqrt(history[-1])),
        residuals_m=residuals_m,
        inlier_ratio=float(np.mean(inliers)),
        iterations=len(history_m2),
        converged=match.rigid.converged,
        stop_reason=match.rigid.stop_reason,
        history_m2=history_m2,
        method="consistent",
    )


def _fit_pairs(
    cursor_m: Float64, hand_m: Float64, distance_m: float, variance_m2: float
) -> tuple[Float64, float]:
    """Fit φ and the factor κ in ``κ d = UQ s`` to pairs, κ held near 1 - φ3φ4 by a prior.

    With κ = 1 - φ3φ4 + δ the equation gains the column -d for δ and stays linear.
    """
    phi_4, hand, cursor = 1.0 / distance_m, hand_m.T, cursor_m.T
    apart = cursor - hand
    A = np.zeros((4, 3, len(hand_m)))
    A[0, 0] = A[1, 1] = phi_4 * hand[2] - 1.0
    A[2, :2] = phi_4 * apart[:2]
    A[2, 2] = phi_4 * cursor[2] - 1.0
    A[3] = -cursor
    rows = A.reshape(4, -1)
    normal = rows @ rows.T
    normal[3, 3] += variance_m2 * len(hand_m) / _INDEPENDENT_PAIRS / _SIZE_SIGMA**2
    solution = np.linalg.solve(normal, rows @ apart.ravel())
    return np.asarray(solution[:3]), float(1.0 - solution[2] / distance_m + solution[3])


def _covariance(
    match: HandMatch,
    T_E: Float64,
    turn: _Turn,
    moved_m: Float64,
    cursor_m: Float64,
    hand_m: Float64,
    distance_m: float,
) -> Float64:
    """Return the covariance of φ from the uncertainty of the hand's displacement at its centroid.

    Its parts: the registration's own; if the hand returned rotated by R, the unknown
    centre of that turn, which may be any point of the cloud and moves the centroid by (I - R)
    times its distance, and the movement (3,) by which the wearer is expected to have balanced it,
    which is as far from either extreme; the change of the hand's shape and size; and a lower
    bound.
    """
    R_E = T_E[:3, :3]
    R = rotation_matrix(np.sqrt(turn.share) * turn.turned_rad)
    lever = np.eye(3) - R
    turned = lever @ turn.scatter_m2 @ lever.T
    least_m2 = _LEAST_SIGMA_M**2 + _TURNED_SHARE**2 * np.trace(turned)
    measured = match.covariance[3:, 3:] + _SHAPE_SHARE**2 * match.shape.scatter_m2
    shifted_m = match.rigid.T_target_source[:3, :3] @ match.shape.shifted_m
    measured += np.outer(shifted_m, shifted_m)
    displacement = R_E @ measured @ R_E.T + turned + least_m2 * np.eye(3)
    displacement += np.outer(moved_m, moved_m)
    # The rows are linear in the points: their mean is that of the middles.
    middle_m = np.array([mean_point(cursor_m), mean_point(hand_m)])
    # A hand that is larger than expected was held as much farther from the eye.
    displacement += match.opening_sigma**2 * np.outer(middle_m[1], middle_m[1])
    gain = np.linalg.inv(design(middle_m[:1], middle_m[1:], distance_m, exact=True)[0])
    return np.asarray(gain @ displacement @ gain.T, dtype=np.float64)


def _measure_turn(match: HandMatch, T_E: Float64, R: Float64, hand_m: Float64) -> _Turn:
    """Return the turn R of a hand (N, 3), in E, and how much of it is one.

    As much of the change of shape may be a displacement of the hand as a rotation that moves its
    points as far.
    """
    R_E = T_E[:3, :3]
    centred = _centred(hand_m)
    scatter_m2 = np.asarray(centred.T @ centred / len(hand_m))
    turned_rad = rotation_vector(R)
    inertia_m2 = np.trace(scatter_m2) * np.eye(3) - scatter_m2
    shape_m2 = (_SHAPE_SHARE * match.shape.rms_m) ** 2 / 3.0
    explained_rad2 = R_E @ match.covariance[:3, :3] @ R_E.T + shape_m2 * np.linalg.inv(inertia_m2)
    squared = float(turned_rad @ np.linalg.solve(explained_rad2, turned_rad))
    return _Turn(turned_rad, 1.0 - 3.0 / max(squared, 3.0), scatter_m2)


def _pairs(
    tree: KdTree, near_cut: Bool, is_common: Bool, spacing_m: float, hand_m: Float64
) -> Pairs:
    """Return the pairs of hand points.

    Pairs do not count beyond the common cut, beside a cut edge, or much farther apart than most.
    """
    gap_m, index = nearest(tree, hand_m)
    kept = is_common & ~near_cut[index]
    kept &= gap_m <= max(_OUTLIER_MEDIANS * float(np.median(gap_m[kept])), spacing_m)
    return gap_m, index, kept


def _is_nearest(index: Indices, gap_m: Float64) -> Bool:
    """Return (N,): True for the nearest of the points that are paired with the same partner.

    Of two clouds that hold the same points, the others have lost their partner beyond the cut.
    """
    order = np.argsort(gap_m, kind="stable")
    _, first = np.unique(index[order], return_index=True)
    is_nearest = np.zeros(len(index), np.bool_)
    is_nearest[order[first]] = True
    return is_nearest


def _unturned(shape: Float64, partner: Float64) -> tuple[Float64, Float64]:
    """Return the rotation of paired points, and the partners without it, about their centroid."""
    centre = mean_point(partner)
    centred = partner - centre
    R = best_rotation(_centred(shape), centred)
    return R, centre + centred @ R


def _centred(points_m: Float64) -> Float64:
    centred: Float64 = points_m - mean_point(points_m)
    return centred
