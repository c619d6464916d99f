"""Placement of a hand so that it overlaps a cursor for the true eyes.

The cursor appears on display pixels; the hand is seen through the display along rays. Both meet in
the pixels of the display: a world point p falls on ``K H0 UQ(φ) E0 p`` for the true eye shift φ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from handcal.core.display import eye_projection, is_on_display, view_of_eye
from handcal.core.geometry import invert, project, rigid, transform
from handcal.core.types import EyeDisplay, Float64
from handcal.sim.hand import HandModel

_MATCH_ITERATIONS = 30
_OVERLAY_ITERATIONS = 8
_CONVERGED_M = 1e-6
# Distance from the hand's surface beyond which cursor points lose weight: first and last.
_START_M, _OUTLIER_M = 0.03, 0.003
_FEWEST_POINTS = 20


@dataclass(frozen=True, slots=True, eq=False)
class CursorView:
    """The view of one open eye."""

    seen: Float64
    """(3, 4); display pixels from world points seen through the display by the true eye."""
    drawn_px: Float64
    """(N, 2); pixels of the cursor's points as drawn; NaN outside the display."""


@dataclass(frozen=True, slots=True, eq=False)
class PlacementError:
    """The error of a placement."""

    rotation_rad: Float64
    """(3,); rotation of the hand relative to its cursor."""
    lateral_rad: Float64
    """(2,); angles about two axes across the line of sight."""
    depth_ratio: float
    """Error of the hand's apparent size."""


def match_cursor(hand: HandModel, cursor_m: Float64, T_W_hand: Float64) -> Float64:
    """Return the hand's pose (4, 4) when a cursor was made, by the points that the cursor shows.

    Registration to the hand's surface, point to plane, with robust weights.

    Parameters
    ----------
    hand : HandModel
    cursor_m : (N, 3) float64
        W.
    T_W_hand : (4, 4) float64
        Pose of the hand to within a few centimetres.
    """
    tree = KDTree(hand.vertices_m)
    T_hand_W = invert(T_W_hand)
    for outlier_m in np.geomspace(_START_M, _OUTLIER_M, _MATCH_ITERATIONS):
        points = transform(T_hand_W, cursor_m)
        distance_m, normals = _to_surface(hand, tree, points)
        weights = 1.0 / (1.0 + (distance_m / outlier_m) ** 2) ** 2
        J = np.hstack([np.cross(points, normals), normals])
        JW = J.T * weights
        step = -np.linalg.solve(JW @ J + 1e-9 * np.eye(6), JW @ distance_m)
        T_hand_W = rigid(step[:3], step[3:]) @ T_hand_W
    return invert(T_hand_W)


def _to_surface(hand: HandModel, tree: KDTree, points: Float64) -> tuple[Float64, Float64]:
    """Return each point's signed distance to the plane of its nearest vertex, and the normal."""
    _, nearest = tree.query(points)
    normals = hand.normals[nearest].astype(np.float64)
    return np.einsum("ij,ij->i", points - hand.vertices_m[nearest], normals), normals


def view_through(
    display: EyeDisplay,
    true_shift_m: Float64,
    T_W_H: Float64,
    drawn: Float64,
    cursor_m: Float64,
) -> CursorView:
    """Return one eye's view of the world and of the cursor.

    Parameters
    ----------
    display : EyeDisplay
    true_shift_m : (3,) float64
        φ of the true eye from C0.
    T_W_H : (4, 4) float64
        The headset's pose.
    drawn : (3, 4) float64
        Projection used by the headset: pixels from points in H.
    cursor_m : (N, 3) float64
        W.
    """
    seen = eye_projection(display, true_shift_m) @ view_of_eye(display, T_W_H)
    drawn_px = project(drawn @ invert(T_W_H), cursor_m)
    drawn_px[~is_on_display(display, drawn_px)] = np.nan
    return CursorView(seen, drawn_px)


def overlay_hand(
    surface_m: Float64, T_W_hand: Float64, views: Sequence[CursorView]
) -> tuple[Float64, float] | None:
    """Translate a hand until it overlaps the cursor in all open eyes.

    Gauss-Newton on the mean squared distance in pixels between each drawn cursor point and the
    hand point seen.

    Parameters
    ----------
    surface_m : (N, 3) float64
        The hand's points that the cursor shows, in the hand's frame.
    T_W_hand : (4, 4) float64
        Initial pose; its rotation is kept.
    views : sequence of CursorView
        The open eyes.

    Returns
    -------
    T_W_hand : (4, 4) float64
    rms_px : float
        Remaining distance between hand and cursor.
    None
        If almost nothing of the cursor is on the displays.
    """
    turned = surface_m @ T_W_hand[:3, :3].T
    if sum(np.isfinite(view.drawn_px[:, 0]).sum() for view in views) < _FEWEST_POINTS:
        return None
    translation_m = T_W_hand[:3, 3].copy()
    for _ in range(_OVERLAY_ITERATIONS):
        parts = [_offsets(view, turned + translation_m) for view in views]
        residual_px = np.concatenate([residual for residual, _ in parts])
        J = np.concatenate([jacobian for _, jacobian in parts])
        step_m = -np.linalg.solve(J.T @ J, J.T @ residual_px)
        translation_m += step_m
        if np.abs(step_m).max() < _CONVERGED_M:
            break
    residual_px = np.concatenate([_offsets(view, turned + translation_m)[0] for view in views])
    return rigid(T_W_hand[:3, :3], translation_m), float(np.sqrt(2.0 * np.mean(residual_px**2)))


def _offsets(view: CursorView, points_m: Float64) -> tuple[Float64, Float64]:
    """Return, for drawn points, seen minus drawn (2N,) in px, and its Jacobian in the points."""
    shown = np.isfinite(view.drawn_px[:, 0])
    homogeneous = points_m[shown] @ view.seen[:, :3].T + view.seen[:, 3]
    depth = homogeneous[:, 2:, None]
    seen_px = homogeneous[:, :2] / homogeneous[:, 2:]
    J = (view.seen[:2, :3] - seen_px[:, :, None] * view.seen[2, :3]) / depth
    return (seen_px - view.drawn_px[shown]).ravel(), J.reshape(-1, 3)


def apply_placement_error(T_W_hand: Float64, eye_m: Float64, error: PlacementError) -> Float64:
    """Apply a placement error to a hand seen from `eye_m`: across and along the line of sight.

    Parameters
    ----------
    T_W_hand : (4, 4) float64
        Already rotated by the error.
    eye_m : (3,) float64
        W.
    error : PlacementError
    """
    line_m = T_W_hand[:3, 3] - eye_m
    across = np.linalg.svd(line_m[None])[2][1:]
    aside = Rotation.from_rotvec(error.lateral_rad @ across)
    return rigid(T_W_hand[:3, :3], eye_m + (1.0 + error.depth_ratio) * aside.apply(line_m))
