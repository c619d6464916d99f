"""The view of the simulated wearer's true eyes through the displays: the truth.

The engine may show these images and judge by them, but never calibrate from them.
"""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np

from handcal.core.display import eye_projection, view_of_eye
from handcal.core.geometry import camera_matrix, invert, rigid
from handcal.core.types import Eye, EyeDisplay, Float64, Intrinsics, Rig, UInt8
from handcal.sim.render import World, render
from handcal.sim.wearer import draw_eyes
from handcal.sim.wearer_settings import WearerSettings

_DISPLAY_PX_PER_PX = 2


class TrueEyes:
    """Both eyes of a simulated wearer.

    Parameters
    ----------
    world : World
        The visible world.
    rig : Rig
        Rig of the worn headset.
    seed : int
        Seed of the wearer, as for `handcal.sim.wearer.Wearer`.
    settings : WearerSettings, optional

    Attributes
    ----------
    shift_m : mapping of eye to (3,) float64
        True φ from C0, E axes.
    """

    def __init__(
        self, world: World, rig: Rig, seed: int, settings: WearerSettings | None = None
    ) -> None:
        self._world = world
        self._rig = rig
        self.shift_m: Mapping[Eye, Float64] = draw_eyes(
            np.random.default_rng(seed), settings or WearerSettings()
        )

    def look(self, eye: Eye, T_W_H: Float64, T_W_hand: Float64 | None) -> UInt8:
        """Return an eye's view of the world within its display, without anything drawn.

        Parameters
        ----------
        eye : {"left", "right"}
        T_W_H : (4, 4) float64
            True pose of the headset.
        T_W_hand : (4, 4) float64 or None
            True pose of the hand; None while it is out of sight.

        Returns
        -------
        (height_px // 2, width_px // 2, 3) uint8
            RGB, covering the display.
        """
        display, shift_m = self._rig.eyes[eye], self.shift_m[eye]
        size = display.width_px // _DISPLAY_PX_PER_PX, display.height_px // _DISPLAY_PX_PER_PX
        K = _image_from_display(display, size) @ eye_projection(display, shift_m)[:, :3]
        pinhole = _fit_pinhole(K, size)
        T_W_eye = invert(view_of_eye(display, T_W_H)) @ rigid(translation_m=shift_m)
        _, image = render(self._world, T_W_eye, T_W_hand, pinhole)
        H = K @ np.linalg.inv(camera_matrix(pinhole))
        seen = cv2.warpPerspective(image, H, size, borderMode=cv2.BORDER_REPLICATE)
        return seen.astype(np.uint8, copy=False)


def _image_from_display(display: EyeDisplay, size: tuple[int, int]) -> Float64:
    """Return the (3, 3) matrix from the display's pixels to those of an image over all of it."""
    x, y = size[0] / display.width_px, size[1] / display.height_px
    return np.array([[x, 0.0, (x - 1.0) / 2.0], [0.0, y, (y - 1.0) / 2.0], [0.0, 0.0, 1.0]])


def _fit_pinhole(K: Float64, size: tuple[int, int]) -> Intrinsics:
    """Return the upright pinhole camera that covers the view of one with any (3, 3) K.

    K may rotate and skew the image, as it includes the display's homography H0.
    """
    width, height = size
    corners_px = [[x, y, 1.0] for x in (-0.5, width - 0.5) for y in (-0.5, height - 0.5)]
    rays = np.linalg.solve(K, np.transpose(corners_px)).T
    (left, top), (right, bottom) = (f(rays[:, :2] / rays[:, 2:], axis=0) for f in (np.min, np.max))
    fx, fy = width / (right - left), height / (bottom - top)
    return Intrinsics(width, height, fx, fy, -0.5 - fx * left, -0.5 - fy * top)
