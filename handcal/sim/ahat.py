"""Measurement by a time-of-flight camera like AHAT, the depth camera for hands of a HoloLens 2.

The camera measures the phase of one modulated light, so distances begin again at `ALIAS_M`. Light
of two surfaces in one pixel adds as phasors, which makes flying pixels; their noise makes that of
the distance, larger where little light returns. The lens is rθ = f (θ + k θ³) with f from the like
sensor of the Azure Kinect, and k so that the ray (1, 1, 1) falls 181.2 px right of and below the
middle, as hl2ss's authors measured on a device.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np

from handcal.camera.radial import is_not_wrapped, white_brightness
from handcal.core.types import Float32, Float64, Intrinsics, UInt16

SIDE_PX = 512
_MIDDLE_PX = 257.0
_FOCAL_PX = 252.0
_CUBIC = 0.0708
_INVALID = 4090
ALIAS_M = 1.055
"""Distance at which the phase wraps, as hl2ss gives it for AHAT."""
UNITS_PER_M = 1000.0
# Brightness of a white surface at 1 m, and that below which there is no distance.
_WHITE_AT_1_M, _LEAST_BRIGHTNESS = 400.0, 40.0
# Of a hand, and of the room behind it.
_WALL_M = 1.2
_SKIN, _WHITE = 0.55, 0.8


@dataclass(frozen=True, slots=True)
class AhatSettings:
    """Settings of the simulated camera; its noise is an assumption, not a device's."""

    noise: float = 8.0
    """Standard deviation of each part of a phasor, in units of brightness. A hand at 0.5 m has a
    brightness of 800, so that its distances vary by 1.7 mm."""
    blur_px: float = 0.5
    """Standard deviation of the lens's blur."""
    offset_m: float = 0.0
    """Fault: added to every distance."""


@cache
def ahat_rays() -> Float32:
    """Return the rays (512, 512, 2) of the lens's pixels, in the plane z = 1."""
    side = np.arange(SIDE_PX) - _MIDDLE_PX
    x, y = np.meshgrid(side, side)
    radius = np.hypot(x, y) / _FOCAL_PX
    angle = radius.copy()
    for _ in range(20):
        angle -= (angle + _CUBIC * angle**3 - radius) / (1.0 + 3.0 * _CUBIC * angle**2)
    growth = np.tan(angle) / np.maximum(radius, 1e-9) / _FOCAL_PX
    rays = np.dstack([x * growth, y * growth]).astype(np.float32)
    rays.flags.writeable = False
    return rays


def sense_distance(
    depth_m: Float32,
    reflectance: Float32,
    intrinsics: Intrinsics,
    rng: np.random.Generator,
    settings: AhatSettings,
) -> tuple[UInt16, UInt16]:
    """Return the camera's measurement of a scene, given as a pinhole camera's image.

    Parameters
    ----------
    depth_m : (h, w) float32
        z; 0 where nothing returns light. It need not cover all of the lens's view.
    reflectance : (h, w) float32
        0 to 1.
    intrinsics : Intrinsics
        Of that image, at the same place; its distortion is ignored.
    rng : numpy.random.Generator
    settings : AhatSettings

    Returns
    -------
    distance, brightness : (512, 512) uint16
        Distance in units, 4090 and more where there is none.
    """
    rays = ahat_rays()
    u = (rays[..., 0] * intrinsics.fx + intrinsics.cx).astype(np.float32)
    v = (rays[..., 1] * intrinsics.fy + intrinsics.cy).astype(np.float32)
    shaded = reflectance * _facing(depth_m, intrinsics)

    def look(image: Float32) -> Float32:
        seen = cv2.remap(image, u, v, cv2.INTER_NEAREST, borderValue=0.0)
        return np.asarray(seen, np.float32)

    z_m = look(depth_m)
    distance_m = z_m * np.sqrt(1.0 + np.square(rays).sum(axis=2))
    returned = _WHITE_AT_1_M * look(shaded) / np.square(np.maximum(distance_m, 0.05))
    returned[z_m <= 0.0] = 0.0
    return _by_phase(distance_m, returned, rng, settings)


