"""Change of the hand's size and shape between the cursor and the hand.

A wearer covers the outline of a hand that has opened by 1 % by holding it 1 % farther away, so that
φ3 moves by 1 % of the distance. But both clouds are metric: their sizes differ. So the size is
measured like the motion, by one more unknown of the registration's rows.

After the rigid registration, what is left is noise, which changes from point to point, and the
change of shape, which changes from finger to finger. The second is found as a smooth displacement
of the cursor: one vector at each of some 50 nodes, 18 mm apart, with a prior that neighbours move
together (as in embedded deformation, Sumner, Schmid & Pauly 2007, without rotations). A further
rigid motion of the nodes is no change of shape and is removed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack
from scipy.sparse import csr_array
from small_gicp import KdTree

from handcal.core.frozen import brief, freeze
from handcal.core.geometry import invert, transform
from handcal.core.types import Float64
from handcal.register.rcicp import best_rigid
from handcal.register.rigid import (
    OUTLIER_M,
    SIGMA_OF_MEDIAN,
    Patches,
    RigidResult,
    Rows,
    distant,
    moved_about,
    registration_rows,
    solve_rows,
    sums,
)
from handcal.register.surface import Indices, Surface, cube_means, mean_point, quantile

# Edges grow fat, and the thinner of two clouds has the narrower outline; standard deviation of the
# difference. Both sides of a finger tell it from a change of size.
_FAT_SIGMA_M = 0.0005
# Pairs slide, as in a step of the registration: this share is left after one.
_LEFT_AFTER_STEP = 0.2
# Rows that count as one independent measurement of noise.
_ROWS_PER_PAIR = 7.0
# While a step changes the size by more than this many standard deviations, pairs are searched again
# on a hand of that size; at most so many times.
_LARGE_AT_FIRST, _LARGE, _SIZE_STEPS = 2.0, 0.5, 4
# Probability that a hand has opened or closed, and by how much, standard deviation. Assumptions.
_OPEN, _USUAL = 0.3, 0.015
# Least standard deviation: differences of two frames' depth scale and edges. And for each metre of
# the change of shape, as bent fingers look shorter, 1 over some 0.08 m of hand.
_LEAST_SIGMA = 0.0025
_PER_SHAPE_M = 12.0


class Opening(NamedTuple):
    """Change of the hand's size from the source to the target."""

    log_size: float
    """Natural logarithm of the target's size over the source's."""
    sigma: float
    """Its standard deviation, of noise and samples."""
    T_target_source: Float64
    """(4, 4); the similarity that takes the source to the target."""

    def known(self, shape_rms_m: float) -> tuple[float, float]:
        """Return the share of the change to expect, 0 to 1, and σ of what is left of it.

        Most hands do not open at all, so a change that noise may explain is little believed.

        Parameters
        ----------
        shape_rms_m : float
            Another change of shape, rms.
        """
        noise = self.sigma**2 + _LEAST_SIGMA**2 + (_PER_SHAPE_M * shape_rms_m) ** 2
        kept = 1.0 / (1.0 + noise / _USUAL**2)
        fit = 0.5 * self.log_size**2 * kept / noise
        odds = _OPEN / (1.0 - _OPEN) * np.sqrt(1.0 - kept) * np.exp(min(fit, 50.0))
        believed = float(odds / (1.0 + odds))
        expected = kept * self.log_size
        left = believed * (kept * noise + (1.0 - believed) * expected**2)
        return believed * kept, float(np.sqrt(left))


def measure_opening(
    source: Surface, target: Surface, fit: RigidResult, patches: Patches
) -> Opening:
    """Measure the change of size between registered hands.

    Parameters
    ----------
    source, target : Surface
    fit : RigidResult
        From `register_rigid`, of the source to the target.
    patches : Patches
        Of the source's points.
    """
    middle_m = mean_point(source.points_m)
    rows, T, log_size = fit.rows, fit.T_target_source, 0.0
    grown_m = source.points_m
    for step in range(_SIZE_STEPS):
        if step:
            rows = registration_rows(source, target, T, grown_m)
        x, sigma = _solve(rows, patches)
        log_size += float(x[6]) / (1.0 - _LEFT_AFTER_STEP)
        grown_m = middle_m + np.exp(log_size) * (source.points_m - middle_m)
        T = moved_about(rows.centre_m, x[:6]) @ T
        if abs(x[6]) < (_LARGE if step else _LARGE_AT_FIRST) * sigma:
            break
    growth = np.eye(4)
    growth[:3, :3] *= np.exp(log_size)
    growth[:3, 3] = middle_m - growth[:3, :3] @ middle_m
    return Opening(log_size, sigma, T @ growth)


