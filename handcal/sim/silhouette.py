"""The silhouette of the true hand, as an eye sees it, compared with a drawn outline.

A person matches outlines: what is drawn against the rim of their own hand. The rim is that of the
hand's mesh from the eye. It differs from the outline that a camera measured, by the camera's faults
and because eye and camera are at different places.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from handcal.core.display import eye_projection, is_on_display, view_of_eye
from handcal.core.geometry import image_points, invert, project, rigid, transform
from handcal.core.types import Bool, EyeDisplay, Float64, Intrinsics
from handcal.sim.hand import HandModel
from handcal.sim.raster import draw_hand

# The eye's own picture, in which outer rims are told from those before the hand.
_RETINA = Intrinsics(1400, 1400, 800.0, 800.0, 699.5, 699.5)
_RIM_PX = 2.5
_ARM_M = 0.08
# The rim changes by less than a hundredth of a millimetre if the eye moves by this.
_EYE_GRID_M = 0.005
_STEP_M = 1e-3
_SMOOTHED = 4
# A drawn line and a rim of other directions are not of the same part.
_ALIKE = 0.7
_FEWEST_POINTS, _MOST_POINTS = 20, 700
_OUTLIER_MEDIANS = 4.0
_LEAST_OUTLIER_PX = 8.0
_OVERLAY_ITERATIONS = 12
_CONVERGED_M = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class Silhouette:
    """The rim of a hand from one eye, in the hand's frame."""

    points_m: Float64
    """(N, 3)."""
    normals: Float64
    """(N, 3); unit, outward, across the line of sight."""


def silhouette(hand: HandModel, eye_m: Float64) -> Silhouette:
    """Return the outer rim of a hand, with a part of the forearm, from an eye, (3,), hand's frame.

    It is where the surface of the mesh turns away from the eye, with nothing of the hand behind.
    """
    x, y, z = np.rint(eye_m / _EYE_GRID_M).astype(int).tolist()
    return _silhouette(hand, (x, y, z))


