"""Errors of people who align a hand with a cursor, or verify a drawing, during one sitting.

The error of one overlay is that of `WearerSettings`. What differs between people is a variant:
what of the hand they balance, the distribution of their errors, and what the hand does between
being right and being measured. The figures of ``drift`` and ``late-presses`` are from recordings
(docs/studies.md); the others are invented.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias, get_args

import numpy as np

from handcal.core.geometry import rigid
from handcal.core.types import Bool, Float64
from handcal.sim.hand import HandModel
from handcal.sim.placement import PlacementError
from handcal.sim.verifying import SeenDifference
from handcal.sim.wearer import draw_placement_error
from handcal.sim.wearer_settings import WearerSettings

Variant: TypeAlias = Literal[
    "plain",
    "fingers-only",
    "palm-only",
    "by-distance",
    "heavy-tails",
    "drift",
    "late-presses",
    "fits-at-once",
    "opens",
    "known-fat-2mm",
    "unmeasured",
    "fat-2mm",
    "fat-1mm",
    "constant-size",
    "constant-direction",
]
VARIANTS: tuple[Variant, ...] = get_args(Variant)

SITTING_SHARE = 0.5
"""Share of the variance of a drifting person's overlay that is the same for a whole sitting."""
DRIFT_SIGMA_M = 0.0008
"""Standard deviation, along each axis, of a hand held still for a second: 0.9, 0.9 and 0.4 mm in
the Leap recording."""
LATE_S = 0.3
"""Mean delay of a late press after the hand was right, exponential."""
LEAVING_M_S = 0.0084
"""Standard deviation of the velocity along each axis of a hand meanwhile: 2.5 mm in 0.3 s in the
laser recordings, whose arms were stretched and not supported."""
CONSTANT_SIZE = 0.01
"""By how much larger those with a constant error of size see the hand."""
CONSTANT_ARCMIN = 4.0
"""Distance beside the hand at which those with a constant error of direction see it."""
_RIGHT = SeenDifference(0.0, 0.0, 0.0)
_OPENING = 0.01, 0.03
_OFTEN, _FAR_OFF = 0.1, 3.0
_ARCMIN = np.radians(1.0 / 60.0)
_SAME_AT_M = 0.56


@dataclass(frozen=True, slots=True, eq=False)
class Sitting:
    """One person during one sitting."""

    variant: Variant
    settings: WearerSettings
    bias: PlacementError
    """The part of every error of an overlay that stays the same."""
    perceived_bias: Float64
    """(3,); the same of a verification, right, down and size, in standard deviations."""
    sees_hand: SeenDifference = _RIGHT
    """The hand as this person sees it, relative to where, and how large, it is."""


def begin_sitting(
    rng: np.random.Generator, settings: WearerSettings, variant: Variant, scale: float = 1.0
) -> Sitting:
    """Return a person whose errors of an overlay are those of the settings times a scale."""
    scaled = replace(
        settings,
        lateral_sigma_arcmin=scale * settings.lateral_sigma_arcmin,
        depth_sigma=scale * settings.depth_sigma,
        rotation_sigma_rad=scale * settings.rotation_sigma_rad,
    )
    bias = draw_placement_error(rng, scaled)
    sees_hand = _RIGHT
    if variant == "constant-size":
        sees_hand = SeenDifference(0.0, 0.0, CONSTANT_SIZE)
    elif variant == "constant-direction":
        angle = rng.uniform(0.0, 2.0 * np.pi)
        right, down = CONSTANT_ARCMIN * np.cos(angle), CONSTANT_ARCMIN * np.sin(angle)
        sees_hand = SeenDifference(right, down, 0.0)
    share = SITTING_SHARE if variant == "drift" else 0.0
    return Sitting(
        variant,
        scaled,
        _times(np.sqrt(share), replace(bias, rotation_rad=np.zeros(3))),
        np.sqrt(share) * rng.normal(size=3),
        sees_hand,
    )


