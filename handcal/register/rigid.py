"""Rigid registration of two hand clouds that are cut and sampled differently.

A hand seen from one side is a sheet. In its interior, nearest neighbours measure only the distance
of the sheets along their normals; sliding shows only at the outline. So interior pairs count along
the normal and outline pairs in full, which converges in a few Gauss-Newton steps where
point-to-point ICP needs a hundred (see docs/registration.md). Pairs are searched from both clouds,
so that the inward bias of nearest neighbours at an outline cancels, and pairs that end on a cut
edge are dropped, because the hand continues there. Rows that lie much farther apart than most count
less: outliers, flying pixels, and parts of the hand that only one cloud has.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from small_gicp import KdTree

from handcal.core.geometry import invert, rigid, rotation_matrix, transform
from handcal.core.types import Float64
from handcal.register.surface import Indices, Surface, cube_means, mean_point, nearest, quantile

# Pairs are searched again at every step, which lets them slide with the motion they measure, so
# they hold less information than their number says. Fitted to simulated clouds that are not turned,
# 0.5 to 2 mm of noise, trials 1000 to 1059; disjoint samples of real frames differ less.
PAIRING_FACTOR = 1.6
# Errors within a patch of this width count as one: the camera's matching windows, and fingers.
_PATCH_M = 0.022
# Unknown place of a patch of outline, in distances between the points of both clouds: the outline
# is known no better than it is sampled, and edges grow fat.
_OUTLINE_GAPS = 0.1
# So many interior points of each cloud are used until no point of the hand moves by more than this
# in a step, and then all; with a known start all at once, with a tolerance as large never.
_START_INTERIOR, _NEAR_M = 150, 1e-3
# Distance at which an outline pair has a weight of one quarter (Geman-McClure), once the nearest
# quarter of the pairs are closer than half of it.
OUTLIER_M = 0.004
# After this many steps they become shorter, so that pairs that alternate come to rest.
_FULL_STEPS = 12
# Each step is about a quarter of the one before, as the pairs slide. The last one is made longer by
# what is left of that geometric series, which saves the steps that would follow.
_LEFT_AFTER_STEP = 0.3
# Lower bound of each variance, so that exact clouds have one: 10 µm, and 10 µrad.
_EXACT_M2 = 1e-10
# Outline pairs farther apart than twice this quantile weigh less. If one cloud lacks the fingers,
# most of its pairs are wrong; but far from the end, the nearest are no better than the others.
_FAR_SHARE, _NEAR_SHARE = 0.5, 0.25
# A row inside the hand has half its weight at a gap of this, or this many standard deviations, and
# at this many medians of the distance between its points. The weight is flat up to there, so that
# rows with no more than noise count in full.
_INNER_GAP_M, _INNER_SIGMAS, _INNER_MEDIANS = 0.003, 4.0, 4.0
# Of normal noise, over the median of its size.
SIGMA_OF_MEDIAN = 1.48
# Against singular equations, of a motion that no row measures.
_DAMPING = 1e-9


@dataclass(frozen=True, slots=True)
class RigidSettings:
    """Settings of the rigid registration."""

    max_points: int = 1500
    """Number of points to which each cloud is thinned."""
    max_iterations: int = 40
    tolerance_m: float = 1e-4
    """The iteration stops when a step moves no point of the hand by more than this."""


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """The rows of a registration: pairs of points, each measured along one direction."""

    centre_m: Float64
    """(3,); mean of the moved source, about which it rotates."""
    at_m: Float64
    """(N, 3); the moved source points."""
    index: Indices
    """(N,); their indices."""
    outlines: int
    """Number of rows between outlines; they come first."""
    toward: Float64
    """(N, 3); unit directions."""
    gap_m: Float64
    weight: Float64
    """(N,); from target to source along the direction, and the weight of each row."""
    trust: Float64
    distance_m: Float64
    """(N,); weight but for what the row measures, and distance of its points."""
    apart_m: Float64
    """(K,); distance from each of the source's points in use to the target's nearest."""

    @property
    def jacobian(self) -> Float64:
        """(6, N); of the gaps with respect to a rotation about the centre and a translation."""
        at, to = (self.at_m - self.centre_m).T, self.toward.T
        J = np.empty((6, len(self.at_m)))
        J[0] = at[1] * to[2] - at[2] * to[1]
        J[1] = at[2] * to[0] - at[0] * to[2]
        J[2] = at[0] * to[1] - at[1] * to[0]
        J[3:] = to
        return J


class Patches(NamedTuple):
    """Division of a surface into patches."""

    of_point: Indices
    """(N,)."""
    number: int


@dataclass(frozen=True, slots=True, eq=False)
class RigidResult:
    """A rigid registration."""

    T_target_source: Float64
    """(4, 4)."""
    information: Float64
    """(6, 6); final Gauss-Newton matrix for a rotation (rad) about the source's centroid and
    a translation (m), for residuals of unit variance."""
    history_m2: Float64
    """(iterations,); weighted mean squared residual at each iteration."""
    converged: bool
    stop_reason: str
    rows: Rows
    """Pairs of the last step, with the gaps that it left."""


def register_rigid(
    source: Surface,
    target: Surface,
    settings: RigidSettings = RigidSettings(),
    T_start: Float64 | None = None,
) -> RigidResult:
    """Register `source` to `target`.

    Parameters
    ----------
    source, target : Surface
        From `describe_surface`.
    settings : RigidSettings
    T_start : (4, 4) float64, optional
        Initial T_target_source; by default the means coincide.
    """
    middle_m = mean_point(source.points_m)
    offset_m = mean_point(target.points_m) - middle_m
    T_target_source = rigid(translation_m=offset_m) if T_start is None else T_start
    reach_m = np.linalg.norm(source.points_m - middle_m) / np.sqrt(len(source.points_m))
    history: list[float] = []
    information = np.eye(6)
    reason = None
    is_near = T_start is not None
    needs_all = settings.tolerance_m < _NEAR_M
    for _ in range(settings.max_iterations):
        most = None if is_near else _START_INTERIOR
        rows = registration_rows(source, target, T_target_source, max_interior=most)
        share = 1.0 / max(len(history) - _FULL_STEPS, 1)
        step, information = _step(rows, share)
        length_m = np.linalg.norm(step[:3]) * reach_m + np.linalg.norm(step[3:])
        is_last = length_m < settings.tolerance_m and (is_near or not needs_all)
        if is_last:
            reason = f"step below {settings.tolerance_m * 1e6:.0f} µm"
            step *= 1.0 + _LEFT_AFTER_STEP
        T_step = moved_about(rows.centre_m, step)
        T_target_source = T_step @ T_target_source
        history.append(float(rows.weight @ rows.gap_m**2 / rows.weight.sum()))
        if is_last:
            break
        is_near = is_near or bool(length_m < _NEAR_M)
    return RigidResult(
        T_target_source,
        information,
        np.array(history),
        reason is not None,
        reason or f"limit of {settings.max_iterations} iterations",
        replace(
            rows,
            at_m=transform(T_step, rows.at_m),
            centre_m=rows.centre_m + step[3:],
            gap_m=rows.gap_m + step @ rows.jacobian,
        ),
    )


def registration_rows(
    source: Surface,
    target: Surface,
    T_target_source: Float64,
    bent_m: Float64 | None = None,
    max_interior: int | None = None,
) -> Rows:
    """Pair two surfaces at a given pose.

    Parameters
    ----------
    source, target : Surface
    T_target_source : (4, 4) float64
    bent_m : (N, 3) float64, optional
        Places of the source's points, if its shape is changed.
    max_interior : int, optional
        Number of interior points used from each cloud; by default all. If it is given, the clouds
        may still be far apart, and all interior rows weigh the same.
    """
    R = T_target_source[:3, :3]
    source_m = source.points_m if bent_m is None else bent_m
    trees = (source.tree, source.outline_tree)
    if bent_m is not None:
        outline_tree = KdTree(bent_m[source.outline]) if len(source.outline) else None
        trees = KdTree(bent_m), outline_tree
    moved = transform(T_target_source, source_m)
    T_source_target = invert(T_target_source)
    outline, partner, toward, trust, outline_m = _outline_pairs(
        source, target, moved, T_source_target, R, trees[1]
    )
    inner, inner_partner, normal, inner_m, apart_m = _interior_pairs(
        source, target, moved, T_source_target, R, trees[0], max_interior
    )
    first = np.concatenate([outline, inner])
    second = np.concatenate([partner, inner_partner])
    direction = np.concatenate([toward, normal])
    at = moved.take(first, axis=0)
    gap_m = np.einsum("nd,nd->n", at - target.points_m.take(second, axis=0), direction)
    weight = np.ones(len(first))
    share = _FAR_SHARE if max_interior else _NEAR_SHARE
    if len(outline):
        weight[: len(outline)] = trust * _outline_weight(outline_m, share)
    if max_interior is None:
        weight[len(outline) :] = _inner_weight(gap_m[len(outline) :], inner_m)
    return Rows(
        centre_m=mean_point(moved),
        at_m=at,
        index=first,
        outlines=len(outline),
        toward=direction,
        gap_m=gap_m,
        weight=weight,
        trust=np.concatenate([trust, np.ones(len(inner))]),
        distance_m=np.concatenate([outline_m, inner_m]),
        apart_m=apart_m,
    )


def find_patches(source: Surface, T_target_source: Float64) -> Patches:
    """Return the patch of each of a surface's points, within which errors count as one."""
    moved = transform(T_target_source, source.points_m)
    centres = cube_means(moved, _PATCH_M)
    return Patches(nearest(KdTree(centres), moved)[1], len(centres))


