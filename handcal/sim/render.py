"""Ideal images of the hand in the room: no noise, no holes."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from handcal.core.geometry import invert
from handcal.core.types import Float32, Float64, Intrinsics, UInt8
from handcal.sim.hand import HandModel
from handcal.sim.raster import HandImage, draw_hand
from handcal.sim.room import Room, draw_room

_AMBIENT, _DIFFUSE = 0.45, 0.65


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """Everything that a simulated camera can see."""

    hand: HandModel
    room: Room


def render(
    world: World, T_W_D: Float64, T_W_hand: Float64 | None, intrinsics: Intrinsics
) -> tuple[Float32, UInt8]:
    """Render depth and colour of the hand in the room.

    Parameters
    ----------
    world : World
    T_W_D : (4, 4) float64
        The camera's pose.
    T_W_hand : (4, 4) float64 or None
        The hand's pose; None while it is out of sight.
    intrinsics : Intrinsics
        Its distortion is not simulated.

    Returns
    -------
    depth_m : (H, W) float32
        z in the camera's frame.
    color : (H, W, 3) uint8
        RGB.
    """
    inverse, color = draw_room(world.room, T_W_D, intrinsics)
    depth_m = np.float32(1.0) / inverse
    if T_W_hand is not None:
        light = T_W_hand[:3, :3].T @ world.room.light
        T_D_hand = invert(T_W_D) @ T_W_hand
        _paste(
            draw_hand(world.hand, T_D_hand, intrinsics, _shade(world.hand, light)), depth_m, color
        )
    # Sharpness limit of a lens; it also blends the hand's outline with the background.
    cv2.GaussianBlur(color, (3, 3), 0.6, dst=color)
    return depth_m, color


def _paste(image: HandImage, depth_m: Float32, color: UInt8) -> None:
    """Draw the hand over the background, in place."""
    height, width = image.depth_m.shape
    if not image.depth_m.size:
        return
    box = slice(image.y0, image.y0 + height), slice(image.x0, image.x0 + width)
    on_hand = cv2.compare(image.depth_m, depth_m[box], cv2.CMP_LT)
    np.minimum(depth_m[box], image.depth_m, out=depth_m[box])
    cv2.copyTo((255.0 * image.color).astype(np.uint8), on_hand, color[box])


def _shade(hand: HandModel, light: Float64) -> Float32:
    """Return (V, 3) shades, 0 to 1, by Lambert's law with ambient light."""
    lit = np.clip(hand.normals @ light.astype(np.float32), 0.0, 1.0)
    shade = (_AMBIENT + _DIFFUSE * lit) / 255.0
    return np.minimum(hand.colors * shade[:, None], 1.0, dtype=np.float32)