def sense_depth_by_phase(
    depth_m: Float32, intrinsics: Intrinsics, rng: np.random.Generator, settings: AhatSettings
) -> UInt16:
    """Return the depth that such a camera measures with the lens of a pinhole camera.

    Parameters
    ----------
    depth_m : (H, W) float32
        Positive everywhere.
    intrinsics : Intrinsics
        Its distortion is ignored.
    rng : numpy.random.Generator
    settings : AhatSettings

    Returns
    -------
    (H, W) uint16
        In units of 1 / `UNITS_PER_M`; 0 where there is no measurement.
    """
    x = (np.arange(intrinsics.width, dtype=np.float32) - intrinsics.cx) / intrinsics.fx
    y = (np.arange(intrinsics.height, dtype=np.float32) - intrinsics.cy) / intrinsics.fy
    along = np.sqrt(1.0 + np.square(x) + np.square(y)[:, None]).astype(np.float32)
    reflectance = np.where(depth_m < _WALL_M, _SKIN, _WHITE).astype(np.float32)
    distance_m = depth_m * along
    returned = _WHITE_AT_1_M * reflectance * _facing(depth_m, intrinsics) / np.square(distance_m)
    units, brightness = _by_phase(distance_m, returned, rng, settings)
    found_m = (units / UNITS_PER_M).astype(np.float32)
    bright = brightness.astype(np.float32)
    is_near = is_not_wrapped(found_m, bright, ALIAS_M, white_brightness(found_m, bright))
    is_near &= units < _INVALID
    return np.where(is_near, np.rint(units / along), 0.0).astype(np.uint16)


def _by_phase(
    distance_m: Float64 | Float32,
    returned: Float64 | Float32,
    rng: np.random.Generator,
    settings: AhatSettings,
) -> tuple[UInt16, UInt16]:
    """Return distance and brightness of surfaces by the phase of their light, which adds up."""
    phase = 2.0 * np.pi / ALIAS_M * (distance_m + settings.offset_m)
    sharp = np.dstack([returned * np.cos(phase), returned * np.sin(phase)]).astype(np.float64)
    parts: Float64 = np.asarray(cv2.GaussianBlur(sharp, (0, 0), settings.blur_px), np.float64)
    parts += rng.normal(0.0, settings.noise, parts.shape)
    brightness = np.hypot(parts[..., 0], parts[..., 1])
    turns = np.arctan2(parts[..., 1], parts[..., 0]) / (2.0 * np.pi) % 1.0
    units = np.rint(turns * ALIAS_M * UNITS_PER_M)
    units[brightness < _LEAST_BRIGHTNESS] = _INVALID
    return units.astype(np.uint16), np.clip(np.rint(brightness), 0, 65535).astype(np.uint16)


def _facing(depth_m: Float32, camera: Intrinsics) -> Float32:
    """Return the cosine (h, w) between each surface and the light, which is at the camera."""
    height, width = depth_m.shape
    x = (np.arange(width) - camera.cx) / camera.fx
    y = (np.arange(height) - camera.cy) / camera.fy
    rays: Float64 = np.dstack([*np.meshgrid(x, y), np.ones_like(depth_m)])
    smooth = cv2.bilateralFilter(depth_m, 5, 0.01, 1.5)
    points = rays * smooth[..., None]
    normal = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0))
    length = np.linalg.norm(normal, axis=2) * np.linalg.norm(rays, axis=2)
    facing = np.abs((normal * rays).sum(axis=2)) / np.maximum(length, 1e-12)
    steps = np.abs(cv2.Laplacian(depth_m, cv2.CV_32F, ksize=1))
    facing[steps > 0.02] = 0.5  # an edge is no surface
    return np.asarray(facing, np.float32)
