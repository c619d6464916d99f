"""The hand as a simulated depth camera on the headset measures it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from handcal.camera.radial import DEPTH_SCALE_M, PinholeView, is_not_wrapped, white_brightness
from handcal.core.geometry import invert, transform
from handcal.core.types import Bool, Float32, Float64, Frame, Intrinsics, Rig, UInt16
from handcal.hand.outline import edges_of, with_outline
from handcal.hand.segment import segment_hand
from handcal.hand.settings import SegmentSettings
from handcal.sim.ahat import ALIAS_M, UNITS_PER_M, AhatSettings, ahat_rays, sense_distance
from handcal.sim.hand import HandModel
from handcal.sim.raster import D415, draw_hand
from handcal.sim.sensor import SensorName, SensorSettings, sense_depth

_POINTS = 1500
_WALL_M = 1.6
"""Shows the distance of a hand to a camera whose phase wraps at 1.055 m."""
_SKIN, _WHITE = 0.55, 0.8
# Only this much of a D415's image around the hand is drawn, which is three times as fast.
_MARGIN_PX = 80
# An image that holds all of AHAT's view that is used, with smaller pixels than AHAT's.
_WIDE = Intrinsics(720, 720, 345.0, 345.0, 359.5, 359.5)


@dataclass(frozen=True, slots=True, eq=False)
class SeenHand:
    """A hand as measured, in H."""

    points_m: Float64
    is_cut: Bool
    """(N, 3), (N,); the cloud, and which points are beside a cut edge."""
    outline_m: Float64
    """(M, 3); its rim as the camera sees it, in order around the hand."""


See: TypeAlias = Callable[[np.random.Generator, HandModel, Rig, Float64], SeenHand]
"""Measures a hand at a pose T_H_hand (4, 4) with a rig's camera; HandError if it cannot."""


def seen_with(sensor: SensorName, fatten_px: float) -> See:
    """Return what measures a hand with a camera; `fatten_px` is that of a D415."""
    if sensor == "ahat":
        return _ahat()
    settings = SensorSettings()
    return _d415(replace(settings, fatten_px=fatten_px) if sensor == "d415" else settings)


def _d415(settings: SensorSettings) -> See:
    def see(rng: np.random.Generator, hand: HandModel, rig: Rig, T_H_hand: Float64) -> SeenHand:
        drawn = draw_hand(hand, invert(rig.T_H_D) @ T_H_hand, D415)
        height, width = drawn.depth_m.shape
        x0, y0 = max(0, drawn.x0 - _MARGIN_PX), max(0, drawn.y0 - _MARGIN_PX)
        x1 = min(D415.width, drawn.x0 + width + _MARGIN_PX)
        y1 = min(D415.height, drawn.y0 + height + _MARGIN_PX)
        part = replace(D415, width=x1 - x0, height=y1 - y0, cx=D415.cx - x0, cy=D415.cy - y0)
        depth_m = _before_wall(drawn.depth_m, part, drawn.x0 - x0, drawn.y0 - y0)
        return _segmented(
            sense_depth(depth_m, D415.fx, rng, settings), settings.depth_scale_m, part, rig
        )

    return see


def _ahat() -> See:
    view, settings = PinholeView(ahat_rays()), AhatSettings()

    def sense(depth_m: Float32, rng: np.random.Generator) -> UInt16:
        reflectance = np.where(depth_m < _WALL_M, _SKIN, _WHITE).astype(np.float32)
        distance, brightness = sense_distance(depth_m, reflectance, _WIDE, rng, settings)
        distance_m = (distance / UNITS_PER_M).astype(np.float32)
        bright = brightness.astype(np.float32)
        white = white_brightness(distance_m, bright)
        is_near = is_not_wrapped(distance_m, bright, ALIAS_M, white)
        return view.depth(np.where(is_near, distance_m, np.float32(0.0)))

    def see(rng: np.random.Generator, hand: HandModel, rig: Rig, T_H_hand: Float64) -> SeenHand:
        drawn = draw_hand(hand, invert(rig.T_H_D) @ T_H_hand, _WIDE)
        depth_m = _before_wall(drawn.depth_m, _WIDE, drawn.x0, drawn.y0)
        return _segmented(sense(depth_m, rng), DEPTH_SCALE_M, view.intrinsics, rig)

    return see


def _before_wall(hand_m: Float32, camera: Intrinsics, x0: int, y0: int) -> Float32:
    """Return the ideal depth image of a hand in front of a wall."""
    depth_m = np.full((camera.height, camera.width), _WALL_M, np.float32)
    height, width = hand_m.shape
    box = depth_m[y0 : y0 + height, x0 : x0 + width]
    np.minimum(box, hand_m, out=box)
    return depth_m


def _segmented(depth: UInt16, scale_m: float, camera: Intrinsics, rig: Rig) -> SeenHand:
    frame = Frame(0, 0, 0, depth, scale_m, camera)
    cloud = segment_hand(frame, SegmentSettings(points=_POINTS))
    cloud = with_outline(cloud, frame, edges_of(rig))
    return SeenHand(
        transform(rig.T_H_D, cloud.points_m),
        cloud.is_cut,
        transform(rig.T_H_D, cloud.outline_m),
    )
