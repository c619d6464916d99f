"""The viewpoint camera behind a simulated display: what it sees of what is shown there."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from handcal.display import eye_projection
from handcal.geometry import camera_matrix
from handcal.sim.boards import PictureSettings
from handcal.types import EyeDisplay, Float64, Intrinsics, UInt8

_BLACK, _WHITE = 12.0, 190.0  # a display shows light only; the dark is not quite dark

VIEWPOINT_CAMERA = Intrinsics(
    1920, 1080, 2690.0, 2690.0, 965.0, 534.0, (-0.08, 0.05, 0.0004, -0.0003, 0.0)
)
"""An eye-replacement camera of 1.28 arcmin a pixel (Hu et al. 2021, implementation)."""


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
    """Return what a camera near the offline viewpoint sees of a display in the dark.

    Parameters
    ----------
    shown : (height_px, width_px) uint8
        What the display shows.
    display : EyeDisplay
    R_E_C : (3, 3) float64
        From the camera's axes to the display's.
    camera : Intrinsics
        Lens included.
    rng : numpy.random.Generator
    shift_m : (3,) array_like
        Where the camera's centre is from C0, E axes.
    settings : PictureSettings, optional
        Its `samples` are not used: a display's pixels are about as large as the camera's.

    Returns
    -------
    (H, W) uint8
    """
    settings = settings or PictureSettings()
    row, column = np.indices((camera.height, camera.width), dtype=np.float64)
    pixels = np.stack([column, row], axis=-1).reshape(-1, 1, 2)
    rays = cv2.undistortPoints(
        pixels,
        camera_matrix(camera),
        np.array(camera.distortion),
        criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-9),
    )
    # From where a ray of the camera falls onto the display: the model's own rays, from φ.
    P = eye_projection(display, shift_m)[:, :3] @ R_E_C
    seen_px = cv2.perspectiveTransform(rays, P).reshape(*row.shape, 2).astype(np.float32)
    light = cv2.remap(shown, seen_px, None, cv2.INTER_LINEAR)  # type: ignore[call-overload]
    image = _BLACK + (_WHITE - _BLACK) / 255.0 * light.astype(np.float64)
    image = cv2.GaussianBlur(image, (0, 0), settings.blur_px)
    noisy = image + rng.normal(0.0, settings.noise, image.shape)
    seen: UInt8 = np.rint(noisy).clip(0, 255).astype(np.uint8)
    return seen