def _solve(rows: Rows, patches: Patches) -> tuple[Float64, float]:
    """Return the motion and the logarithm of the change of size, (7,), and σ of the latter."""
    # At the middle of a pair, as the noise of its source would multiply itself.
    at_m = rows.at_m - rows.centre_m
    along_m = np.einsum("nd,nd->n", at_m, rows.toward) - 0.5 * rows.gap_m
    is_outline = np.zeros(len(along_m))
    is_outline[: rows.outlines] = 1.0
    jacobian = np.vstack([rows.jacobian, along_m, is_outline])
    variance_m2 = float(rows.weight @ rows.gap_m**2 / rows.weight.sum())
    prior = np.zeros(8)
    prior[7] = _ROWS_PER_PAIR * variance_m2 / _FAT_SIGMA_M**2
    solution, covariance = solve_rows(rows, jacobian, patches, prior)
    return solution[:7], float(np.sqrt(covariance[6, 6]))


_NODE_SPACING_M = 0.018
_NODE_CUBE_M = 0.030
# Each point moves with the mean of this many nodes, weighted by their distance.
_NODES_PER_POINT = 4
# Weight of the prior that neighbouring nodes move together, against the pairs of one node.
_STIFFNESS = 0.1
# Steps, and those of a hand of which a part has moved so far, rms, that its rows weigh little at
# first.
_STEPS, _MOST_STEPS, _LARGE_M = 2, 4, 0.002
# Variance of the nodes over that of independent rows. Fitted to disjoint samples of real frames and
# to simulated clouds (2.4 to 6.5).
_NOISE_FACTOR = 4.5
# A row inside the hand has half its weight at this gap, or so many standard deviations, and at this
# distance of its points, or so many medians; more than in the registration, as fingers may move.
_GAP_M, _GAP_SIGMAS = 0.012, 6.0
_APART_M, _APART_MEDIANS = 0.020, 4.0
# What the rows lack in weight holds their nodes in place, as so large a share of a row: parts that
# only one cloud has follow the hand, and do not fly to the nearest part of the other.
_HELD = 0.1
# Nodes as near as this to the one that moved most are reported together.
_REGION_M = 0.035
# Places of a symmetric (3, 3) matrix, each of its pairs once.
_HALF = np.tril_indices(3)
# A spread thumb reaches less far than this share of the fingers' reach.
_THUMB_REACH = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class ShapeChange:
    """The change of the hand's shape from the cursor to the hand."""

    nodes_m: Float64
    """(K, 3); places spread over the cursor."""
    moved_m: Float64
    """(K, 3); how each moved relative to the whole hand, along the cursor's axes."""
    toward_arm: Float64
    """(3,); from the cursor's middle to its cut forearm; zero if none is cut."""
    noise_m: float
    """Root mean square that `moved_m` has without a change of shape."""
    shifted_m: Float64
    """(3,); how the middle of the cursor moves with the whole of the nodes, along the cursor's
    axes: what the rows that the registration takes for outliers would add to it."""

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "nodes_m", np.float64, None, 3)
        freeze(self, "moved_m", np.float64, None, 3)
        freeze(self, "toward_arm", np.float64, 3)
        freeze(self, "shifted_m", np.float64, 3)

    @property
    def rms_m(self) -> float:
        """Root mean square of the change over the hand, without what noise adds."""
        mean_m2 = float(np.mean(np.sum(self.moved_m**2, axis=1)))
        return float(np.sqrt(max(mean_m2 - self.noise_m**2, 0.0)))

    @property
    def scatter_m2(self) -> Float64:
        """(3, 3); mean of the products of the change's coordinates, their trace `rms_m` squared."""
        products = self.moved_m.T @ self.moved_m / len(self.moved_m)
        return np.asarray(products * (self.rms_m**2 / max(float(np.trace(products)), 1e-18)))

    def without_opening(self, share: float) -> ShapeChange:
        """Return the change without a share of its uniform change of size."""
        out_m = self.nodes_m - self.nodes_m.mean(axis=0)
        growth = float(np.vdot(self.moved_m, out_m)) / max(float(np.vdot(out_m, out_m)), 1e-18)
        return replace(self, moved_m=self.moved_m - share * growth * out_m)