def draw_error(
    rng: np.random.Generator, sitting: Sitting, depth_m: float, largest_rad: float
) -> PlacementError:
    """Draw the error of one overlay of a hand at a distance, turned by no more than a limit."""
    error = draw_placement_error(rng, sitting.settings)
    while np.linalg.norm(error.rotation_rad) > largest_rad:
        error = draw_placement_error(rng, sitting.settings)
    factor = 1.0
    if sitting.variant == "by-distance":
        factor = _SAME_AT_M / depth_m
    elif sitting.variant == "heavy-tails" and rng.random() < _OFTEN:
        factor = _FAR_OFF
    elif sitting.variant == "drift":
        factor = np.sqrt(1.0 - SITTING_SHARE)
    error = replace(_times(factor, error), rotation_rad=error.rotation_rad)
    return PlacementError(
        error.rotation_rad,
        error.lateral_rad + sitting.bias.lateral_rad,
        error.depth_ratio + sitting.bias.depth_ratio,
    )


def misplaced(T_H_hand: Float64, eye_m: Float64, sees_hand: SeenDifference) -> Float64:
    """Return the pose of a hand that seems to be at a pose to someone who sees it wrongly.

    Who sees the hand to the right of where it is holds it to the left, and who sees it larger
    holds it farther away.

    Parameters
    ----------
    T_H_hand : (4, 4) float64
    eye_m : (3,) float64
    sees_hand : SeenDifference
    """
    line_m = T_H_hand[:3, 3] - eye_m
    x, y, z = line_m
    moved_m = np.array([x, y, z]) * sees_hand.size
    moved_m -= z * _ARCMIN * np.array([sees_hand.right_arcmin, sees_hand.down_arcmin, 0.0])
    return rigid(translation_m=moved_m) @ T_H_hand


def opened(rng: np.random.Generator, hand: HandModel, sitting: Sitting) -> HandModel:
    """Return the hand as it is held under a cursor: opened since, of those whose hand opens."""
    if sitting.variant != "opens":
        return hand
    larger = np.float32(1.0 + rng.uniform(*_OPENING))
    return replace(hand, vertices_m=larger * hand.vertices_m)


def draw_movement_m(rng: np.random.Generator, sitting: Sitting) -> Float64:
    """Draw the movement of the hand, (3,), from being right to being measured."""
    if sitting.variant == "drift":
        return rng.normal(0.0, DRIFT_SIGMA_M, 3)
    if sitting.variant == "late-presses":
        return rng.exponential(LATE_S) * rng.normal(0.0, LEAVING_M_S, 3)
    return np.zeros(3)


def is_balanced(points_m: Float64, hand: HandModel, sitting: Sitting) -> Bool:
    """Return (N,): True for the points, in the hand's frame, that this person balances."""
    along_m = (points_m - hand.wrist_m) @ hand.arm_axis
    middle_m = np.median(along_m)
    if sitting.variant == "fingers-only":
        return np.asarray(along_m < middle_m)
    if sitting.variant == "palm-only":
        return np.asarray(along_m >= middle_m)
    return np.ones(len(points_m), np.bool_)


def draw_perception(
    rng: np.random.Generator, sitting: Sitting, lateral_arcmin: float, size: float
) -> SeenDifference:
    """Draw the error of a verification.

    Parameters
    ----------
    rng : numpy.random.Generator
    sitting : Sitting
    lateral_arcmin, size : float
        Standard deviations for a person whose overlays err as those of `WearerSettings`.
    """
    usual = WearerSettings()
    scale = sitting.settings.lateral_sigma_arcmin / usual.lateral_sigma_arcmin
    if sitting.variant == "heavy-tails" and rng.random() < _OFTEN:
        scale *= _FAR_OFF
    own = rng.normal(size=3)
    if sitting.variant == "drift":
        own *= np.sqrt(1.0 - SITTING_SHARE)
    right, down, larger = scale * (own + sitting.perceived_bias)
    always = sitting.sees_hand
    return SeenDifference(
        lateral_arcmin * float(right) + always.right_arcmin,
        lateral_arcmin * float(down) + always.down_arcmin,
        size * float(larger) + always.size,
    )


def _times(factor: float, error: PlacementError) -> PlacementError:
    return PlacementError(
        factor * error.rotation_rad, factor * error.lateral_rad, factor * error.depth_ratio
    )