def motion_covariance(
    rows: Rows, source: Surface, T_target_source: Float64, patches: Patches | None = None
) -> Float64:
    """Return the covariance (6, 6) of a registration: rotation about the mean, and translation.

    Parameters
    ----------
    rows : Rows
    source : Surface
    T_target_source : (4, 4) float64
    patches : Patches, optional
        Of `find_patches`, if they are known.
    """
    patches = patches or find_patches(source, T_target_source)
    return solve_rows(rows, rows.jacobian, patches, np.zeros(6))[1]


def solve_rows(
    rows: Rows, jacobian: Float64, patches: Patches, prior: Float64
) -> tuple[Float64, Float64]:
    """Solve rows for K unknowns by least squares.

    Parameters
    ----------
    rows : Rows
    jacobian : (K, N) float64
        Of the gaps.
    patches : Patches
        Of the source's points.
    prior : (K,) float64
        Added to the normal matrix's diagonal.

    Returns
    -------
    solution, covariance : (K,), (K, K) float64
        What closes the gaps. The covariance is estimated from the residuals, of which those in one
        patch of the surface may be correlated in any way (cluster-robust, Liang & Zeger 1986).
    """
    J = rows.weight * jacobian
    inverse = np.linalg.inv(J @ jacobian.T + np.diag(prior + _DAMPING))
    solution = -inverse @ (J @ rows.gap_m)
    left_m = rows.gap_m + solution @ jacobian
    patch, count = patches.of_point.take(rows.index), patches.number
    scores = sums(patch, left_m * J, count)
    outlines = sums(patch[: rows.outlines], J[:, : rows.outlines], count)
    unknown_m = _OUTLINE_GAPS * quantile(rows.apart_m, 0.5)
    meat = PAIRING_FACTOR * count / max(count - len(prior), 1) * scores @ scores.T
    meat += unknown_m**2 * outlines @ outlines.T
    return solution, np.asarray(inverse @ meat @ inverse + _EXACT_M2 * np.eye(len(prior)))


