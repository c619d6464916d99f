"""Change of the hand's shape between the cursor and the hand.

After the rigid registration, what is left is noise, which changes from point to point, and the
change of shape, which changes from finger to finger. The second is found as a smooth displacement
of the cursor: one vector at each of some 50 nodes, 18 mm apart, with a prior that neighbours move
together (as in embedded deformation, Sumner, Schmid & Pauly 2007, without rotations). A further
rigid motion of the nodes is no change of shape and is removed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lapack
from scipy.sparse import csr_array
from small_gicp import KdTree

from handcal.core.frozen import brief, freeze
from handcal.core.geometry import invert, transform
from handcal.core.types import Float64
from handcal.register.rcicp import best_rigid
from handcal.register.rigid import (
    SIGMA_OF_MEDIAN,
    RigidResult,
    RigidSettings,
    Rows,
    distant,
    registration_rows,
    sums,
)
from handcal.register.surface import Indices, Surface, cube_means, mean_point, quantile

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
        growth = np.vdot(self.moved_m, out_m) / max(np.vdot(out_m, out_m), 1e-18)
        return replace(self, moved_m=self.moved_m - share * growth * out_m)


def measure_shape_change(
    cursor: Surface, hand: Surface, fit: RigidResult, settings: RigidSettings = RigidSettings()
) -> ShapeChange:
    """Measure how the shape of registered hands differs.

    Parameters
    ----------
    cursor, hand : Surface
    fit : RigidResult
        From `register_rigid`, of the cursor to the hand.
    settings : RigidSettings
        Of the search for pairs.
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
            rows = registration_rows(cursor, hand, T_hand_cursor, settings, bent)
        toward = T_hand_cursor[:3, :3].T @ rows.toward.T
        before_m = np.einsum("dn,nd->n", toward, point_moved.take(rows.index, axis=0)) - rows.gap_m
        far_weight = _far_weight(rows, settings)
        weight = rows.trust * far_weight
        normal, wanted = _normal_equation(shares, products, rows.index, toward, weight, before_m)
        prior = len(rows.gap_m) / count * stiffness
        lacking = np.bincount(rows.index, 1.0 - far_weight, len(points))
        prior += _HELD * np.diag(shares.T @ lacking)
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


def _far_weight(rows: Rows, settings: RigidSettings) -> Float64:
    """Return the weights of rows, (N,), that decrease with what they are apart."""
    apart = np.ones(len(rows.gap_m))
    outline_m, inner_m = np.split(rows.distance_m, [rows.outlines])
    if len(outline_m):
        scale_m = max(settings.outlier_m, 3.0 * quantile(outline_m, 0.5))
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
