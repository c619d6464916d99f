"""Shapes that the headset draws besides the hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handcal.core.frozen import brief, freeze
from handcal.core.types import EYES, Eye, Float64


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """A shape that the headset draws fixed in the world."""

    corners_W_m: Float64
    """(4, 3), a quadrilateral in order; or (8, 3), a cube: two opposite faces in the same order."""
    eyes: tuple[Eye, ...] = EYES
    """The eyes that draw it."""

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "corners_W_m", np.float64, None, 3)
        if len(self.corners_W_m) not in (4, 8):
            raise ValueError("Shape.corners_W_m: a quadrilateral has 4 corners, a cube 8")


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """The target of the user test: drawn for one eye, fixed relative to its display."""

    eye: Eye
    corners_V_m: Float64
    """(4, 3); clockwise from the upper left, in V."""

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "corners_V_m", np.float64, 4, 3)
