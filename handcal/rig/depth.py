"""Check of the depth camera: its depth of a board and its edges, compared with colour.

The corners in the colour image give the board's plane, and so the true depth of every pixel of the
depth image within them. Over views at several distances, a line through measured and true depth
gives scale and offset.

Only the squares of a board are known, not where its sheet ends. But its plane is, and so where in
the colour image each pixel on the border of its depth lies: the sheet's edge in colour beside it
shows how far the border of the depth is off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.geometry import image_points, invert, transform
from handcal.core.types import DepthCheck, DepthEdges, Float64, Frame, Intrinsics, UInt16
from handcal.hand.outline import find_color_edge, inward_normals
from handcal.hand.view import Box, solid_surface
from handcal.report.cells import signed
from handcal.rig.boards.board import BoardError, BoardView
from handcal.rig.boards.views import ViewsError
from handcal.rig.lens.fit import clustered_covariance
from handcal.rig.lens.lens import to_plane
from handcal.rig.lens.shape import BoardShape, boards_seen
from handcal.rig.lens.viewpoint import board_pose
from handcal.rig.plausible import MAX_RANGES

MIN_DEPTH_VIEWS = 5
_LEAST_SPREAD = 1.3
_SCALES = 0.5, 2.0
_RANGE_M = 0.2
_EDGE_PX = 4
_LEAST_PIXELS = 200
_MOST_PIXELS = 20_000
_LEAST_MEASURED = 0.5
_OUTLIER_SIGMAS = 5.0
_SURE_SIGMAS = 3.0
_LEAST_PART = 0.2


@dataclass(frozen=True, slots=True)
class DepthView:
    """Depth of a board in one frame."""

    true_m: float
    """Median depth of the board's pixels, from its pose in the colour image."""
    measured_m: float
    """The same, plus the median difference of the measured depth."""
    flatness_m: float
    """RMS distance of the measured points from the plane through them, without outliers."""


def board_in_depth(seen: BoardView, frame: Frame) -> Float64:
    """Return the board's pose (4, 4) in the depth camera, from a frame's colour image."""
    if frame.color_intrinsics is None:
        raise ValueError("the frame needs colour")
    return invert(frame.T_C_D) @ board_pose(seen, frame.color_intrinsics)


