"""Errors that are the same in all observations of one sitting.

More alignments average out what differs between them, never what repeats. Six errors repeat: a
wearer who always sees the hand a little beside or larger than it is, a drawn outline that is wider
than the hand because the depth camera fattens edges, and the scale and offset of measured depth.
They are unknowns of the fused system beside φ of both eyes, with a prior of their own.

The data tell a little about them. A constant error in direction moves φ by ``z / (1 - z φ4)`` times
its angle, so observations of a near and of a far hand that disagree show it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handcal.core.types import Float64, Rig

OF_WEARER = slice(0, 3)
"""Those of the wearer among the six errors."""
OUTLINE = 9
"""Place of the outline among the twelve unknowns, after φ of both eyes."""

# A drawing that is wider by one pixel's angle all round seems too large by that angle over the
# hand's mean half width, and, as the outline is open at the wrist, too high by the same angle.
# Measured on simulated hands (docs/registration.md).
_HALF_WIDTH_M = 0.075
_ARCMIN = np.radians(1.0 / 60.0)


@dataclass(frozen=True, slots=True)
class LearnedSitting:
    """Mean and covariance of a wearer's constant errors, learned from a lab's sittings."""

    mean: tuple[float, ...]
    """(3,); right and down, rad, and relative size."""
    covariance: tuple[float, ...]
    """(9,); row by row."""
    sittings: int
    """Number of sittings it was learned from."""

    def __post_init__(self) -> None:
        if len(self.mean) != 3 or len(self.covariance) != 9:
            raise ValueError("a wearer's prior has a mean of 3 numbers and a covariance of 9")
        covariance = np.reshape(self.covariance, (3, 3))
        is_symmetric = np.allclose(covariance, covariance.T, rtol=1e-6, atol=1e-15)
        if not is_symmetric or np.linalg.eigvalsh(covariance)[0] < 0.0:
            raise ValueError("the covariance of a wearer's prior is not one")


@dataclass(frozen=True, slots=True)
class SittingSettings:
    """The prior on what a wearer sees wrongly in a whole sitting."""

    direction_sigma_arcmin: float = 1.0
    """Standard deviation in each of two directions."""
    size_sigma: float = 0.0025
    """Relative standard deviation of the size."""
    learned: LearnedSitting | None = None
    """Used instead, if there is one."""


@dataclass(frozen=True, slots=True, eq=False)
class SittingPrior:
    """The prior on the errors of a sitting, Gaussian.

    They are direction to the right and down, rad, and relative size of what the wearer sees; width
    of the drawn outline beyond the hand, in its standard deviations, which differ between
    observations; scale and offset, m, of depth.
    """

    mean: Float64
    """(6,)."""
    covariance: Float64
    """(6, 6)."""


def sitting_prior(rig: Rig, settings: SittingSettings) -> SittingPrior:
    """Return the prior on the errors of a sitting with a rig.

    The bias of depth that a depth check found is not corrected, and counts like an uncertainty of
    its size. Without a depth check it is taken as zero.
    """
    mean, covariance = np.zeros(6), np.zeros((6, 6))
    if settings.learned is None:
        direction = settings.direction_sigma_arcmin * _ARCMIN
        covariance[OF_WEARER, OF_WEARER] = np.diag([direction, direction, settings.size_sigma]) ** 2
    else:
        mean[OF_WEARER] = settings.learned.mean
        covariance[OF_WEARER, OF_WEARER] = np.reshape(settings.learned.covariance, (3, 3))
    covariance[3, 3] = 1.0
    if (check := rig.depth_check) is not None:
        bias = np.array([check.scale - 1.0, check.offset_m])
        covariance[4:, 4:] = check.covariance + np.outer(bias, bias)
    return SittingPrior(mean, covariance)


def shift_by_sitting(
    hand_E_m: Sequence[float] | Float64,
    distance_m: float,
    outline_rad: float,
    by_depth: Float64,
) -> Float64:
    """Return the derivatives (3, 6), E axes, of the φ that an observation finds.

    Parameters
    ----------
    hand_E_m : (3,)
        Centre of the hand, in E.
    distance_m : float
        z(C0→S).
    outline_rad : float
        Standard deviation of the drawn outline, inwards or outwards.
    by_depth : (3, 2) float64
        By scale and offset of the depth (`handcal.register.prior.shift_by_depth`).
    """
    depth_m = float(hand_E_m[2])
    gain_m = depth_m / (1.0 - depth_m / distance_m)
    by_wearer = gain_m * np.diag([-1.0, -1.0, 1.0])
    by_edge = outline_rad * np.array([0.0, 1.0, -depth_m / _HALF_WIDTH_M])
    return np.column_stack([by_wearer, by_wearer @ by_edge, by_depth])