def sums(group: Indices, values: Float64, count: int) -> Float64:
    """Return the sums of the values (K, N) of each of `count` groups, (K, count)."""
    return np.array([np.bincount(group, row, count) for row in values])


def _step(rows: Rows, share: float) -> tuple[Float64, Float64]:
    """Return a share of a Gauss-Newton step, (6,), and its matrix."""
    J = rows.jacobian
    weighted = rows.weight * J
    information = weighted @ J.T
    gradient = weighted @ rows.gap_m
    step = -share * np.asarray(np.linalg.solve(information + _DAMPING * np.eye(6), gradient))
    return step, information


def moved_about(centre_m: Float64, step: Float64) -> Float64:
    """Return the transform of a step: a rotation about a centre, and a translation."""
    R = rotation_matrix(step[:3])
    return rigid(R, centre_m + step[3:] - R @ centre_m)


def _outline_pairs(
    source: Surface,
    target: Surface,
    moved: Float64,
    T_source_target: Float64,
    R: Float64,
    source_outline_tree: KdTree | None,
) -> tuple[Indices, Indices, Float64, Float64, Float64]:
    """Return pairs of outline points found from both clouds.

    Returns
    -------
    tuple
        Indices in both, mean outward directions, trust that both are on the outline and it the
        same, and distances.
    """
    if source_outline_tree is None or target.outline_tree is None:
        none = np.empty(0, dtype=np.intp)
        return none, none, np.empty((0, 3)), np.empty(0), np.empty(0)
    d_1, i_1 = nearest(target.outline_tree, moved.take(source.outline, axis=0))
    back = transform(T_source_target, target.points_m.take(target.outline, axis=0))
    d_2, i_2 = nearest(source_outline_tree, back)
    first = np.concatenate([source.outline, source.outline[i_2]])
    second = np.concatenate([target.outline[i_1], target.outline])
    distance_m = np.concatenate([d_1, d_2])
    toward = source.outward.take(first, axis=0) @ R.T + target.outward.take(second, axis=0)
    agreement = 0.5 * np.sqrt(np.einsum("nd,nd->n", toward, toward))
    toward /= np.maximum(2.0 * agreement, 1e-9)[:, None]
    trust = np.concatenate([source.outline_weight, target.outline_weight]) * agreement**4
    return first, second, toward, trust, distance_m


