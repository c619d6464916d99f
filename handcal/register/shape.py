"""Change of the hand's shape between the cursor and the hand.

After the rigid registration, what is left is noise, which changes from point to point, and the
change of shape, which changes from finger to finger. The second is found as a smooth displacement
of the cursor: one vector at each of some 50 nodes, 18 mm apart, with a prior that neighbours move
alike (as in embedded deformation, Sumner, Schmid & Pauly 2007, without rotations). A further rigid
motion of the nodes is no change of shape and is taken out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.spatial import cKDTree

from handcal.geometry import invert, transform
from handcal.register.rcicp import best_rigid
from handcal.register.rigid import PAIRING_FACTOR, RigidSettings, registration_rows
from handcal.register.surface import Surface, cover, nearest
from handcal.types import Float64, brief, freeze

_NODE_SPACING_M = 0.018
# Each point moves with the mean of this many nodes, weighted by their distance.
_NODES_PER_POINT = 4
# Weight of the prior that neighbouring nodes move alike, against the pairs of one node.
_STIFFNESS = 0.1
_STEPS = 3


@dataclass(frozen=True, slots=True, eq=False)
class ShapeChange:
    """The change of the hand's shape from the cursor to the hand."""

    nodes_m: Float64
    """(K, 3); places spread over the cursor."""
    moved_m: Float64
    """(K, 3); how each moved relative to the whole hand, along the cursor's axes."""
    noise_m: float
    """Root mean square that `moved_m` has without a change of shape."""

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "nodes_m", np.float64, None, 3)
        freeze(self, "moved_m", np.float64, None, 3)

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


def measure_shape_change(
    cursor: Surface,
    hand: Surface,
    T_hand_cursor: Float64,
    settings: RigidSettings = RigidSettings(),
) -> ShapeChange:
    """Measure how the shape of registered hands differs.

    Parameters
    ----------
    cursor, hand : Surface
    T_hand_cursor : (4, 4) float64
        From `register_rigid`.
    settings : RigidSettings
        Of the search for pairs.
    """
    points = cursor.points_m
    nodes = points[cover(points, _NODE_SPACING_M)]
    count = len(nodes)
    tree = cKDTree(nodes)
    per_point = min(_NODES_PER_POINT, count)
    distance_m, node = nearest(tree, points, per_point)
    distance_m, node = distance_m.reshape(-1, per_point), node.reshape(-1, per_point)
    share = np.exp(-0.5 * (distance_m / _NODE_SPACING_M) ** 2)
    share /= share.sum(axis=1, keepdims=True)
    prior = np.kron(_laplacian(nodes, tree), np.eye(3)) + 1e-3 * np.eye(3 * count)
    moved: Float64 = np.zeros((count, 3))
    for _ in range(_STEPS):
        bent = points + np.einsum("nk,nkd->nd", share, moved[node])
        rows = registration_rows(cursor, hand, T_hand_cursor, settings, bent)
        toward = rows.toward @ T_hand_cursor[:3, :3]
        columns = (3 * node[rows.index][:, :, None] + np.arange(3)).ravel()
        values = (share[rows.index][:, :, None] * toward[:, None]).ravel()
        starts = np.arange(len(toward) + 1) * 3 * per_point
        A = csr_matrix((values, columns, starts), (len(toward), 3 * count))
        weighted = (diags(rows.weight) @ A).T.tocsr()
        before = moved
        normal = np.asarray((weighted @ A).toarray()) + _STIFFNESS * len(toward) / count * prior
        wanted = np.asarray(weighted @ (A @ moved.ravel() - rows.gap_m))
        moved = np.asarray(np.linalg.solve(normal, wanted).reshape(-1, 3), np.float64)
    left_m = A @ (moved - before).ravel() + rows.gap_m
    variance_m2 = PAIRING_FACTOR * float(rows.weight @ left_m**2 / rows.weight.sum())
    scatter = np.linalg.solve(normal, np.linalg.solve(normal, (weighted @ A).toarray()).T)
    T_moved = best_rigid(nodes, nodes + moved)
    return ShapeChange(
        nodes_m=nodes,
        moved_m=transform(invert(T_moved), nodes + moved) - nodes,
        noise_m=float(np.sqrt(variance_m2 * np.trace(scatter) / count)),
    )


def _laplacian(nodes_m: Float64, tree: cKDTree) -> Float64:
    """Return the graph Laplacian of neighbouring nodes, (K, K), of mean diagonal 1."""
    first, second = tree.query_pairs(2.0 * _NODE_SPACING_M, output_type="ndarray").T
    apart_m = np.linalg.norm(nodes_m[first] - nodes_m[second], axis=1)
    laplacian = np.zeros((len(nodes_m), len(nodes_m)))
    laplacian[first, second] = -np.exp(-0.5 * (apart_m / _NODE_SPACING_M) ** 2)
    laplacian += laplacian.T
    np.fill_diagonal(laplacian, -laplacian.sum(axis=1))
    return np.asarray(laplacian / max(float(np.mean(np.diag(laplacian))), 1e-9))