@lru_cache(maxsize=64)
def _silhouette(hand: HandModel, eye: tuple[int, int, int]) -> Silhouette:
    eye_m = _EYE_GRID_M * np.array(eye, np.float64)
    vertices = hand.vertices_m.astype(np.float64)
    sight = eye_m - vertices
    facing = np.einsum("ij,ij->i", hand.normals, sight)
    a, b = _edges(hand).T
    crossing = (facing[a] > 0.0) != (facing[b] > 0.0)
    a, b = a[crossing], b[crossing]
    share = (facing[a] / (facing[a] - facing[b]))[:, None]
    points = vertices[a] + share * (vertices[b] - vertices[a])
    normals = hand.normals[a] + share * (hand.normals[b] - hand.normals[a])
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    is_near = (points - hand.wrist_m) @ hand.arm_axis < _ARM_M
    T_eye_hand = _looking_at(eye_m, vertices.mean(axis=0))
    image = draw_hand(hand, T_eye_hand, _RETINA)
    on_hand = cv2.copyMakeBorder(
        np.isfinite(image.depth_m).astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT
    )
    inside_px = cv2.distanceTransform(on_hand, cv2.DIST_L2, 3)
    u, v = np.rint(image_points(transform(T_eye_hand, points), _RETINA)).astype(int).T
    rows = np.clip(v - image.y0 + 1, 0, on_hand.shape[0] - 1)
    columns = np.clip(u - image.x0 + 1, 0, on_hand.shape[1] - 1)
    is_outer = is_near & (inside_px[rows, columns] < _RIM_PX)
    every = -(-np.count_nonzero(is_outer) // _MOST_POINTS)
    return Silhouette(points[is_outer][::every], normals[is_outer][::every])


def outline_normals(outline_px: Float64) -> Float64:
    """Return the outward unit normals (N, 2) of a closed outline (N, 2), in order, in an image."""
    along = np.roll(outline_px, -_SMOOTHED, axis=0) - np.roll(outline_px, _SMOOTHED, axis=0)
    x, y = outline_px.T
    area = np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    normals = np.sign(area) * np.column_stack([along[:, 1], -along[:, 0]])
    return np.asarray(normals / (np.linalg.norm(normals, axis=1)[:, None] + 1e-12))


@dataclass(frozen=True, slots=True, eq=False)
class OutlineView:
    """The view of one open eye, of the world and of a drawn outline."""

    seen: Float64
    """(3, 4); display pixels from world points seen through the display by the true eye."""
    eye_W_m: Float64
    """(3,); the true eye."""
    drawn_px: Float64
    """(N, 2); the outline as drawn; NaN outside the display."""
    normals: Float64
    """(N, 2); unit, outward, in the display."""


def view_outline(
    display: EyeDisplay,
    true_shift_m: Float64,
    T_W_H: Float64,
    drawn: Float64,
    outline_W_m: Float64,
    outward_W: Float64 | None = None,
) -> OutlineView:
    """Return one eye's view of the world and of a drawn outline.

    Parameters
    ----------
    display : EyeDisplay
    true_shift_m : (3,) float64
        φ of the true eye from C0.
    T_W_H : (4, 4) float64
        The headset's pose.
    drawn : (3, 4) float64
        Projection used by the headset: pixels from points in H.
    outline_W_m : (N, 3) float64
        In order around the hand, unless `outward_W` is given.
    outward_W : (N, 3) float64, optional
        Unit vectors away from the hand.
    """
    T_E_W = view_of_eye(display, T_W_H)
    from_world = drawn @ invert(T_W_H)
    drawn_px = project(from_world, outline_W_m)
    if outward_W is None:
        normals = outline_normals(drawn_px)
    else:
        normals = project(from_world, outline_W_m + _STEP_M * outward_W) - drawn_px
        normals /= np.linalg.norm(normals, axis=1)[:, None] + 1e-12
    every = -(-len(drawn_px) // _MOST_POINTS)
    drawn_px, normals = drawn_px[::every].copy(), normals[::every]
    drawn_px[~is_on_display(display, drawn_px)] = np.nan
    return OutlineView(
        eye_projection(display, true_shift_m) @ T_E_W,
        transform(invert(T_E_W), true_shift_m[None])[0],
        drawn_px,
        normals,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Gaps:
    """The places where a drawn outline and the silhouette of a hand belong together."""

    rim_W_m: Float64
    """(K, 3); the points of the silhouette."""
    rim_px: Float64
    across: Float64
    """(K, 2); these points in the display, and the silhouette's outward normals there."""
    gap_px: Float64
    """(K,); from the drawn line to the silhouette along them."""


def find_gaps(
    hand: HandModel,
    T_W_hand: Float64,
    view: OutlineView,
    is_balanced: Callable[[Float64], Bool] | None = None,
) -> Gaps | None:
    """Return where a drawn outline differs from a hand's silhouette; None if too little is drawn.

    Parameters
    ----------
    hand : HandModel
    T_W_hand : (4, 4) float64
        The true pose of the hand.
    view : OutlineView
    is_balanced : callable, optional
        Returns which points of the silhouette, in the hand's frame, this wearer looks at.
    """
    rim = silhouette(hand, transform(invert(T_W_hand), view.eye_W_m[None])[0])
    rim_W_m = transform(T_W_hand, rim.points_m)
    rim_px = project(view.seen, rim_W_m)
    across = project(view.seen, rim_W_m + _STEP_M * rim.normals @ T_W_hand[:3, :3].T) - rim_px
    across /= np.linalg.norm(across, axis=1)[:, None] + 1e-12
    shown = np.flatnonzero(np.isfinite(view.drawn_px[:, 0]))
    if min(len(shown), len(rim_px)) < _FEWEST_POINTS:
        return None
    drawn_px, normals = view.drawn_px[shown], view.normals[shown]
    # A line of another direction is another part: the difference of normals counts like pixels.
    scale_px = 0.15 * float(np.ptp(rim_px[:, 1]))
    tree = KDTree(np.hstack([rim_px, scale_px * across]))
    nearest = np.asarray(tree.query(np.hstack([drawn_px, scale_px * normals]))[1], np.intp)
    n, apart_px = across[nearest], rim_px[nearest] - drawn_px
    gap_px = np.einsum("ij,ij->i", n, apart_px)
    aside_px = np.abs(n[:, 0] * apart_px[:, 1] - n[:, 1] * apart_px[:, 0])
    kept = (np.einsum("ij,ij->i", n, normals) > _ALIKE) & (aside_px < scale_px)
    if is_balanced is not None:
        kept &= is_balanced(rim.points_m)[nearest]
    if kept.sum() < _FEWEST_POINTS:
        return None
    off_px = np.abs(gap_px - np.median(gap_px[kept]))
    kept &= off_px <= max(_OUTLIER_MEDIANS * float(np.median(off_px[kept])), _LEAST_OUTLIER_PX)
    return Gaps(rim_W_m[nearest[kept]], rim_px[nearest[kept]], n[kept], gap_px[kept])


def overlay_outline(
    hand: HandModel,
    T_W_hand: Float64,
    views: Sequence[OutlineView],
    is_balanced: Callable[[Float64], Bool] | None = None,
) -> tuple[Float64, float] | None:
    """Translate a hand until its silhouette covers the drawn outline in all open eyes.

    Gauss-Newton on the gaps between both lines.

    Parameters
    ----------
    hand : HandModel
    T_W_hand : (4, 4) float64
        Initial pose; its rotation is kept.
    views : sequence of OutlineView
        The open eyes.
    is_balanced : callable, optional
        As in `find_gaps`.

    Returns
    -------
    T_W_hand : (4, 4) float64
    rms_px : float
        Remaining gap.
    None
        If almost nothing of the outline is on the displays.
    """
    T_W_hand = T_W_hand.copy()
    rms_px = 0.0
    for _ in range(_OVERLAY_ITERATIONS):
        rows, residuals = [], []
        for view in views:
            gaps = find_gaps(hand, T_W_hand, view, is_balanced)
            if gaps is None:
                continue
            depth = (gaps.rim_W_m @ view.seen[2, :3] + view.seen[2, 3])[:, None, None]
            J = (view.seen[:2, :3] - gaps.rim_px[:, :, None] * view.seen[2, :3]) / depth
            rows.append(np.einsum("ni,nij->nj", gaps.across, J))
            residuals.append(gaps.gap_px)
        if not rows:
            return None
        A, gap_px = np.concatenate(rows), np.concatenate(residuals)
        step_m = -np.linalg.solve(A.T @ A, A.T @ gap_px)
        T_W_hand[:3, 3] += step_m
        rms_px = float(np.sqrt(np.mean(gap_px**2)))
        if np.abs(step_m).max() < _CONVERGED_M:
            break
    return T_W_hand, rms_px


@lru_cache(maxsize=8)
def _edges(hand: HandModel) -> NDArray[np.int32]:
    """Return each edge of the mesh once, (E, 2)."""
    t = hand.triangles
    edges = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
    return np.unique(edges, axis=0)


def _looking_at(eye_m: Float64, middle_m: Float64) -> Float64:
    """Return the transform (4, 4) to a camera at the eye whose axis goes through a point."""
    z = middle_m - eye_m
    z = z / np.linalg.norm(z)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    R = np.array([x, np.cross(z, x), z])
    return rigid(R, -R @ eye_m)
