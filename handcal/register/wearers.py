"""The prior of what wearers see wrongly in a whole sitting, learned from a lab's sittings.

Nothing inside one sitting can tell an error of φ from one that the wearer always makes: an error
of φ falls with the distance of the hand, and a sitting has few distances. Many sittings tell the
size of such errors. φ of both eyes and the wearer's three errors are Gaussian among sittings; their
means and covariances are estimated by expectation maximisation (Dempster, Laird & Rubin 1977), with
the default priors in it as a few sittings. People differ more than one person's sittings do, so the
interval is by resampling people (Efron & Tibshirani 1993).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from handcal.core.progress import Progress
from handcal.core.types import Float64
from handcal.register.prior import (
    Observed,
    PriorSettings,
    eye_prior,
    fit_population,
    information_of,
)
from handcal.register.sitting import LearnedSitting, SittingPrior

MIN_SITTINGS, MIN_PEOPLE = 30, 5
"""Fewer than these do not make a prior of wearers."""
_ITERATIONS = 200
_RESAMPLED = 40
_WEARER = slice(6, 9)


@dataclass(frozen=True, slots=True)
class LearnedWearers:
    """The prior of what wearers see wrongly, with its interval."""

    learned: LearnedSitting
    people: int
    sigma: tuple[float, float, float]
    """Right and down, rad, and relative size: root mean square about zero."""
    sigma_low: tuple[float, float, float]
    sigma_high: tuple[float, float, float]
    """Its 95 % interval over people."""


def fit_wearers(
    people: Sequence[Sequence[Sequence[Observed]]], sitting: SittingPrior
) -> LearnedSitting | None:
    """Learn the prior from repeated sittings of several people.

    Parameters
    ----------
    people : sequence of sequence of sequence of (H, seen, covariance)
        The observations of each sitting of each person, as `Fused.all_observed` has them.
    sitting : SittingPrior
        The default prior, which takes part as a few sittings.

    Returns
    -------
    LearnedSitting or None
        None for fewer than `MIN_SITTINGS` sittings or `MIN_PEOPLE` people.
    """
    count = sum(map(len, people))
    if count < MIN_SITTINGS or len(people) < MIN_PEOPLE:
        return None
    known = [_information(observed, sitting) for person in people for observed in person]
    mean, covariance = _fit(known, sitting)
    return LearnedSitting(
        tuple(mean[_WEARER].tolist()), tuple(covariance[_WEARER, _WEARER].ravel().tolist()), count
    )


def learn_wearers(
    people: Sequence[Sequence[Sequence[Observed]]],
    sitting: SittingPrior,
    progress: Progress = Progress(),
) -> LearnedWearers | None:
    """Learn the prior as `fit_wearers` does, with its interval, which takes 40 times as long.

    Raises
    ------
    CancelledError
        If it was cancelled.
    """
    learned = fit_wearers(people, sitting)
    if learned is None:
        return None
    known = [[_information(observed, sitting) for observed in person] for person in people]
    rng = np.random.default_rng(0)
    sizes = []
    for done in range(_RESAMPLED):
        progress.at(done / _RESAMPLED, "Learning what wearers see wrongly")
        drawn = rng.integers(len(known), size=len(known))
        mean, covariance = _fit([one for k in drawn for one in known[k]], sitting)
        sizes.append(_size(mean[_WEARER], covariance[_WEARER, _WEARER]))
    low, high = np.quantile(sizes, [0.025, 0.975], axis=0)
    size = _size(np.array(learned.mean), np.reshape(learned.covariance, (3, 3)))
    return LearnedWearers(learned, len(people), _three(size), _three(low), _three(high))


def _information(observed: Sequence[Observed], sitting: SittingPrior) -> tuple[Float64, Float64]:
    """Return what a sitting says on φ of both eyes and the wearer's errors: (9, 9) and (9,)."""
    return information_of(observed, 9, sitting.mean[3:], sitting.covariance[3:, 3:])


def _fit(
    known: Sequence[tuple[Float64, Float64]], sitting: SittingPrior
) -> tuple[Float64, Float64]:
    """Return mean (9,) and covariance (9, 9), in which eyes and wearer are independent."""
    default = block_diag(eye_prior(PriorSettings()).covariance_m2, sitting.covariance[:3, :3])
    start = np.concatenate([np.zeros(6), sitting.mean[:3]])
    return fit_population(known, start, default, _ITERATIONS, independent=6)


def _size(mean: Float64, covariance: Float64) -> Float64:
    return np.sqrt(np.diag(covariance) + mean**2)


def _three(values: Float64) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
