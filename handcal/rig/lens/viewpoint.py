"""Pose of the viewpoint camera in the headset, from tracked poses of a board that it sees."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import cv2
import numpy as np
from scipy.optimize import least_squares

from handcal.core.frozen import freeze
from handcal.core.geometry import camera_matrix, image_points, invert, rigid, transform
from handcal.core.types import Float64, Intrinsics
from handcal.rig.boards.board import BoardView, square_m
from handcal.rig.boards.views import BoardImage, ViewsError, require_size, used
from handcal.rig.lens.fit import CalibrationVerdict, clustered_covariance, rms
from handcal.rig.lens.shape import BoardShape, boards_seen
from handcal.rig.lens.stereo import StereoCalibration

MIN_TRACKED_VIEWS = 3
_GOOD_PX, _BAD_PX = 1.5, 5.0
_GOOD_SIGMA_M = 0.001
# A side of the squares is contradicted by more than these.
_SURE_SIGMAS, _LEAST_SCALE = 4.0, 0.01
# Of the residual: what remains with another side.
_EXPLAINED_SHARE = 0.8


@dataclass(frozen=True, slots=True, eq=False)
class TrackedView:
    """A board seen by the viewpoint camera and tracked by the headset at the same time."""

    view: BoardView
    """The view of the viewpoint camera."""
    T_H_B: Float64
    """(4, 4); from the board to the headset rig, as tracked."""

    def __post_init__(self) -> None:
        freeze(self, "T_H_B", np.float64, 4, 4)


@dataclass(frozen=True, slots=True, eq=False)
class ViewpointPose:
    """The pose of the viewpoint camera in the headset."""

    T_H_C: Float64
    """(4, 4); from the viewpoint camera to the headset rig."""
    covariance: Float64
    """(6, 6); of a small rotation about the camera's axes, rad, and of its position in H, m."""
    residuals_px: Mapping[str, float]
    """Root mean square reprojection error of each view."""
    rms_px: float
    verdict: CalibrationVerdict

    def __post_init__(self) -> None:
        freeze(self, "T_H_C", np.float64, 4, 4)
        freeze(self, "covariance", np.float64, 6, 6)
        object.__setattr__(self, "residuals_px", MappingProxyType(dict(self.residuals_px)))


def board_pose(view: BoardView, camera: Intrinsics) -> Float64:
    """Return ``T_camera_board`` (4, 4) from one view of the board.

    With the headset camera as H it is the `TrackedView.T_H_B` of the same instant.
    """
    return plane_pose(view.points_m, view.pixels, camera)


def plane_pose(points: Float64, pixels: Float64, camera: Intrinsics) -> Float64:
    """Return ``T_camera_plane`` (4, 4) by PnP from points (N, 3) with z near 0, in any unit."""
    K, distortion = camera_matrix(camera), np.array(camera.distortion)
    flat = points * [1.0, 1.0, 0.0]
    _, rotation, translation = cv2.solvePnP(flat, pixels, K, distortion, flags=cv2.SOLVEPNP_IPPE)
    rotation, translation = cv2.solvePnPRefineLM(
        points, pixels, K, distortion, rotation, translation
    )
    return rigid(rotation.ravel(), translation.ravel())


def locate_viewpoint(views: Mapping[str, TrackedView], camera: Intrinsics) -> ViewpointPose:
    """Find the viewpoint camera's pose by minimising the reprojection error over all views.

    The covariance treats the views, not their corners, as independent: a wrong tracked pose moves
    all corners of its view.

    Parameters
    ----------
    views : mapping of name to TrackedView
        At least `MIN_TRACKED_VIEWS`, the camera in the same place behind the display.
    camera : Intrinsics
        The viewpoint camera.

    Raises
    ------
    ViewsError
        If there are too few views, or one of another size than the camera's images.
    """
    require_size({name: one.view.size for name, one in views.items()}, camera)
    if len(views) < MIN_TRACKED_VIEWS:
        raise ViewsError(
            f"{len(views)} views with a tracked board are too few: take {MIN_TRACKED_VIEWS} or "
            "more, with the board at other distances and angles"
        )
    seen, board = boards_seen({name: one.view for name, one in views.items()}, camera)
    tracked = [(one.T_H_B, seen[name].points_m) for name, one in views.items()]
    points_H_m = np.concatenate([transform(*one) for one in tracked])
    pixels = np.concatenate([one.view.pixels for one in views.values()])
    of_view = np.repeat(np.arange(len(views)), [len(one.view.pixels) for one in views.values()])
    T_H_C0 = _first_guess(points_H_m, pixels, camera)

    # What a point moves by in H if the squares are larger than entered.
    larger_m = np.concatenate([points_m @ T[:3, :3].T for T, points_m in tracked])

    def off_px(x: Float64) -> Float64:
        points_m = points_H_m + x[6:].sum() * larger_m
        off: Float64 = (
            image_points(transform(invert(_moved(T_H_C0, x[:6])), points_m), camera) - pixels
        )
        return off.ravel()

    scaled = least_squares(off_px, np.zeros(7), method="lm")
    of_scale = clustered_covariance(np.asarray(scaled.jac), scaled.fun, np.repeat(of_view, 2))
    solved = least_squares(off_px, np.zeros(6), method="lm")
    off = solved.fun.reshape(-1, 2)
    covariance = clustered_covariance(np.asarray(solved.jac), solved.fun, np.repeat(of_view, 2))
    square = _square(
        1e3 * square_m(next(iter(views.values())).view.points_m),
        float(scaled.x[6]),
        float(np.sqrt(of_scale[6, 6])),
        explains=rms(scaled.fun.reshape(-1, 2)) < _EXPLAINED_SHARE * rms(off),
    )
    residuals_px = {name: rms(off[of_view == number]) for number, name in enumerate(views)}
    return ViewpointPose(
        T_H_C=_moved(T_H_C0, solved.x),
        covariance=covariance,
        residuals_px=residuals_px,
        rms_px=rms(off),
        verdict=_judge(
            residuals_px, rms(off), float(np.sqrt(np.trace(covariance[3:, 3:]))), square, board
        ),
    )


