"""Lens models: OpenCV's pinhole with 0 to 14 coefficients, and the fisheye of Kannala and Brandt.

Parameters are in the order fx, fy, cx, cy, coefficients. The fisheye is OpenCV's, after "A generic
camera model and calibration method for conventional, wide-angle, and fish-eye lenses", 2006: the
distance from the image's middle is a polynomial in the angle from the axis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import cv2
import numpy as np

from handcal.core.errors import HandcalError
from handcal.core.geometry import camera_matrix, rigid
from handcal.core.types import Float64, Intrinsics
from handcal.rig.boards.board import BoardView

LensModel: TypeAlias = Literal["none", "radial", "full", "rational", "prism", "tilted", "fisheye"]
# The number of coefficients in a result, and which of them are solved for.
_COEFFICIENTS: dict[LensModel, tuple[int, tuple[int, ...]]] = {
    "none": (0, ()),
    "radial": (5, (0, 1)),
    "full": (5, tuple(range(5))),
    "rational": (8, tuple(range(8))),
    "prism": (12, tuple(range(12))),
    "tilted": (14, tuple(range(14))),
    "fisheye": (4, tuple(range(4))),
}
# Corners farther from the axis are not used for a first pose: z = 1 magnifies their errors.
_MAX_TANGENT = 4.0


@dataclass(frozen=True, slots=True)
class FisheyeIntrinsics:
    """A fisheye camera in pixels, with OpenCV's four coefficients of `cv2.fisheye`.

    A type of its own, because to project with it as with a pinhole would be silently wrong.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = (0.0,) * 4


Camera: TypeAlias = Intrinsics | FisheyeIntrinsics


def undistorted_camera(lens: LensModel, size: tuple[int, int], focal_px: float) -> Camera:
    """Return a camera of a lens model with all coefficients 0, its axis in the image's middle."""
    width, height = size
    kind = FisheyeIntrinsics if lens == "fisheye" else Intrinsics
    middle = (width - 1) / 2, (height - 1) / 2
    return kind(width, height, focal_px, focal_px, *middle, (0.0,) * _COEFFICIENTS[lens][0])


def as_lens(camera: Camera, lens: LensModel) -> Camera:
    """Return a camera with the coefficients of a richer or poorer model of the same kind."""
    count, solved = _COEFFICIENTS[lens]
    padded = [*camera.distortion, *[0.0] * count]
    coefficients = tuple(padded[n] if n in solved else 0.0 for n in range(count))
    return replace(camera, distortion=coefficients)


def solved_parameters(lens: LensModel) -> list[int]:
    """Return which parameters a lens model solves for."""
    return [*range(4), *(4 + number for number in _COEFFICIENTS[lens][1])]


def parameters(camera: Camera) -> Float64:
    """Return fx, fy, cx, cy and the coefficients."""
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion])


def with_parameters(camera: Camera, values: Float64) -> Camera:
    """Return the camera with other parameters."""
    fx, fy, cx, cy, *coefficients = (float(one) for one in values)
    return replace(camera, fx=fx, fy=fy, cx=cx, cy=cy, distortion=tuple(coefficients))


def predict(points_m: Float64, pose: Float64, camera: Camera) -> tuple[Float64, Float64]:
    """Return pixels (N, 2) of points in a board's frame, and their derivatives.

    Parameters
    ----------
    points_m : (N, 3) float64
    pose : (6,) float64
        Rotation vector and translation of the board in the camera's frame.
    camera : Camera

    Returns
    -------
    pixels : (N, 2) float64
    derivatives : (2 N, 6 + parameters) float64
        By the pose and by the camera's parameters.
    """
    K = camera_matrix_of(camera)
    if isinstance(camera, FisheyeIntrinsics):
        pixels, by = cv2.fisheye.projectPoints(
            points_m[:, None], pose[:3], pose[3:], K, np.array(camera.distortion)
        )
        # Columns of cv2.fisheye: f, c, coefficients, pose, skew.
        by = np.hstack([by[:, 8:14], by[:, :8]])
        return np.asarray(pixels, np.float64).reshape(-1, 2), np.asarray(by, np.float64)
    # Without coefficients OpenCV gives derivatives by five of them.
    pixels, by = cv2.projectPoints(
        points_m, pose[:3], pose[3:], K, np.array(camera.distortion or (0.0,) * 5)
    )
    by = np.asarray(by, np.float64)[:, : 10 + len(camera.distortion)]
    return np.asarray(pixels, np.float64).reshape(-1, 2), by


