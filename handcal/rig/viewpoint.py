"""Where the viewpoint camera sits in the headset: from tracked poses of a board that it sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from handcal.geometry import camera_matrix, image_points, invert, rigid, transform
from handcal.rig.board import BoardView
from handcal.rig.verdict import CalibrationVerdict
from handcal.types import Float64, Intrinsics, freeze

MIN_VIEWS = 3
_GOOD_PX, _BAD_PX = 1.5, 5.0
_GOOD_SIGMA_M = 0.001


@dataclass(frozen=True, slots=True, eq=False)
class TrackedView:
    """A board seen by the viewpoint camera while the headset knows where the board is.

    Attributes
    ----------
    view : BoardView
        As the viewpoint camera sees it.
    T_H_B : (4, 4) float64
        From the board to the headset rig, as tracked.
    """

    view: BoardView
    T_H_B: Float64

    def __post_init__(self) -> None:
        freeze(self, "T_H_B", np.float64, 4, 4)


@dataclass(frozen=True, slots=True, eq=False)
class ViewpointPose:
    """Where the viewpoint camera sits.

    Attributes
    ----------
    T_H_C : (4, 4) float64
        From the viewpoint camera to the headset rig.
    covariance : (6, 6) float64
        Of a small rotation about the camera's axes, rad, and of its position in H, m.
    residuals_px : tuple of float
        Root mean square reprojection error of each view.
    rms_px : float
    verdict : CalibrationVerdict
    """

    T_H_C: Float64
    covariance: Float64
    residuals_px: tuple[float, ...]
    rms_px: float
    verdict: CalibrationVerdict

    def __post_init__(self) -> None:
        freeze(self, "T_H_C", np.float64, 4, 4)
        freeze(self, "covariance", np.float64, 6, 6)


def board_pose(view: BoardView, camera: Intrinsics) -> Float64:
    """Return ``T_camera_board`` (4, 4) from one view of the board.

    With the headset camera as H it is the `TrackedView.T_H_B` of the same instant.
    """
    return plane_pose(view.points_m, view.pixels, camera)


def plane_pose(points: Float64, pixels: Float64, camera: Intrinsics) -> Float64:
    """Return ``T_camera_plane`` (4, 4) by PnP from points (N, 3) with z = 0, in any unit."""
    K, distortion = camera_matrix(camera), np.array(camera.distortion)
    _, rotation, translation = cv2.solvePnP(points, pixels, K, distortion, flags=cv2.SOLVEPNP_IPPE)
    rotation, translation = cv2.solvePnPRefineLM(
        points, pixels, K, distortion, rotation, translation
    )
    return rigid(rotation.ravel(), translation.ravel())


def locate_viewpoint(views: Sequence[TrackedView], camera: Intrinsics) -> ViewpointPose:
    """Find the viewpoint camera's place by the least reprojection error over all views.

    The covariance takes the views, not their corners, for independent: a wrong tracked pose moves
    all corners of its view (Liang & Zeger 1986).

    Parameters
    ----------
    views : sequence of TrackedView
        At least `MIN_VIEWS`, the camera in the same place behind the display.
    camera : Intrinsics
        The viewpoint camera.

    Raises
    ------
    ValueError
        If there are too few views.
    """
    if len(views) < MIN_VIEWS:
        raise ValueError(
            f"{len(views)} views with a tracked board are too few: take {MIN_VIEWS} or more, with "
            "the board at other distances and angles"
        )
    points_H_m = np.concatenate([transform(one.T_H_B, one.view.points_m) for one in views])
    pixels = np.concatenate([one.view.pixels for one in views])
    T_H_C0 = _first_guess(points_H_m, pixels, camera)

    def off_px(x: Float64) -> Float64:
        points_C_m = transform(invert(_moved(T_H_C0, x)), points_H_m)
        off: Float64 = image_points(points_C_m, camera) - pixels
        return off.ravel()

    solved = least_squares(off_px, np.zeros(6), x_scale=np.repeat([1e-3, 1e-3], 3), method="lm")
    of_view = np.repeat(np.arange(len(views)), [2 * len(one.view.pixels) for one in views])
    residuals_px = tuple(
        float(np.sqrt(2.0 * np.mean(solved.fun[of_view == number] ** 2)))
        for number in range(len(views))
    )
    covariance = _clustered_covariance(np.asarray(solved.jac), solved.fun, of_view)
    rms_px = float(np.sqrt(2.0 * np.mean(solved.fun**2)))
    return ViewpointPose(
        T_H_C=_moved(T_H_C0, solved.x),
        covariance=covariance,
        residuals_px=residuals_px,
        rms_px=rms_px,
        verdict=_judge(residuals_px, rms_px, float(np.sqrt(np.trace(covariance[3:, 3:])))),
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
    """Turn a camera about its own axes by x[:3] rad and move it in H by x[3:] m."""
    T = T_H_C @ rigid(x[:3])
    T[:3, 3] += x[3:]
    return T


def _clustered_covariance(J: Float64, residuals: Float64, cluster: NDArray[np.integer]) -> Float64:
    bread = np.linalg.pinv(J.T @ J)
    count = int(cluster[-1]) + 1
    scores = [J[cluster == number].T @ residuals[cluster == number] for number in range(count)]
    filling = np.einsum("ni,nj->ij", scores, scores) * count / (count - 1)
    covariance: Float64 = bread @ filling @ bread
    return 0.5 * (covariance + covariance.T)


def _judge(residuals_px: Sequence[float], rms_px: float, sigma_m: float) -> CalibrationVerdict:
    worst = int(np.argmax(residuals_px))
    if rms_px > _BAD_PX:
        return CalibrationVerdict(
            "bad",
            f"boards are seen {rms_px:.1f} px from where they were tracked (view {worst + 1} "
            f"{residuals_px[worst]:.1f} px): the camera moved, or poses and images do not belong "
            "together",
        )
    if sigma_m > _GOOD_SIGMA_M or rms_px > _GOOD_PX:
        return CalibrationVerdict(
            "needs more views",
            f"its place is known to {1e3 * sigma_m:.1f} mm, its residual is {rms_px:.2f} px (view "
            f"{worst + 1} {residuals_px[worst]:.2f} px): add views, or drop the worst",
        )
    return CalibrationVerdict(
        "good", f"its place is known to {1e3 * sigma_m:.2f} mm; residual {rms_px:.2f} px"
    )
