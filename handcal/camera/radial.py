"""Depth of a time-of-flight camera: from distances behind any lens to z in a pinhole view."""

from __future__ import annotations

import cv2
import numpy as np

from handcal.core.errors import CameraError
from handcal.core.types import Bool, Float32, Intrinsics, UInt16

DEPTH_SCALE_M = 0.0001
"""Metres per unit of the resampled depth."""

_FOCAL_PX = 50.0, 2000.0
_STRIDE = 8
_STEPS = 40
_DAMPING = 0.6  # of Newton's steps; at the sides, a lens's focal length is half of the middle's
_SAME_RAY = 1e-3
_LEAST_COVERED = 0.5
_JUMP_M = 0.02
_NEAR_M = 0.7
_SKIN = 0.5
_BRIGHT_PIXELS = 1000


class PinholeView:
    """A pinhole camera with the same centre, axes, size and middle focal length as another lens.

    Parameters
    ----------
    rays : (H, W, 2) float32
        x and y of each pixel's ray in the plane z = 1; values that are no rays are outside.

    Raises
    ------
    CameraError
        If they are not the rays of a camera that looks forward.

    Attributes
    ----------
    intrinsics : Intrinsics
    """

    def __init__(self, rays: Float32) -> None:
        height, width = rays.shape[:2]
        rays = np.nan_to_num(rays, nan=1e6, posinf=1e6, neginf=1e6).clip(-1e6, 1e6)
        self.intrinsics = _pinhole(rays)
        camera = self.intrinsics
        x = ((np.arange(width + _STRIDE) - camera.cx) / camera.fx).astype(np.float32)
        y = ((np.arange(height + _STRIDE) - camera.cy) / camera.fy).astype(np.float32)
        coarse = _search(rays, x[::_STRIDE], y[::_STRIDE], camera)
        stretch = np.float32(1.0 / _STRIDE)
        column, row = np.meshgrid(np.arange(width), np.arange(height))
        place = _look(coarse, np.dstack([column, row]).astype(np.float32) * stretch)
        wanted = np.dstack(np.meshgrid(x[:width], y[:height]))
        place = _nearer(rays, place, wanted, camera)
        missed = wanted - _look(rays, place)
        self._is_inside = (np.abs(missed) < _SAME_RAY).all(axis=2)
        if self._is_inside.mean() < _LEAST_COVERED:
            raise CameraError(
                "the camera's rays do not fill an image",
                "its calibration is damaged",
            )
        self._place = place
        self._corner = np.floor(place)
        self._z_per_m = 1.0 / np.sqrt(1.0 + np.square(wanted).sum(axis=2))

    def depth(self, distance_m: Float32) -> UInt16:
        """Return z (H, W), in units of `DEPTH_SCALE_M`, of distances (H, W) from the centre.

        0 is no measurement, in both. A ray between four pixels of one surface has the distance
        interpolated from them, any other that of the nearest pixel.
        """
        window = np.ones((2, 2), np.uint8)
        between = _look(distance_m, self._place)
        nearest = _look(distance_m, np.rint(self._place), cv2.INTER_NEAREST)
        # The extremes of the four pixels around each place, by those right and below of each pixel.
        least, most = (
            _look(
                np.asarray(extreme(distance_m, window, anchor=(0, 0)), np.float32),
                self._corner,
                cv2.INTER_NEAREST,
            )
            for extreme in (cv2.erode, cv2.dilate)
        )
        is_one_surface = (least > 0.0) & (most - least < _JUMP_M)
        z = np.where(is_one_surface, between, nearest) * (self._z_per_m / DEPTH_SCALE_M)
        is_measured = self._is_inside & (z < 65535.0)
        return np.where(is_measured, np.rint(z), 0.0).astype(np.uint16)

    def image(self, values: Float32) -> Float32:
        """Return an image (H, W) of the lens as this view sees it; 0 outside."""
        seen = _look(values, self._place)
        return np.asarray(np.where(self._is_inside, seen, np.float32(0.0)), np.float32)


def _look(image: Float32, place: Float32, how: int = cv2.INTER_LINEAR) -> Float32:
    """Return an image's values at places (h, w, 2), in pixels; its border continues outside."""
    maps = np.ascontiguousarray(place[..., 0]), np.ascontiguousarray(place[..., 1])
    return np.asarray(cv2.remap(image, *maps, how, borderMode=cv2.BORDER_REPLICATE), np.float32)


def _search(rays: Float32, x: Float32, y: Float32, camera: Intrinsics) -> Float32:
    """Return the places (h, w, 2), in pixels, at which the rays are those of a grid of x and y."""
    wanted = np.dstack(np.meshgrid(x, y))
    place = (wanted * [camera.fx, camera.fy] + [camera.cx, camera.cy]).astype(np.float32)
    for _ in range(_STEPS):
        place = _nearer(rays, place, wanted, camera)
    return place


def _nearer(rays: Float32, place: Float32, wanted: Float32, camera: Intrinsics) -> Float32:
    """Return places (h, w, 2) one step nearer to where the rays are the wanted ones."""
    step = np.float32(_DAMPING) * np.array([camera.fx, camera.fy], np.float32)
    limit = np.array([camera.width - 1, camera.height - 1], np.float32)
    missed = wanted - _look(rays, place)
    return np.clip(place + step * missed, np.float32(0.0), limit)


def _pinhole(rays: Float32) -> Intrinsics:
    """Return the pinhole camera that agrees with the rays around the axis."""
    height, width = rays.shape[:2]
    row, column = np.unravel_index(np.square(rays).sum(axis=2).argmin(), (height, width))
    slopes = np.zeros(2)
    if 8 <= row < height - 8 and 8 <= column < width - 8:
        # Over some pixels, for the rounding.
        slopes[0] = (rays[row, column + 8, 0] - rays[row, column - 8, 0]) / 16.0
        slopes[1] = (rays[row + 8, column, 1] - rays[row - 8, column, 1]) / 16.0
    low, high = _FOCAL_PX
    if not ((slopes > 1.0 / high) & (slopes < 1.0 / low)).all():
        raise CameraError(
            "the camera's rays are not those of a lens",
            "its calibration is damaged",
        )
    fx, fy = 1.0 / slopes
    x, y = rays[row, column]
    return Intrinsics(
        width, height, float(fx), float(fy), float(column - x * fx), float(row - y * fy)
    )


def white_brightness(distance_m: Float32, brightness: Float32) -> float:
    """Return the brightness of a white surface 1 m away, if the nearest bright surface is skin.

    Brightness falls with the square of the distance. Skin reflects about half of infrared light.
    0 if hardly anything is near.
    """
    is_near = (distance_m > 0.0) & (distance_m < _NEAR_M)
    if np.count_nonzero(is_near) < _BRIGHT_PIXELS:
        return 0.0
    at_1_m = brightness[is_near] * np.square(distance_m[is_near])
    # Not a share of them: most may be of a far wall. A few may be of a mirror.
    return float(np.partition(at_1_m, -_BRIGHT_PIXELS)[-_BRIGHT_PIXELS]) / _SKIN


def is_not_wrapped(distance_m: Float32, brightness: Float32, alias_m: float, white: float) -> Bool:
    """Return which distances (H, W) were measured in the first turn of the phase.

    A surface one alias farther away shows the same distance. It is taken for that one unless it
    would have to be brighter there than white.

    Parameters
    ----------
    distance_m, brightness : (H, W) float32
    alias_m : float
    white : float
        From `white_brightness`.
    """
    return np.asarray(brightness * np.square(distance_m + np.float32(alias_m)) > white)