def measure_shape_change(cursor: Surface, hand: Surface, fit: RigidResult) -> ShapeChange:
    """Measure how the shape of registered hands differs.

    Parameters
    ----------
    cursor, hand : Surface
    fit : RigidResult
        From `register_rigid`, of the cursor to the hand.
    """
    points, rows, T_hand_cursor = cursor.points_m, fit.rows, fit.T_target_source
    nodes = cube_means(points, _NODE_CUBE_M)
    count = len(nodes)
    node, share = _shares(nodes, points)
    shares = _sparse(node, share, count)
    products = _products(node, share, count)
    stiffness = _STIFFNESS * _laplacian(nodes) + 1e-4 * np.eye(count)
    moved: Float64 = np.zeros((count, 3))
    point_moved: Float64 = np.zeros_like(points)
    for step in range(_MOST_STEPS):
        if step >= _STEPS and np.vdot(moved, moved) < count * _LARGE_M**2:
            break
        if step:
            bent = points + point_moved
            rows = registration_rows(cursor, hand, T_hand_cursor, bent)
        toward = T_hand_cursor[:3, :3].T @ rows.toward.T
        before_m = np.einsum("dn,nd->n", toward, point_moved.take(rows.index, axis=0)) - rows.gap_m
        far_weight = _far_weight(rows)
        weight = rows.trust * far_weight
        normal, wanted = _normal_equation(shares, products, rows.index, toward, weight, before_m)
        prior = len(rows.gap_m) / count * stiffness
        lacking = np.bincount(rows.index, 1.0 - far_weight, len(points))
        prior += _HELD * np.diag(shares.T @ lacking)
        # Coordinates of a node lie side by side, and the prior is the same for each of them.
        for i in range(3):
            normal[i::3, i::3] += prior
        factor = _factor(normal)
        moved = lapack.dpotrs(factor, wanted)[0].reshape(-1, 3)
        point_moved = shares @ moved
    left_m = np.einsum("dn,nd->n", toward, point_moved.take(rows.index, axis=0)) - before_m
    variance_m2 = _NOISE_FACTOR * float(weight @ left_m**2 / weight.sum())
    # The trace of M⁻¹ (M - P) M⁻¹ with the normal matrix M and its part P from the prior, which is
    # the same for each coordinate.
    inverse = _inverse(factor)
    of_node = inverse.reshape(count, -1)
    scatter = max(np.trace(inverse) - np.vdot(of_node, prior @ of_node), 0.0)
    cut_m, middle_m = points[cursor.near_cut], mean_point(points)
    T_moved = best_rigid(nodes, nodes + moved)
    return ShapeChange(
        nodes_m=nodes,
        moved_m=transform(invert(T_moved), nodes + moved) - nodes,
        toward_arm=(mean_point(cut_m) if len(cut_m) else middle_m) - middle_m,
        noise_m=float(np.sqrt(variance_m2 * scatter / count)),
        shifted_m=transform(T_moved, middle_m[None])[0] - middle_m,
    )


def _far_weight(rows: Rows) -> Float64:
    """Return the weights of rows, (N,), that decrease with what they are apart."""
    apart = np.ones(len(rows.gap_m))
    outline_m, inner_m = np.split(rows.distance_m, [rows.outlines])
    if len(outline_m):
        scale_m = max(OUTLIER_M, 3.0 * quantile(outline_m, 0.5))
        apart[: rows.outlines] = (1.0 + (outline_m / scale_m) ** 2) ** 2
    if len(inner_m):
        apart[rows.outlines :] = distant(
            np.abs(rows.gap_m[rows.outlines :]), _GAP_M, _GAP_SIGMAS * SIGMA_OF_MEDIAN
        ) * distant(inner_m, _APART_M, _APART_MEDIANS)
    return np.asarray(1.0 / apart)


def _shares(nodes_m: Float64, points_m: Float64) -> tuple[Indices, Float64]:
    """Return the nodes nearest to each point and their shares in its movement, (N, K) each."""
    index, distance_m2 = KdTree(nodes_m).batch_knn_search(
        points_m, min(_NODES_PER_POINT, len(nodes_m))
    )
    share = np.exp(-0.5 * distance_m2 / _NODE_SPACING_M**2)
    return index.view(np.intp), share / share.sum(axis=1, keepdims=True)


def _sparse(column: Indices, values: Float64, width: int) -> csr_array:
    """Return a sparse matrix (N, width) from the columns and values of its rows, (N, K) each."""
    ends = np.arange(0, values.size + 1, values.shape[1], dtype=np.int32)
    columns = column.astype(np.int32).ravel()
    return csr_array((values.ravel(), columns, ends), shape=(len(values), width))


def _products(node: Indices, share: Float64, count: int) -> csr_array:
    """Return what each point adds to a (K, K) matrix, (N, K²), half of a symmetric one."""
    first, second = np.triu_indices(node.shape[1])
    halved = np.where(first == second, 0.5, 1.0)
    return _sparse(
        node[:, first] * count + node[:, second],
        halved * share[:, first] * share[:, second],
        count**2,
    )