def viewpoint_from_tracked(
    views: Iterable[BoardImage], T_H_B: Mapping[str, Float64], camera: Intrinsics
) -> ViewpointPose:
    """Find the pose from the views of a board that are not left out, and its tracked poses by name.

    Raises
    ------
    ViewsError
        If too few views show the board, or one that shows it has no tracked pose.
    """
    found = used(views, 1)
    missing = sorted(set(found) - set(T_H_B))
    if missing:
        raise ViewsError(f"there is no tracked pose for {', '.join(missing)}: add it, or drop it")
    return locate_viewpoint(
        {name: TrackedView(seen, T_H_B[name]) for name, seen in found.items()}, camera
    )


def viewpoint_from_stereo(stereo: StereoCalibration) -> ViewpointPose:
    """Take the pose from a stereo calibration with the viewpoint camera as its depth camera.

    Raises
    ------
    ViewsError
        If the pairs do not determine it.
    """
    if stereo.covariance is None:
        raise ViewsError(
            "these pairs do not determine the pose of the viewpoint camera: add others"
        )
    return ViewpointPose(
        stereo.T_H_D, stereo.covariance, stereo.residuals_px, stereo.rms_px, stereo.verdict
    )


def _first_guess(points_H_m: Float64, pixels: Float64, camera: Intrinsics) -> Float64:
    _, rotation, translation = cv2.solvePnP(
        points_H_m,
        pixels,
        camera_matrix(camera),
        np.array(camera.distortion),
        flags=cv2.SOLVEPNP_SQPNP,
    )
    return invert(rigid(rotation.ravel(), translation.ravel()))


def _moved(T_H_C: Float64, x: Float64) -> Float64:
    """Rotate a camera about its own axes by x[:3] rad and move it in H by x[3:] m."""
    T = T_H_C @ rigid(x[:3])
    T[:3, 3] += x[3:]
    return T


def _square(entered_mm: float, scale: float, sigma: float, *, explains: bool) -> tuple[str, str]:
    """Return what the tracked poses say against the side of a square, and what stays open."""
    if explains and abs(scale) > max(_SURE_SIGMAS * sigma, _LEAST_SCALE):
        return (
            f"the tracked poses say that a square is {(1 + scale) * entered_mm:.1f} mm, not "
            f"{entered_mm:.1f}: measure it, and enter what it is",
            "",
        )
    if _SURE_SIGMAS * sigma > _LEAST_SCALE:
        return "", f" if a square is exactly {entered_mm:.2f} mm"
    return "", ""


def _judge(
    residuals_px: Mapping[str, float],
    rms_px: float,
    sigma_m: float,
    square: tuple[str, str],
    board: BoardShape,
) -> CalibrationVerdict:
    worst = max(residuals_px, key=lambda name: residuals_px[name])
    residual = f"residual {rms_px:.2f} px ({worst} {residuals_px[worst]:.2f} px)"
    wrong, condition = square
    if wrong:
        return CalibrationVerdict("bad", wrong)
    if rms_px > _BAD_PX:
        return CalibrationVerdict(
            "bad",
            f"boards are not seen where they were tracked, {residual}: the camera moved, or poses "
            "and images do not belong together",
        )
    place = f"the camera's place is known to {1e3 * sigma_m:.2f} mm{condition}, {residual}"
    if sigma_m > _GOOD_SIGMA_M or rms_px > _GOOD_PX:
        words = f"{place}: add views, or drop the worst{board.also}"
        return CalibrationVerdict("needs more views", words)
    return CalibrationVerdict("good", place + board.also)
