"""A textured, box-shaped room around the wearer, fixed in the world."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from handcal.core.frozen import freeze
from handcal.core.types import Float32, Float64, Intrinsics, UInt8

# Range of the distances from W's origin to each wall, the floor and the ceiling.
_WALLS_M = 1.2, 2.4
_TEXEL_M = 0.004  # size of a texture's pixel


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """A box in W, seen from inside."""

    low_m: Float64
    high_m: Float64
    """(3,); its corners, W."""
    textures: tuple[UInt8, ...]
    """each (h, w, 3); RGB of the walls −x, +x, −y, +y, −z, +z; rows run along the later of the two
    axes that span the wall, columns along the earlier."""
    light: Float64
    """(3,); unit vector toward the light, W."""

    def __post_init__(self) -> None:
        freeze(self, "low_m", np.float64, 3)
        freeze(self, "high_m", np.float64, 3)
        freeze(self, "light", np.float64, 3)


@lru_cache(maxsize=2)  # as hands are
def make_room(seed: int) -> Room:
    """Return the room of a seed: distances and textures of its walls, and the light's direction."""
    rng = np.random.default_rng(seed)
    low_m = -rng.uniform(*_WALLS_M, 3)
    high_m = rng.uniform(*_WALLS_M, 3)
    textures = []
    for axis in range(3):
        width, height = np.ceil(np.delete(high_m - low_m, axis) / _TEXEL_M).astype(int)
        textures += [_wallpaper(rng, int(width), int(height)) for _ in range(2)]
    light = np.array([rng.uniform(-0.6, 0.6), -1.0, rng.uniform(-0.9, -0.3)])
    return Room(low_m, high_m, tuple(textures), light / np.linalg.norm(light))


def _wallpaper(rng: np.random.Generator, width: int, height: int) -> UInt8:
    """Return a texture with grain of several sizes, so that stereo works, and some pictures."""
    paint = rng.uniform(90.0, 190.0) + rng.normal(0.0, 15.0, 3)
    grain = np.zeros((height, width), dtype=np.float32)
    for cell, strength in ((64, 14.0), (12, 8.0), (2, 8.0)):
        coarse = rng.normal(0.0, strength, (height // cell + 2, width // cell + 2))
        grain += cv2.resize(coarse.astype(np.float32), (width, height))
    wall = (paint + grain[..., None]).clip(0, 255).astype(np.uint8)
    for _ in range(12):
        corner = (rng.uniform(0.0, 1.0, 2) * (width, height)).astype(int)
        size = rng.integers(20, 160, 2)
        color = rng.integers(20, 235, 3).tolist()
        cv2.rectangle(wall, corner.tolist(), (corner + size).tolist(), color, cv2.FILLED)
    wall.setflags(write=False)
    return wall


def draw_room(room: Room, T_W_D: Float64, intrinsics: Intrinsics) -> tuple[Float32, UInt8]:
    """Draw the room.

    The inverse depth of a plane is affine in the pixel, and from inside a box the wall seen is the
    one with the largest inverse depth; its texture follows by a homography.

    Parameters
    ----------
    room : Room
    T_W_D : (4, 4) float64
        The camera's pose; its position inside the room.
    intrinsics : Intrinsics
        Its distortion is not simulated.

    Returns
    -------
    inverse_depth : (H, W) float32
        1/z in the camera's frame, 1/m.
    color : (H, W, 3) uint8
        RGB.
    """
    x = (np.arange(intrinsics.width) - intrinsics.cx) / intrinsics.fx
    y = (np.arange(intrinsics.height) - intrinsics.cy) / intrinsics.fy
    inverse = np.zeros((intrinsics.height, intrinsics.width), dtype=np.float32)
    walls = [
        (np.add.outer((b * y + c).astype(np.float32), (a * x).astype(np.float32)), texture, H)
        for (a, b, c), texture, H in _walls(room, T_W_D)
        # An affine function has its maximum in a corner.
        if max(a * x[0], a * x[-1]) + max(b * y[0], b * y[-1]) + c > 0.0
    ]
    for wall, _, _ in walls:
        np.maximum(inverse, wall, out=inverse)
    color = np.empty((*inverse.shape, 3), dtype=np.uint8)
    K_inverse = np.array(
        [
            [1.0 / intrinsics.fx, 0.0, -intrinsics.cx / intrinsics.fx],
            [0.0, 1.0 / intrinsics.fy, -intrinsics.cy / intrinsics.fy],
            [0.0, 0.0, 1.0],
        ]
    )
    for wall, texture, H in walls:
        mask = cv2.compare(wall, inverse, cv2.CMP_EQ)
        x0, y0, width, height = cv2.boundingRect(mask)
        if not width:
            continue
        to_box = np.array([[1.0, 0.0, x0], [0.0, 1.0, y0], [0.0, 0.0, 1.0]])
        box = slice(y0, y0 + height), slice(x0, x0 + width)
        painted = cv2.warpPerspective(
            texture,
            H @ K_inverse @ to_box,
            (width, height),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
        cv2.copyTo(painted, mask[box], color[box])
    return inverse, color


def _walls(room: Room, T_W_D: Float64) -> Iterator[tuple[Float64, UInt8, Float64]]:
    """Yield each wall's inverse depth (factors of x, y and 1), texture, and texels from rays."""
    R, center = T_W_D[:3, :3], T_W_D[:3, 3]
    for axis in range(3):
        across = [other for other in range(3) if other != axis]
        for side, bound_m in enumerate((room.low_m[axis], room.high_m[axis])):
            away_m = bound_m - center[axis]
            # Where the ray R r meets the wall: center + R r · away / (R r)[axis].
            H = np.empty((3, 3))
            for row, other in enumerate(across):
                H[row] = (
                    away_m * R[other] + (center[other] - room.low_m[other]) * R[axis]
                ) / _TEXEL_M - 0.5 * R[axis]
            H[2] = R[axis]
            yield R[axis] / away_m, room.textures[2 * axis + side], H