def depth_view(seen: BoardView, frame: Frame) -> DepthView:
    """Compare the measured depth of a board with its pose.

    Parameters
    ----------
    seen : BoardView
        The board in the frame's colour image.
    frame : Frame
        With colour.

    Raises
    ------
    BoardError
        If the depth image shows too little of the board.
    """
    T_D_B = board_in_depth(seen, frame)
    camera = frame.depth_intrinsics
    hull_px = cv2.convexHull(
        image_points(transform(T_D_B, seen.points_m), camera).astype(np.float32)
    )
    mask = np.zeros(frame.depth.shape, np.uint8)
    cv2.fillConvexPoly(mask, np.rint(hull_px).astype(np.int32), 1)
    # Matching windows at the border of the board see what is behind it.
    mask = np.asarray(cv2.erode(mask, np.ones((2 * _EDGE_PX + 1,) * 2, np.uint8)), np.uint8)
    places = np.argwhere(mask)
    places = places[:: max(1, len(places) // _MOST_PIXELS)]
    depth = frame.depth[places[:, 0], places[:, 1]]
    if len(places) < _LEAST_PIXELS or np.mean(depth > 0) < _LEAST_MEASURED:
        raise BoardError("the depth image shows too little of the board: hold it further inside")
    pixels = places[depth > 0][:, ::-1].astype(np.float64)
    rays = np.column_stack([to_plane(pixels, camera), np.ones(len(pixels))])
    measured_m = frame.depth_scale_m * depth[depth > 0].astype(np.float64)
    normal = T_D_B[:3, 2]
    true_m = normal @ T_D_B[:3, 3] / (rays @ normal)
    middle_m, bias_m = float(np.median(true_m)), float(np.median(measured_m - true_m))
    return DepthView(middle_m, middle_m + bias_m, _flatness_m(measured_m[:, None] * rays))


def on_real_board(
    views: Sequence[DepthView], boards: Sequence[BoardView], frame: Frame
) -> tuple[list[DepthView], BoardShape]:
    """Return the views with the true depth of the board as it is, bent or stretched, and how it is.

    Parameters
    ----------
    views : sequence of DepthView
    boards : sequence of BoardView
        The corners in colour of each.
    frame : Frame
        Any of theirs.
    """
    if frame.color_intrinsics is None:
        raise ValueError("the frame needs colour")
    named = {str(number): seen for number, seen in enumerate(boards)}
    real, board = boards_seen(named, frame.color_intrinsics)

    def middle_m(seen: BoardView) -> float:
        return float(transform(board_in_depth(seen, frame), seen.points_m)[:, 2].mean())

    return [
        replace(view, true_m=view.true_m + middle_m(now) - middle_m(before))
        for view, before, now in zip(views, boards, real.values(), strict=True)
    ], board


def fit_depth(views: Sequence[DepthView], made: str | None = None) -> DepthCheck:
    """Return scale, offset and flatness of measured depth.

    The covariance is a jackknife over views. It does not contain what is common to all of them,
    such as a wrong focal length of the colour camera or a wrong side of the board's squares: both
    appear in the scale.

    Parameters
    ----------
    views : sequence of DepthView
        At least `MIN_DEPTH_VIEWS`, at several distances.
    made : str, optional
        When, ISO 8601; now if not given.

    Raises
    ------
    ViewsError
        If the views do not determine scale and offset, or the depth is of another unit.
    """
    if len(views) < MIN_DEPTH_VIEWS:
        raise ViewsError(
            f"{len(views)} views of the board with depth are too few: {MIN_DEPTH_VIEWS} are needed"
        )
    true_m = np.array([view.true_m for view in views])
    measured_m = np.array([view.measured_m for view in views])
    ratio = float(np.median(measured_m / true_m))
    if not _SCALES[0] < ratio < _SCALES[1]:
        raise ViewsError(
            f"measured depth is {ratio:.3g} times that of the board: check the side of its squares "
            "and the depth unit"
        )
    if true_m.max() < _LEAST_SPREAD * true_m.min():
        raise ViewsError(
            f"the board was held only at {true_m.min():.2f} to {true_m.max():.2f} m: hold it "
            f"nearer and farther as well",
            f"the farthest must be {_LEAST_SPREAD} times the nearest",
        )
    J = np.column_stack([true_m, np.ones(len(views))])
    (scale, offset_m), *_ = np.linalg.lstsq(J, measured_m, rcond=None)
    residuals_m = measured_m - J @ [scale, offset_m]
    return DepthCheck(
        made=made or datetime.now(UTC).isoformat(timespec="seconds"),
        views=len(views),
        scale=float(scale),
        offset_m=float(offset_m),
        covariance=clustered_covariance(J, residuals_m, np.arange(len(views))),
        **_by_range(true_m, np.array([view.flatness_m for view in views])),
    )


def explain_depth(check: DepthCheck, square_m: float | None = None) -> str:
    """Return the likely cause of a bias, in one line; empty if neither scale nor offset is sure.

    One of them is not mentioned if its effect at half a metre is small beside the other's.

    Parameters
    ----------
    check : DepthCheck
    square_m : float, optional
        The side of a square as entered, to say what the depth images say of it.
    """
    effects_m = np.abs([0.5 * (check.scale - 1.0), check.offset_m])
    sigmas_m = np.sqrt(np.diag(check.covariance)) * [0.5, 1.0]
    is_scaled, is_offset = (effects_m > _SURE_SIGMAS * sigmas_m) & (
        effects_m > _LEAST_PART * effects_m.max()
    )
    percent = f"{signed(100.0 * (check.scale - 1.0), 2)} %"
    offset = f"{signed(1e3 * check.offset_m, 1)} mm"
    if is_scaled and not is_offset:
        square = ""
        if square_m is not None:
            square = (
                f"the depth images say that a square is {1e3 * check.scale * square_m:.1f} mm, "
                f"not {1e3 * square_m:.1f}; "
            )
        return (
            f"depth differs by {percent} at every distance: {square}measure the squares of the "
            "board, and check the depth unit and the intrinsics of the colour camera"
        )
    if is_offset and not is_scaled:
        return (
            f"depth differs by {offset} at every distance: check the pose of "
            "the depth imager in the colour imager, and calibrate the sensor (a RealSense by its "
            "on-chip calibration)"
        )
    if is_scaled:
        return (
            f"depth differs by {percent} and {offset}: calibrate the sensor "
            "(a RealSense by its on-chip calibration)"
        )
    return ""


def _flatness_m(points_m: Float64) -> float:
    """Return the RMS distance of points (N, 3) from the plane through them, without outliers."""
    for _ in range(2):
        middle_m = points_m.mean(axis=0)
        normal = np.linalg.eigh(np.cov(points_m, rowvar=False))[1][:, 0]
        off_m = (points_m - middle_m) @ normal
        limit_m = _OUTLIER_SIGMAS * 1.4826 * float(np.median(np.abs(off_m)))
        points_m = points_m[np.abs(off_m) <= limit_m]
    return float(np.sqrt(np.mean(off_m[np.abs(off_m) <= limit_m] ** 2)))


def _by_range(true_m: Float64, flatness_m: Float64) -> dict[str, Float64]:
    """Return the flatness by range of depth; σ from the scatter of the views.

    One view alone has its whole flatness as σ.
    """
    width_m = max(_RANGE_M, 1.001 * float(true_m.max()) / MAX_RANGES)
    number = np.floor(true_m / width_m).astype(int)
    rows = []
    for one in np.unique(number):
        inside = flatness_m[number == one]
        middle_m = float(np.sqrt(np.mean(inside**2)))
        sigma_m = np.std(inside, ddof=1) / np.sqrt(len(inside)) if len(inside) > 1 else middle_m
        rows.append([one * width_m, (one + 1) * width_m, middle_m, float(sigma_m)])
    table: Float64 = np.array(rows)
    return {"ranges_m": table[:, :2], "flatness_m": table[:, 2], "flatness_sigma_m": table[:, 3]}


MIN_BORDER_VIEWS = 5
# As in the segmentation of hands, whose borders this is about.
_EDGE_JUMP_M = 0.02
# What stands out from the sheet in depth: so far behind it, this many pixels outside.
_BEHIND_M, _OUTSIDE_PX = 0.05, 10.0
# The sheet is looked for up to this share of the board's side beyond its corners.
_MARGIN = 0.5
_LEAST_BORDER_PX = 100
_LEAST_SHARE = 0.3
_BORDER_OUTLIER_SIGMAS = 3.0
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
        kept = off_px <= max(1.0, _BORDER_OUTLIER_SIGMAS * 1.4826 * float(np.median(off_px[kept])))
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
    plane = to_plane(pixels.reshape(-1, 2), camera).reshape(pixels.shape)
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
