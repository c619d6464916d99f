"""Check of the depth camera: its depth of a board compared with the board's pose in colour.

The corners in the colour image give the board's plane, and so the true depth of every pixel of the
depth image within them. Over views at several distances, a line through measured and true depth
gives scale and offset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import cv2
import numpy as np

from handcal.core.geometry import image_points, invert, transform
from handcal.core.types import DepthCheck, Float64, Frame
from handcal.report.cells import signed
from handcal.rig.boards.board import BoardError, BoardView
from handcal.rig.boards.views import ViewsError
from handcal.rig.check import MAX_RANGES
from handcal.rig.displays.display import undistort
from handcal.rig.lens.fit import clustered_covariance
from handcal.rig.lens.shape import BoardShape, boards_seen
from handcal.rig.lens.viewpoint import board_pose

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
    plane = (undistort(pixels, camera) - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    rays = np.column_stack([plane, np.ones(len(plane))])
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
