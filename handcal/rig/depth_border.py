"""Check of the depth camera's edges: the border of a board's sheet in depth and in colour.

Only the squares of a board are known, not where its sheet ends. But its plane is, and so where in
the colour image each pixel on the border of its depth lies: the sheet's edge in colour beside it
shows how far the border of the depth is off.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.geometry import image_points, transform
from handcal.core.types import DepthEdges, Float64, Frame, Intrinsics, UInt16
from handcal.hand.outline import find_color_edge, inward_normals
from handcal.hand.view import Box, solid_surface
from handcal.rig.boards.board import BoardError, BoardView
from handcal.rig.depth import board_in_depth
from handcal.rig.displays.display import undistort

MIN_BORDER_VIEWS = 5
# As in the segmentation of hands, whose borders this is about.
_EDGE_JUMP_M = 0.02
# What stands out from the sheet in depth: so far behind it, this many pixels outside.
_BEHIND_M, _OUTSIDE_PX = 0.05, 10.0
# The sheet is looked for up to this share of the board's side beyond its corners.
_MARGIN = 0.5
_LEAST_BORDER_PX = 100
_LEAST_SHARE = 0.3
_OUTLIER_SIGMAS = 3.0
# Opposite sides are needed: variance of the result over that of a border seen all around.
_MOST_VARIANCE = 6.0
_NOT_SEEN = (
    "the border of its sheet is not seen in both depth and colour: hold the board clear of other "
    "things, before a background of another shade"
)
# The lens's blur, colours that run, and borders of another curvature than a hand's.
_COMMON_SIGMA_PX = 0.3


def border_outside_px(seen: BoardView, frame: Frame) -> float:
    """Return how far the border of the sheet in depth lies outside that in colour.

    Parameters
    ----------
    seen : BoardView
        The board in the frame's colour image.
    frame : Frame
        With colour.

    Returns
    -------
    float
        Mean around the sheet, in pixels of the depth image; see `DepthEdges`.

    Raises
    ------
    BoardError
        If too little of the border is seen.
    """
    camera = frame.depth_intrinsics
    T_D_B = board_in_depth(seen, frame)
    corners_px = image_points(transform(T_D_B, seen.points_m), camera)
    x0, y0, x1, y1 = _around(corners_px, camera)
    depth_m = frame.depth_scale_m * frame.depth[y0:y1, x0:x1].astype(np.float64)
    rays = _rays((x0, y0, x1, y1), camera)
    normal = T_D_B[:3, 2]
    plane_m = normal @ T_D_B[:3, 3] / (rays @ normal)
    border = _border(frame.depth[y0:y1, x0:x1], depth_m - plane_m, frame, corners_px - [x0, y0])
    column, row = border.T
    points_m = rays[row, column] * plane_m[row, column, None]
    focal_px = np.array([camera.fx, camera.fy])
    inward = inward_normals(points_m[:, :2] / points_m[:, 2:] * focal_px)
    step_m = np.column_stack([inward / focal_px * points_m[:, 2:], np.zeros(len(inward))])
    px_m = float(np.median(points_m[:, 2])) / camera.fx
    edge = find_color_edge(frame, points_m, step_m, px_m, 0.0)
    outside = np.rint(border - _OUTSIDE_PX * inward).astype(int)
    height, width = depth_m.shape
    is_inside = ((outside >= 0) & (outside < [width, height])).all(axis=1)
    column, row = np.clip(outside, 0, [width - 1, height - 1]).T
    behind_m = depth_m[row, column] - plane_m[row, column]
    stands_out = is_inside & ((behind_m > _BEHIND_M) | (depth_m[row, column] == 0.0))
    counts = edge.is_told & stands_out
    if counts.mean() < _LEAST_SHARE:
        raise BoardError(_NOT_SEEN)
    return _outside_px(edge.inward_px[counts], inward[counts])


def _outside_px(inward_px: Float64, inward: Float64) -> float:
    """Return the common part of distances (N,) along normals (N, 2).

    The rest is a shift between both images, which looks different on opposite sides.
    """
    J = np.column_stack([np.ones(len(inward)), inward])
    kept = np.ones(len(inward), np.bool_)
    for _ in range(3):
        if len(inward) * np.linalg.pinv(J[kept].T @ J[kept])[0, 0] > _MOST_VARIANCE:
            raise BoardError(_NOT_SEEN)
        fitted, *_ = np.linalg.lstsq(J[kept], inward_px[kept], rcond=None)
        off_px = np.abs(inward_px - J @ fitted)
        kept = off_px <= max(1.0, _OUTLIER_SIGMAS * 1.4826 * float(np.median(off_px[kept])))
    return float(fitted[0])


def _around(corners_px: Float64, camera: Intrinsics) -> Box:
    """Return the part of the image in which the sheet of a board with these corners lies."""
    low, high = corners_px.min(axis=0), corners_px.max(axis=0)
    margin_px = _MARGIN * (high - low).max()
    x0, y0 = np.maximum(0, np.floor(low - margin_px)).astype(int)
    x1, y1 = np.minimum([camera.width, camera.height], np.ceil(high + margin_px)).astype(int)
    return int(x0), int(y0), int(x1), int(y1)


def _rays(box: Box, camera: Intrinsics) -> Float64:
    """Return the rays (h, w, 3) of a box of pixels, with z = 1."""
    x0, y0, x1, y1 = box
    pixels = np.stack(np.meshgrid(np.arange(x0, x1), np.arange(y0, y1)), axis=-1).astype(float)
    if any(camera.distortion):
        pixels = undistort(pixels.reshape(-1, 2), camera).reshape(pixels.shape)
    plane = (pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    return np.concatenate([plane, np.ones((*plane.shape[:2], 1))], axis=-1)


def _border(
    depth: UInt16, behind_m: Float64, frame: Frame, corners_px: Float64
) -> NDArray[np.int32]:
    """Return the border (N, 2) of the sheet's pixels, as that of a hand's mask; BoardError if none.

    Where it is cut by the edge of the part of the image, it is not left out.
    """
    solid = solid_surface(np.ascontiguousarray(depth), round(_EDGE_JUMP_M / frame.depth_scale_m))
    sheet = (solid & (np.abs(behind_m) < _EDGE_JUMP_M)).astype(np.uint8)
    middle = tuple(map(float, corners_px.mean(axis=0)))
    contours, _ = cv2.findContours(sheet, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    around = [one for one in contours if cv2.pointPolygonTest(one, middle, measureDist=False) >= 0]
    if not around or len(around[0]) < _LEAST_BORDER_PX:
        raise BoardError("the depth image shows too little of the board: hold it further inside")
    return np.asarray(around[0].reshape(-1, 2))


def fit_edges(borders_px: Sequence[float], made: str | None = None) -> DepthEdges | None:
    """Return the edges of a depth camera, from `border_outside_px` of several views.

    None for fewer views than `MIN_BORDER_VIEWS`.
    """
    if len(borders_px) < MIN_BORDER_VIEWS:
        return None
    scatter_px = float(np.std(borders_px, ddof=1)) / np.sqrt(len(borders_px))
    return DepthEdges(
        fatten_px=float(np.mean(borders_px)),
        sigma_px=float(np.hypot(scatter_px, _COMMON_SIGMA_PX)),
        source="measured",
        views=len(borders_px),
        made=made or datetime.now(UTC).isoformat(timespec="seconds"),
    )
