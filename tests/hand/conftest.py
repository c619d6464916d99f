"""Simulated frames of hands with a known wrist."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import Bool, Float32, Float64, Frame, Intrinsics
from handcal.sim.hand import HandModel, HandSettings, make_hand
from handcal.sim.raster import draw_hand
from handcal.sim.sensor import SensorSettings, sense_depth

CAMERA = Intrinsics(width=640, height=360, fx=502.5, fy=502.5, cx=319.5, cy=179.5)
SENSOR = SensorSettings()


@dataclass(frozen=True)
class Shot:
    """A frame of a simulated hand and its ground truth."""

    frame: Frame
    hand: HandModel
    T_D_hand: Float64
    depth_m: Float32

    def beyond_wrist_m(self, points_m: Float32) -> Float64:
        """Return the distance of points beyond the wrist along the arm; negative on the hand."""
        on_hand_m = transform(invert(self.T_D_hand), points_m)
        return np.asarray((on_hand_m - self.hand.wrist_m) @ self.hand.arm_axis, np.float64)

    def is_hand(self) -> Bool:
        """Return the mask of the pixels that truly show the hand, wrist included."""
        rows, columns = np.indices(self.depth_m.shape)
        x = (columns - CAMERA.cx) / CAMERA.fx
        y = (rows - CAMERA.cy) / CAMERA.fy
        seen = np.isfinite(self.depth_m)
        points_m = np.stack([x, y, np.ones_like(x)], axis=-1)[seen] * self.depth_m[seen, None]
        on_hand = np.zeros_like(seen)
        on_hand[seen] = self.beyond_wrist_m(points_m.astype(np.float32)) < 0.0
        return on_hand


def shoot(
    seed: int = 0,
    *,
    at_m: tuple[float, float, float] = (0.0, 0.02, 0.52),
    turn_rad: tuple[float, float, float] = (0.1, 0.1, 0.1),
    roll_rad: float = 0.0,
    forearm_m: float = 0.3,
    wall_m: float = 1.5,
    noise_seed: int = 0,
    shape: HandSettings | None = None,
) -> Shot:
    """Render a hand in front of a wall, as seen by the depth camera; rolled in the image."""
    hand = make_hand(seed, replace(shape or HandSettings(), forearm_m=forearm_m))
    T_D_hand = rigid([0.0, 0.0, roll_rad], at_m) @ rigid(turn_rad)
    image = draw_hand(hand, T_D_hand, CAMERA)
    depth_m = np.full((CAMERA.height, CAMERA.width), np.inf, np.float32)
    height, width = image.depth_m.shape
    depth_m[image.y0 : image.y0 + height, image.x0 : image.x0 + width] = image.depth_m
    rng = np.random.default_rng(noise_seed)
    # Focal length of the full-resolution image, whose noise the smaller one inherits.
    depth = sense_depth(np.minimum(depth_m, wall_m), 2 * CAMERA.fx, rng, SENSOR)
    frame = Frame(1, 1_000, 2_000, depth, SENSOR.depth_scale_m, CAMERA)
    return Shot(frame, hand, T_D_hand, depth_m)


@pytest.fixture(scope="session")
def shot() -> Shot:
    return shoot()