def _interior_pairs(
    source: Surface,
    target: Surface,
    moved: Float64,
    T_source_target: Float64,
    R: Float64,
    source_tree: KdTree,
    max_interior: int | None,
) -> tuple[Indices, Indices, Float64, Float64, Float64]:
    """Return pairs found from both clouds: indices, mean normals, distances.

    The last are the distances of all of the source's points in use.
    """
    step_1, step_2 = (
        1 if max_interior is None else 1 + (len(points_m) - 1) // max_interior
        for points_m in (source.points_m, target.points_m)
    )
    apart_m, i_1 = nearest(target.tree, moved[::step_1])
    keep_1 = np.flatnonzero(~target.near_cut[i_1])
    apart_2_m, i_2 = nearest(source_tree, transform(T_source_target, target.points_m[::step_2]))
    keep_2 = np.flatnonzero(~source.near_cut[i_2])
    first = np.concatenate([step_1 * keep_1, i_2[keep_2]])
    second = np.concatenate([i_1[keep_1], step_2 * keep_2])
    # On a curved surface a point lies below its partner's tangent plane; the mean of both normals
    # has no such bias (symmetric ICP, Rusinkiewicz 2019).
    normals = target.normals.take(second, axis=0)
    others = (source.normals @ R.T).take(first, axis=0)
    cosine = np.einsum("nd,nd->n", normals, others)
    normals += np.copysign(1.0, cosine)[:, None] * others
    normals /= np.sqrt(2.0 + 2.0 * np.abs(cosine))[:, None]
    return first, second, normals, np.concatenate([apart_m[keep_1], apart_2_m[keep_2]]), apart_m


def _outline_weight(distance_m: Float64, share: float) -> Float64:
    """Return the weights of outline pairs (N,), of which this share is right (Geman-McClure)."""
    scale_m = max(OUTLIER_M, 2.0 * quantile(distance_m, share))
    return np.asarray(1.0 / (1.0 + (distance_m / scale_m) ** 2) ** 2)


def _inner_weight(gap_m: Float64, distance_m: Float64) -> Float64:
    """Return the weights of interior pairs (N,) by their gap and the distance of their points."""
    if not len(gap_m):
        return np.ones(0)
    apart = distant(np.abs(gap_m), _INNER_GAP_M, _INNER_SIGMAS * SIGMA_OF_MEDIAN)
    return np.asarray(1.0 / (apart * distant(distance_m, 0.0, _INNER_MEDIANS)))


def distant(values_m: Float64, least_m: float, medians: float) -> Float64:
    """Return the inverse weights of values (N,): 2 at a least one, or so many medians."""
    scale_m = max(least_m, medians * quantile(values_m, 0.5), 1e-9)
    return np.asarray(1.0 + (values_m / scale_m) ** 4)
