"""Simulated hands for training: all skin tones, raised in front of a wearer's camera."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from handcal.core.geometry import rigid, transform
from handcal.core.types import Bool, Float64, Intrinsics, UInt8
from handcal.io.files import make_folder, read_json, write_json
from handcal.sim.hand import HandModel, HandSettings, make_hand
from handcal.sim.raster import draw_hand
from handcal.sim.render import World, render
from handcal.sim.room import Room, make_room

# A third of the colour image of an Intel RealSense D415, 69° across.
CAMERA = Intrinsics(width=424, height=240, fx=306.0, fy=306.0, cx=211.5, cy=119.5)
_FIRST_SEED = 1_000_000  # tests and benchmarks start at 0
_HANDS_PER_ROOM = 25
_GRID_M = 0.003
_TILT = 1.6  # foreshortened and sideways hands are the hardest to detect


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A simulated hand in a simulated room."""

    color: UInt8
    """(H, W, 3); RGB."""
    is_hand: Bool
    """(H, W); the hand and its forearm."""
    box: Float64
    """(4,); x0, y0, x1, y1 of the hand without its forearm, px from the image's upper left corner;
    may extend beyond the image."""
    skin: Float64
    """(3,); mean colour of the skin in even light, RGB of 0 to 255."""


def picture(
    seed: int, room: Room, camera: Intrinsics, settings: HandSettings, tilt: float = 1.0
) -> Picture:
    """Render the hand of a seed, raised in front of a camera in a room.

    A larger `tilt` makes hands foreshortened or sideways more often than a wearer's.
    """
    rng = np.random.default_rng(seed)
    hand = make_hand(seed, settings)
    T_W_D = rigid([rng.normal(0.0, 0.2), rng.uniform(-3.1, 3.1), 0.0])
    T_D_hand = _raised(rng, camera, tilt)
    _, color = render(World(hand, room), T_W_D, T_W_D @ T_D_hand, camera)
    drawn = draw_hand(hand, T_D_hand, camera)
    rows, columns = drawn.depth_m.shape
    is_hand = np.zeros(color.shape[:2], bool)
    is_hand[drawn.y0 : drawn.y0 + rows, drawn.x0 : drawn.x0 + columns] = np.isfinite(drawn.depth_m)
    return Picture(color, is_hand, _hand_box(hand, T_D_hand, camera), hand.colors.mean(0))


def render_hands(folder: Path, count: int) -> None:
    """Write `count` images as PNG, opaque on the hand and its arm, and their boxes.

    Existing ones are kept.
    """
    listing = make_folder(folder) / "boxes.json"
    if listing.exists() and len(read_json(listing)) == count:
        return
    boxes = {}
    for number in range(count):
        seed = _FIRST_SEED + number
        if number % _HANDS_PER_ROOM == 0:
            room = make_room(seed)
        drawn = picture(seed, room, CAMERA, HandSettings(grid_m=_GRID_M), _TILT)
        name = f"{number:05}.png"
        boxes[name] = drawn.box.round(1).tolist()
        alpha = np.where(drawn.is_hand, np.uint8(255), np.uint8(0))
        cv2.imwrite(str(folder / name), np.dstack([drawn.color[..., ::-1], alpha]))
    write_json(listing, boxes)


def _hand_box(hand: HandModel, T_D_hand: Float64, camera: Intrinsics) -> Float64:
    """Return x0, y0, x1, y1 of the hand without its forearm, in pixels; (4,) float64."""
    beyond_wrist = (hand.vertices_m - hand.wrist_m) @ hand.arm_axis < 0.0
    x, y, z = transform(T_D_hand, hand.vertices_m[beyond_wrist].astype(np.float64)).T
    u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
    return np.array([u.min(), v.min(), u.max(), v.max()]) + 0.5  # u, v: from a pixel's centre


def _raised(rng: np.random.Generator, camera: Intrinsics, tilt: float) -> Float64:
    """Return the pose of a hand in view, within arm's reach, palm or back to the camera."""
    z = rng.uniform(0.3, 0.7)
    x = z * rng.uniform(0.15, 0.85) * camera.width / camera.fx - z * camera.cx / camera.fx
    y = z * rng.uniform(0.3, 0.75) * camera.height / camera.fy - z * camera.cy / camera.fy
    facing = rigid([0.0, np.pi * rng.integers(2), 0.0])
    tilted = rigid([tilt * rng.normal(0.0, 0.35), tilt * rng.normal(0.0, 0.4), 0.0])
    rolled = rigid([0.0, 0.0, tilt * rng.normal(0.0, 0.6)])
    return rigid(translation_m=[x, y, z]) @ rolled @ tilted @ facing
