"""Images of a simulated display, taken by the viewpoint camera behind it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from handcal.core.display import eye_projection
from handcal.core.types import EyeDisplay, Float64, Intrinsics, UInt8
from handcal.sim.boards import PictureSettings, pixel_rays

_BLACK, _WHITE = 12.0, 190.0  # a display only adds light, and black is not quite dark

VIEWPOINT_CAMERA = Intrinsics(
    1280, 720, 1800.0, 1797.0, 644.0, 355.0, (-0.08, 0.05, 0.0004, -0.0003, 0.0)
)
"""An eye-replacement camera with 1.9 arcmin per pixel; that of Hu et al. 2021 had 1.28."""


def photograph_display(
    shown: UInt8,
    display: EyeDisplay,
    R_E_C: Float64,
    camera: Intrinsics,
    rng: np.random.Generator,
    *,
    shift_m: ArrayLike = (0.0, 0.0, 0.0),
    settings: PictureSettings | None = None,
) -> UInt8:
    """Return the image of a display in the dark, from near the offline viewpoint.

    Parameters
    ----------
    shown : (height_px, width_px) uint8
        The displayed image.
    display : EyeDisplay
    R_E_C : (3, 3) float64
        From the camera's axes to the display's.
    camera : Intrinsics
        With lens distortion.
    rng : numpy.random.Generator
    shift_m : (3,) array_like
        Position of the camera's centre relative to C0, E axes.
    settings : PictureSettings, optional

    Returns
    -------
    (H, W) uint8
    """
    settings = settings or PictureSettings()
    rays = pixel_rays(camera, settings.samples)
    # Intersection of the camera's rays with the display: the model's own rays, from φ.
    P = eye_projection(display, shift_m)[:, :3] @ R_E_C
    homogeneous = rays @ P.T.astype(np.float32)
    x, y = (homogeneous[..., axis] / homogeneous[..., 2] for axis in range(2))
    fine = cv2.remap(shown, x, y, cv2.INTER_LINEAR)
    light = cv2.resize(fine, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    image = _BLACK + (_WHITE - _BLACK) / 255.0 * light.astype(np.float64)
    blurred = cv2.GaussianBlur(image, (0, 0), settings.blur_px)
    noisy = blurred + rng.normal(0.0, settings.noise, image.shape)
    seen: UInt8 = np.rint(noisy).clip(0, 255).astype(np.uint8)
    return seen