def _normal_equation(
    shares: csr_array,
    products: csr_array,
    point: Indices,
    toward: Float64,
    weight: Float64,
    wanted_m: Float64,
) -> tuple[Float64, Float64]:
    """Return the normal matrix (3K, 3K) and right side (3K,) of the K nodes' movements.

    A row says that its point moves by `wanted_m` along `toward`, (3, rows). The rows of one point
    are added first, as they share its nodes.
    """
    points, count = shares.shape
    i, j = _HALF
    weighted = weight * toward
    summed = products.T @ sums(point, weighted[i] * toward[j], points).T
    half = summed.reshape(count, count, -1).transpose(2, 0, 1)
    normal = np.empty((count, 3, count, 3))
    normal[:, i, :, j] = normal[:, j, :, i] = half + half.transpose(0, 2, 1)
    wanted = shares.T @ sums(point, weighted * wanted_m, points).T
    return normal.reshape(3 * count, 3 * count), np.asarray(wanted.ravel())


def _factor(normal: Float64) -> Float64:
    """Return Cholesky's factor, in the upper triangle; LinAlgError unless positive definite."""
    factor, failed_at = lapack.dpotrf(normal)
    if failed_at:
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    return np.asarray(factor)


def _inverse(factor: Float64) -> Float64:
    """Return the inverse of the matrix of Cholesky's factor."""
    upper = lapack.dpotri(factor)[0]
    return np.asarray(upper + upper.T - np.diag(upper.diagonal()))


def change_text(change: ShapeChange, R_D: Float64) -> str:
    """Say in a few words where the hand's shape differs most, without a full stop.

    Parts of the hand are told only by their place in its outline, so "fingers" are not numbered,
    and a folded thumb is not told from the palm.

    Parameters
    ----------
    change : ShapeChange
    R_D : (3, 3) float64
        From the frame of the change to the depth camera's axes.
    """
    places = (change.nodes_m - change.nodes_m.mean(axis=0)) @ R_D.T
    moved_m = change.moved_m @ R_D.T
    up = -(R_D @ change.toward_arm)[:2]
    up = up / np.linalg.norm(up) if np.linalg.norm(up) > 1e-9 else np.array([0.0, -1.0])
    right = np.array([-up[1], up[0]])
    across, along = places[:, :2] @ right, places[:, :2] @ up
    size_m = np.linalg.norm(moved_m, axis=1)
    worst = int(np.argmax(size_m))
    near = np.linalg.norm(places - places[worst], axis=1) < _REGION_M
    region = near & (size_m > 0.5 * size_m[worst])
    part = _part(across, along, float(across[worst]), float(along[worst]))
    side = np.sign(across[worst])
    move = moved_m[region].mean(axis=0)
    outward, upward = side * float(move[:2] @ right), float(move[:2] @ up)
    ways = {
        "further out": outward,
        "further in": -outward,
        "stretched further": upward,
        "bent further": -upward,
        "farther from you": float(move[2]),
        "nearer to you": -float(move[2]),
    }
    way = max(ways, key=lambda name: ways[name])
    return f"{part} {1e3 * size_m[region].mean():.0f} mm {way} than in the cursor"


def _part(across: Float64, along: Float64, at_across: float, at_along: float) -> str:
    """Name the part of the hand at a place, from the places of all nodes."""
    reach = float(along.max())
    wide = float(np.abs(across).max())
    left, right = int(np.argmin(across)), int(np.argmax(across))
    thumb = right if along[right] < along[left] else left
    is_low = max(at_along, float(along[thumb])) < _THUMB_REACH * reach
    if is_low and at_across * np.sign(across[thumb]) > 0.5 * wide:
        return "thumb"
    if at_along > 0.35 * reach:
        if abs(at_across) < 0.25 * wide:
            return "middle fingers"
        return "fingers on the right" if at_across > 0.0 else "fingers on the left"
    return "wrist" if at_along < 0.6 * float(along.min()) else "palm"


def _laplacian(nodes_m: Float64) -> Float64:
    """Return the graph Laplacian of neighbouring nodes, (K, K), of mean diagonal 1."""
    apart_m = nodes_m[:, None] - nodes_m
    apart_m2 = np.einsum("ijd,ijd->ij", apart_m, apart_m)
    weight = np.exp(-0.5 * apart_m2 / _NODE_SPACING_M**2)
    weight[apart_m2 > (2.0 * _NODE_SPACING_M) ** 2] = 0.0
    np.fill_diagonal(weight, 0.0)
    laplacian = np.diag(weight.sum(axis=1)) - weight
    return np.asarray(laplacian / max(float(np.mean(np.diag(laplacian))), 1e-9))