def pixels_of(points_m: Float64, pose: Float64, camera: Camera) -> Float64:
    """Return the pixels that `predict` returns, without derivatives, in a fraction of the time."""
    project = cv2.fisheye if isinstance(camera, FisheyeIntrinsics) else cv2
    coefficients = np.array(camera.distortion or (0.0,) * 5)
    pixels, _ = project.projectPoints(
        points_m[:, None], pose[:3], pose[3:], camera_matrix_of(camera), coefficients
    )
    return np.asarray(pixels, np.float64).reshape(-1, 2)


def derivatives_at(points_m: Float64, camera: Camera) -> tuple[Float64, Float64, Float64]:
    """Return pixels of points in the camera's frame, and their derivatives.

    Returns
    -------
    pixels : (N, 2) float64
    by_point : (2 N, 3) float64
    by_parameters : (2 N, parameters) float64
        In the order of `parameters`.
    """
    pixels, by = predict(points_m, np.zeros(6), camera)
    return pixels, by[:, 3:6], by[:, 6:]


def camera_matrix_of(camera: Camera) -> Float64:
    """Return the (3, 3) camera matrix K."""
    return np.array([[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]])


def to_plane(pixels: Float64, camera: Camera) -> Float64:
    """Return the points (N, 2) at z = 1 that pixels (N, 2) show."""
    K, coefficients = camera_matrix_of(camera), np.array(camera.distortion)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-10)
    undistort = cv2.fisheye if isinstance(camera, FisheyeIntrinsics) else cv2
    plane = undistort.undistortPoints(pixels[:, None], K, coefficients, criteria=criteria)
    return np.asarray(plane, np.float64).reshape(-1, 2)


def undistort(pixels: Float64, camera: Intrinsics) -> Float64:
    """Return pixels (N, 2) of a camera with the lens distortion removed."""
    K = camera_matrix(camera)
    straight = cv2.undistortPoints(
        pixels[:, None],
        K,
        np.array(camera.distortion),
        P=K,
        criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-9),
    )
    return np.asarray(straight, dtype=np.float64).reshape(-1, 2)


def first_pose(seen: BoardView, camera: Camera) -> Float64 | None:
    """Return ``T_camera_board`` (4, 4) by PnP, not refined; None without a solution."""
    plane = to_plane(seen.pixels, camera)
    usable = np.linalg.norm(plane, axis=1) < _MAX_TANGENT
    if usable.sum() < 4:
        return None
    try:
        found, rotations, translations, _ = cv2.solvePnPGeneric(
            seen.points_m[usable] * [1.0, 1.0, 0.0],
            plane[usable],
            np.eye(3),
            None,
            flags=cv2.SOLVEPNP_IPPE,
        )
    except cv2.error:
        return None
    if not found or not np.isfinite(rotations[0]).all():
        return None
    return rigid(cv2.Rodrigues(rotations[0])[0], translations[0].ravel())


def as_pinhole(camera: Camera, which: str) -> Intrinsics:
    """Return a pinhole camera; HandcalError for a fisheye, naming `which` camera it is."""
    if isinstance(camera, FisheyeIntrinsics):
        raise HandcalError(
            f"{which} has a fisheye lens, which is not possible here: use the lens model rational, "
            "or undistort its images first"
        )
    return camera
