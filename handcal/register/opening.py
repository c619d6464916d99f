"""Opening of the hand between the cursor and the hand: a uniform change of its size.

A wearer covers the outline of a hand that has opened by 1 % by holding it 1 % farther away, so that
φ3 moves by 1 % of the distance. But both clouds are metric: their sizes differ. So the size is
measured like the motion, by one more unknown of the registration's rows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from handcal.core.types import Float64
from handcal.register.rigid import (
    Patches,
    RigidResult,
    RigidSettings,
    Rows,
    moved_about,
    registration_rows,
    solve_rows,
)
from handcal.register.surface import Surface, mean_point

# Edges grow fat, and the thinner of two clouds has the narrower outline; standard deviation of the
# difference. Both sides of a finger tell it from a change of size.
_FAT_SIGMA_M = 0.0005
# Pairs slide, as in a step of the registration: this share is left after one.
_LEFT_AFTER_STEP = 0.2
# Rows that count as one independent measurement of noise.
_ROWS_PER_PAIR = 7.0
# While a step changes the size by more than this many standard deviations, pairs are searched again
# on a hand of that size; at most so many times.
_LARGE_AT_FIRST, _LARGE, _STEPS = 2.0, 0.5, 4
# Probability that a hand has opened or closed, and by how much, standard deviation. Assumptions.
_OPEN, _USUAL = 0.3, 0.015
# Least standard deviation: differences of two frames' depth scale and edges. And for each metre of
# the change of shape, as bent fingers look shorter, 1 over some 0.08 m of hand.
_LEAST_SIGMA = 0.0025
_PER_SHAPE_M = 12.0


class Opening(NamedTuple):
    """Change of the hand's size from the source to the target."""

    log_size: float
    """Natural logarithm of the target's size over the source's."""
    sigma: float
    """Its standard deviation, of noise and samples."""
    T_target_source: Float64
    """(4, 4); the similarity that takes the source to the target."""

    def known(self, shape_rms_m: float) -> tuple[float, float]:
        """Return the share of the change to expect, 0 to 1, and σ of what is left of it.

        Most hands do not open at all, so a change that noise may explain is little believed.

        Parameters
        ----------
        shape_rms_m : float
            Another change of shape, rms.
        """
        noise = self.sigma**2 + _LEAST_SIGMA**2 + (_PER_SHAPE_M * shape_rms_m) ** 2
        kept = 1.0 / (1.0 + noise / _USUAL**2)
        fit = 0.5 * self.log_size**2 * kept / noise
        odds = _OPEN / (1.0 - _OPEN) * np.sqrt(1.0 - kept) * np.exp(min(fit, 50.0))
        believed = float(odds / (1.0 + odds))
        expected = kept * self.log_size
        left = believed * (kept * noise + (1.0 - believed) * expected**2)
        return believed * kept, float(np.sqrt(left))


def measure_opening(
    source: Surface, target: Surface, fit: RigidResult, settings: RigidSettings, patches: Patches
) -> Opening:
    """Measure the change of size between registered hands.

    Parameters
    ----------
    source, target : Surface
    fit : RigidResult
        From `register_rigid`, of the source to the target.
    settings : RigidSettings
        Of the search for pairs.
    patches : Patches
        Of the source's points.
    """
    middle_m = mean_point(source.points_m)
    rows, T, log_size = fit.rows, fit.T_target_source, 0.0
    grown_m = source.points_m
    for step in range(_STEPS):
        if step:
            rows = registration_rows(source, target, T, settings, grown_m)
        x, sigma = _solve(rows, patches)
        log_size += float(x[6]) / (1.0 - _LEFT_AFTER_STEP)
        grown_m = middle_m + np.exp(log_size) * (source.points_m - middle_m)
        T = moved_about(rows.centre_m, x[:6]) @ T
        if abs(x[6]) < (_LARGE if step else _LARGE_AT_FIRST) * sigma:
            break
    growth = np.eye(4)
    growth[:3, :3] *= np.exp(log_size)
    growth[:3, 3] = middle_m - growth[:3, :3] @ middle_m
    return Opening(log_size, sigma, T @ growth)


def _solve(rows: Rows, patches: Patches) -> tuple[Float64, float]:
    """Return the motion and the logarithm of the change of size, (7,), and σ of the latter."""
    # At the middle of a pair, as the noise of its source would multiply itself.
    at_m = rows.at_m - rows.centre_m
    along_m = np.einsum("nd,nd->n", at_m, rows.toward) - 0.5 * rows.gap_m
    is_outline = np.zeros(len(along_m))
    is_outline[: rows.outlines] = 1.0
    jacobian = np.vstack([rows.jacobian, along_m, is_outline])
    variance_m2 = float(rows.weight @ rows.gap_m**2 / rows.weight.sum())
    prior = np.zeros(8)
    prior[7] = _ROWS_PER_PAIR * variance_m2 / _FAT_SIGMA_M**2
    solution, covariance = solve_rows(rows, jacobian, patches, prior)
    return solution[:7], float(np.sqrt(covariance[6, 6]))
