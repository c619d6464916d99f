"""Local shape of a hand cloud for registration: normals, outline and cut edges."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from small_gicp import KdTree, voxelgrid_sampling

from handcal.core.errors import HandError
from handcal.core.types import Bool, Float64

Indices: TypeAlias = NDArray[np.intp]

_NEIGHBOURS = 12
# A point on a straight edge has its neighbours in a half disc, whose centroid lies 4/(3π) radii
# off; over the half disc's rms radius (1/√2) that is 0.6. Inside it is about 1/√12 = 0.29.
_EDGE_NONE, _EDGE_FULL = 0.45, 0.75
# Pairs are dropped within this many point spacings of a point on a cut edge.
_CUT_BAND_SPACINGS = 1.5
# The 4th neighbour lies one spacing off on a grid and 1.09 in a random cloud.
_SPACING_NEIGHBOUR = 4
# Number of cubes that a hand fills, over the product of its two largest standard deviations in
# cubes, as measured for hands thinned to 500 to 1,500 points.
_AREA = 22.0
# A point whose 8th neighbour is this many times as far as that of most is no part of a surface. Of
# clean clouds a few points at the thinnest tips are; removing so few is not worth the time.
_STRAY_NEIGHBOUR, _STRAY, _FEW_STRAYS = 8, 2.0, 0.01
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
    tree: KdTree
    outline_tree: KdTree | None
    """Of `points_m` and of its outline; None without an outline."""
    spacing_m: float
    """Distance between neighbours."""


def describe_surface(points_m: Float64, is_cut: Bool | None, max_points: int) -> Surface:
    """Thin a cloud to about `max_points` and find its normals and outline.

    Parameters
    ----------
    points_m : (N, 3) float64
    is_cut : (N,) bool or None
        True beside a cut edge; None if cuts are unknown.
    max_points : int
        A larger cloud is thinned to the means of cubes. Of these, strays are dropped: a cube with
        one outlier counts as much as one that is full of points.

    Raises
    ------
    HandError
        If nearly all points lie beside cut edges.
    """
    thinned = thin(points_m, max_points)
    tree = KdTree(thinned)
    count = min(_NEIGHBOURS, len(thinned) - 1)
    index, distance_m2 = tree.batch_knn_search(thinned, count + 1)
    is_stray = _strays(distance_m2)
    if np.count_nonzero(is_stray) > _FEW_STRAYS * len(thinned):
        thinned = thinned[~is_stray]
        tree = KdTree(thinned)
        index, distance_m2 = tree.batch_knn_search(thinned, count + 1)
    # Coordinates come first, so that NumPy works along rows of all points.
    around = np.ascontiguousarray(thinned.T).take(index[:, 1:].T.view(np.intp), axis=1)
    centroid = around.mean(axis=1)
    around -= centroid[:, None]
    # Scatter matrices (3, 3, N); a surface is thinnest along its normal.
    scatter = np.einsum("ikn,jkn->ijn", around, around)
    normals, thickness_m2 = thinnest(scatter.transpose(2, 0, 1))
    # At an edge all neighbours lie on one side: from their centroid to the point leads outwards.
    outward = thinned - centroid.T
    outward -= np.einsum("nd,nd->n", outward, normals)[:, None] * normals
    offset_m = np.sqrt(np.einsum("nd,nd->n", outward, outward))
    # The radius of the neighbourhood in the tangent plane: the trace without the thickness.
    wide_m2 = scatter[0, 0] + scatter[1, 1] + scatter[2, 2] - thickness_m2
    radius_m = np.sqrt(np.maximum(wide_m2, 1e-18) / count)
    weight = np.clip((offset_m / radius_m - _EDGE_NONE) / (_EDGE_FULL - _EDGE_NONE), 0.0, 1.0)
    spacing_m = float(np.sqrt(quantile(distance_m2[:, _SPACING_NEIGHBOUR], 0.5)))
    near_cut = near_cut_edge(thinned, points_m, is_cut, spacing_m)
    outline = np.flatnonzero((weight > 0.0) & ~near_cut)
    return _checked(
        Surface(
            points_m=thinned,
            normals=normals,
            outward=outward / np.maximum(offset_m, 1e-12)[:, None],
            near_cut=near_cut,
            outline=outline,
            outline_weight=weight[outline],
            tree=tree,
            outline_tree=KdTree(thinned[outline]) if len(outline) else None,
            spacing_m=spacing_m,
        )
    )


def _strays(distance_m2: Float64) -> Bool:
    """Return which points are far from their neighbours, (N,), from squared distances (N, K)."""
    if distance_m2.shape[1] <= _STRAY_NEIGHBOUR:
        return np.zeros(len(distance_m2), np.bool_)
    apart_m2 = distance_m2[:, _STRAY_NEIGHBOUR]
    return np.asarray(apart_m2 > _STRAY**2 * quantile(apart_m2, 0.5))


def thin(points_m: Float64, max_points: int) -> Float64:
    """Return about `max_points` means of a cloud's points, or all if there are no more, (M, 3)."""
    return points_m if len(points_m) <= max_points else cube_means(points_m, None, max_points)


def cube_means(points_m: Float64, cube_m: float | None, count: int = 1) -> Float64:
    """Return the means of a cloud's points in each cube of a grid, (M, 3).

    The cubes lie along the principal axes, so the axes of the frame do not matter.

    Parameters
    ----------
    points_m : (N, 3) float64
    cube_m : float or None
        Width of a cube; None for that of which a hand fills about `count`.
    count : int
    """
    middle_m = mean_point(points_m)
    centred = points_m - middle_m
    spread_m2, axes = np.linalg.eigh(centred.T @ centred / len(points_m))
    if cube_m is None:
        area_m2 = _AREA * float(np.sqrt(max(spread_m2[1] * spread_m2[2], 1e-16)))
        cube_m = float(np.sqrt(area_m2 / count))
    along = centred @ axes
    # The axes point to where the cloud reaches farther, so that their signs do not matter.
    signs = np.copysign(1.0, np.ones(len(along)) @ (along * along * along))
    means = signs * voxelgrid_sampling(signs * along, cube_m, 1).points()[:, :3]
    return np.asarray(means @ axes.T + middle_m, np.float64)


