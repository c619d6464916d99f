"""Local shape of a hand cloud for registration: normals, outline and cut edges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from handcal.errors import HandError
from handcal.types import Bool, Float64

Indices: TypeAlias = NDArray[np.intp]

_NEIGHBOURS = 16
# A point on a straight edge has its neighbours in a half disc, whose centroid lies 4/(3π) radii
# off; over the half disc's rms radius (1/√2) that is 0.6. Inside it is about 1/√16 = 0.25.
_EDGE_NONE, _EDGE_FULL = 0.45, 0.75
# Pairs are dropped within this many point spacings of a point on a cut edge.
_CUT_BAND_SPACINGS = 1.5
# The 4th neighbour lies one spacing off on a grid and 1.09 in a random cloud.
_SPACING_NEIGHBOUR = 4
# Least number of points away from cut edges for a registration.
_LEAST_FREE = 10


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A thinned hand cloud with its local shape."""

    points_m: Float64
    """(N, 3)."""
    normals: Float64
    """(N, 3); unit normals, sign undefined."""
    outward: Float64
    """(N, 3); unit tangent away from the neighbours; on the outline it points out of the hand."""
    near_cut: Bool
    """(N,); within a few point spacings of a cut edge."""
    outline: Indices
    """(M,); indices of the points on the silhouette, cut edges excluded."""
    outline_weight: Float64
    """(M,); confidence that each lies on the silhouette, 0 to 1."""
    tree: cKDTree
    outline_tree: cKDTree
    """Of `points_m` and of its outline."""
    spacing_m: float
    """Distance between neighbours."""


def describe_surface(points_m: Float64, is_cut: Bool | None, max_points: int) -> Surface:
    """Thin a cloud to at most `max_points` and find its normals and outline.

    Parameters
    ----------
    points_m : (N, 3) float64
    is_cut : (N,) bool or None
        True beside a cut edge; None if cuts are unknown.
    max_points : int
        The thinning is random with a fixed seed, so that equal input gives equal output.

    Raises
    ------
    HandError
        If nearly all points lie beside cut edges.
    """
    order = np.random.default_rng(0).permutation(len(points_m))
    thinned = points_m[order[:max_points]]
    tree = cKDTree(thinned)
    distances_m, neighbours = nearest(tree, thinned, _NEIGHBOURS + 1)
    around = thinned[neighbours[:, 1:]]
    centroid = around.mean(axis=1)
    centred = around - centroid[:, None]
    spread, axes = np.linalg.eigh(centred.transpose(0, 2, 1) @ centred)
    normals = axes[:, :, 0]
    outward = thinned - centroid
    outward -= np.sum(outward * normals, axis=1, keepdims=True) * normals
    offset_m = np.linalg.norm(outward, axis=1)
    radius_m = np.sqrt(np.maximum(spread[:, 1] + spread[:, 2], 1e-18) / _NEIGHBOURS)
    weight = np.clip((offset_m / radius_m - _EDGE_NONE) / (_EDGE_FULL - _EDGE_NONE), 0.0, 1.0)
    spacing_m = float(np.median(distances_m[:, _SPACING_NEIGHBOUR]))
    near_cut = near_cut_edge(thinned, points_m, is_cut, spacing_m)
    if np.count_nonzero(~near_cut) < _LEAST_FREE:
        raise HandError(
            "all of the hand lies beside cut edges; hold it free, in the middle of view"
        )
    outline = np.flatnonzero((weight > 0.0) & ~near_cut)
    return Surface(
        points_m=thinned,
        normals=normals,
        outward=outward / np.maximum(offset_m, 1e-12)[:, None],
        near_cut=near_cut,
        outline=outline,
        outline_weight=weight[outline],
        tree=tree,
        outline_tree=cKDTree(thinned[outline]),
        spacing_m=spacing_m,
    )


def near_cut_edge(
    points_m: Float64, cloud_m: Float64, is_cut: Bool | None, spacing_m: float
) -> Bool:
    """Return which of (N, 3) points are too near a cut edge of a cloud for valid pairs.

    Parameters
    ----------
    points_m : (N, 3) float64
    cloud_m : (M, 3) float64
    is_cut : (M,) bool or None
        The cloud's points beside a cut edge.
    spacing_m : float
        Distance between neighbours in the thinner of the two.
    """
    if is_cut is None or not is_cut.any():
        return np.zeros(len(points_m), dtype=np.bool_)
    edge = cKDTree(cloud_m[is_cut])
    distance_m, _ = nearest(edge, points_m, within_m=_CUT_BAND_SPACINGS * spacing_m)
    return np.isfinite(distance_m)


def nearest(
    tree: cKDTree, points_m: Float64, count: int = 1, within_m: float = np.inf
) -> tuple[Float64, Indices]:
    """Return distances to, and indices of, the nearest `count` points, (N,) or (N, count)."""
    distance_m, index = tree.query(points_m, k=count, distance_upper_bound=within_m)
    return np.asarray(distance_m, dtype=np.float64), np.asarray(index, dtype=np.intp)


def cover(points_m: Float64, radius_m: float) -> Indices:
    """Return indices of points of which every other one is within `radius_m`.

    They are chosen in the order of the points, so the axes of the frame do not matter.
    """
    left = np.arange(len(points_m))
    chosen = []
    while len(left):
        chosen.append(left[0])
        apart = points_m[left] - points_m[left[0]]
        left = left[np.einsum("nd,nd->n", apart, apart) > radius_m**2]
    return np.array(chosen, dtype=np.intp)
