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

from handcal.core.types import Bool, Float64
from handcal.sim.hand import HandModel
from handcal.sim.placement import PlacementError
from handcal.sim.wearer import draw_placement_error
from handcal.sim.wearer_settings import WearerSettings

Variant: TypeAlias = Literal[
    "plain", "fingers-only", "palm-only", "by-distance", "heavy-tails", "drift", "late-presses"
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
_OFTEN, _FAR_OFF = 0.1, 3.0
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
    share = SITTING_SHARE if variant == "drift" else 0.0
    return Sitting(
        variant,
        scaled,
        _times(np.sqrt(share), replace(bias, rotation_rad=np.zeros(3))),
        np.sqrt(share) * rng.normal(size=3),
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
) -> tuple[Float64, float]:
    """Draw the error of a verification: right and down in arcmin, and relative size.

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
    return lateral_arcmin * np.array([right, down]), size * float(larger)


def _times(factor: float, error: PlacementError) -> PlacementError:
    return PlacementError(
        factor * error.rotation_rad, factor * error.lateral_rad, factor * error.depth_ratio
    )