def mean_point(points_m: Float64) -> Float64:
    """Return the mean of points (N, 3), by a product, as NumPy's mean is ten times slower here."""
    mean: Float64 = np.full(len(points_m), 1.0 / len(points_m)) @ points_m
    return mean


def quantile(values: Float64, share: float) -> float:
    """Return the quantile of values (N,) nearest in rank; NumPy's takes several times as long."""
    rank = round(share * (len(values) - 1))
    return float(np.partition(values, rank)[rank])


def clip_surface(surface: Surface, beyond_m: Float64, band_m: float) -> Surface:
    """Cut a surface off at a plane.

    Parameters
    ----------
    surface : Surface
    beyond_m : (N,) float64
        Distance of each point beyond the plane; negative for what remains.
    band_m : float
        Points at the plane within this, and a point spacing, are beside the cut edge.

    Raises
    ------
    HandError
        If nearly all points lie beside cut edges.
    """
    is_kept = beyond_m <= 0.0
    kept = np.flatnonzero(is_kept)
    near_cut = surface.near_cut | (beyond_m > -band_m - surface.spacing_m)
    on_outline = ~near_cut[surface.outline]
    outline = (np.cumsum(is_kept) - 1)[surface.outline[on_outline]]
    points_m = surface.points_m.take(kept, axis=0)
    return _checked(
        replace(
            surface,
            points_m=points_m,
            normals=surface.normals.take(kept, axis=0),
            outward=surface.outward.take(kept, axis=0),
            near_cut=near_cut[kept],
            outline=outline,
            outline_weight=surface.outline_weight[on_outline],
            tree=KdTree(points_m),
            outline_tree=KdTree(points_m.take(outline, axis=0)) if len(outline) else None,
        )
    )


def _checked(surface: Surface) -> Surface:
    if np.count_nonzero(~surface.near_cut) < _LEAST_FREE:
        raise HandError(
            "all of the hand lies beside cut edges",
            "hold it free, in the middle of view",
        )
    return surface


def thinnest(scatter: Float64) -> tuple[Float64, Float64]:
    """Return the axis of least spread, (N, 3), of symmetric matrices (N, 3, 3), and the spread.

    The eigenvalue by its closed form (Smith 1961), the eigenvector as the longest cross product
    of two rows of what is left.
    """
    mean = np.trace(scatter, axis1=1, axis2=2) / 3.0
    xx, yy, zz = (scatter[:, i, i] - mean for i in range(3))
    xy, xz, yz = scatter[:, 0, 1], scatter[:, 0, 2], scatter[:, 1, 2]
    p = np.sqrt((xx**2 + yy**2 + zz**2 + 2.0 * (xy**2 + xz**2 + yz**2)) / 6.0)
    determinant = xx * (yy * zz - yz**2) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    angle = np.arccos(np.clip(0.5 * determinant / np.maximum(p, 1e-30) ** 3, -1.0, 1.0)) / 3.0
    lowest = 2.0 * p * np.cos(angle + 2.0 * np.pi / 3.0)
    xx, yy, zz = xx - lowest, yy - lowest, zz - lowest
    crosses = np.array(
        [
            [xy * yz - xz * yy, xz * xy - xx * yz, xx * yy - xy * xy],
            [xy * zz - xz * yz, xz * xz - xx * zz, xx * yz - xy * xz],
            [yy * zz - yz * yz, yz * xz - xy * zz, xy * yz - yy * xz],
        ]
    )
    lengths = np.einsum("cdn,cdn->cn", crosses, crosses)
    best = lengths.argmax(axis=0)
    each = np.arange(len(scatter))
    axis = crosses[best, :, each] / np.sqrt(np.maximum(lengths[best, each], 1e-300))[:, None]
    return axis, mean + lowest


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
    edge_m, band_m = cloud_m[is_cut], _CUT_BAND_SPACINGS * spacing_m
    # Few points are in the box of the edge, and only these are searched for.
    may_be_near = np.ones(len(points_m), np.bool_)
    for at_m, low_m, high_m in zip(points_m.T, edge_m.min(axis=0), edge_m.max(axis=0), strict=True):
        may_be_near &= (at_m >= low_m - band_m) & (at_m <= high_m + band_m)
    candidates = np.flatnonzero(may_be_near)
    is_near = np.zeros(len(points_m), np.bool_)
    if len(candidates):
        distance_m, _ = nearest(KdTree(edge_m), points_m.take(candidates, axis=0))
        is_near[candidates] = distance_m < band_m
    return is_near


def point_spacing_m(tree: KdTree, points_m: Float64) -> float:
    """Return the distance between neighbours in a tree's cloud, at some of its points (N, 3)."""
    _, distance_m2 = tree.batch_knn_search(points_m, _SPACING_NEIGHBOUR + 1)
    return float(np.sqrt(quantile(distance_m2[:, _SPACING_NEIGHBOUR], 0.5)))


def nearest(tree: KdTree, points_m: Float64) -> tuple[Float64, Indices]:
    """Return the distance to, and the index of, the nearest point of each, (N,)."""
    index, distance_m2 = tree.batch_knn_search(points_m, 1)
    return np.sqrt(distance_m2[:, 0]), index[:, 0].view(np.intp)
