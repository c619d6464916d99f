"""Depth of a time-of-flight camera: from distances behind any lens to z in a pinhole view."""

from __future__ import annotations

import cv2
import numpy as np

from handcal.core.errors import CameraError
from handcal.core.types import Bool, Float32, Intrinsics, UInt16

DEPTH_SCALE_M = 0.0001
"""Metres per unit of the resampled depth."""

# Plausible focal lengths: wider than a fisheye, or narrower than a telescope, is no depth camera.
_FOCAL_PX = 50.0, 2000.0
_BESIDE_PX = 8  # the focal length is measured over so many pixels, for the rounding of the rays
# A missed ray times the middle's focal length is Newton's step in the middle. At the sides, where
# a wide lens has half of that focal length, it is twice too long, so it is damped. Of its error a
# step leaves 0.4 in the middle and 0.2 at the sides, so these are more than enough.
_DAMPING, _STEPS = 0.6, 30
_SAME_RAY = 1e-3  # a quarter of a pixel; what misses it by more lies outside the lens's view
_LEAST_COVERED = 0.5
_JUMP_M = 0.02  # between two surfaces, as `SegmentSettings.edge_jump_m`
# Nearest bright surface: a hand in reach, of which at least so many pixels are seen.
_NEAR_M, _BRIGHT_PIXELS = 0.7, 1000
_SKIN = 0.5  # share of infrared light that it reflects


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
        # Large numbers in place of none, which would spread through the interpolation.
        rays = np.nan_to_num(rays, nan=1e6, posinf=1e6, neginf=1e6).clip(-1e6, 1e6)
        self.intrinsics = camera = _pinhole(rays)
        focal_px = np.array([camera.fx, camera.fy], np.float32)
        last_px = np.array([width - 1, height - 1], np.float32)
        place = np.dstack(np.meshgrid(np.arange(width), np.arange(height))).astype(np.float32)
        wanted = (place - np.array([camera.cx, camera.cy], np.float32)) / focal_px
        for _ in range(_STEPS):
            missed = wanted - _look(rays, place)
            place = np.clip(place + np.float32(_DAMPING) * focal_px * missed, 0.0, last_px)
        missed = wanted - _look(rays, place)
        self._is_inside = (np.abs(missed) < _SAME_RAY).all(axis=2)
        if self._is_inside.mean() < _LEAST_COVERED:
            raise CameraError("the camera's rays do not fill an image: its calibration is damaged")
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


def _pinhole(rays: Float32) -> Intrinsics:
    """Return the pinhole camera that agrees with the rays around the axis."""
    height, width = rays.shape[:2]
    row, column = np.unravel_index(np.square(rays).sum(axis=2).argmin(), (height, width))
    slopes = np.zeros(2)
    beside = _BESIDE_PX
    if beside <= row < height - beside and beside <= column < width - beside:
        right, left = rays[row, column + beside, 0], rays[row, column - beside, 0]
        below, above = rays[row + beside, column, 1], rays[row - beside, column, 1]
        slopes = np.array([right - left, below - above]) / (2.0 * beside)
    low, high = _FOCAL_PX
    if not ((slopes > 1.0 / high) & (slopes < 1.0 / low)).all():
        raise CameraError("the camera's rays are not those of a lens: its calibration is damaged")
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
