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
from handcal.register.prior import Observed, PriorSettings, eye_prior, stacked
from handcal.register.sitting import LearnedSitting, SittingPrior

MIN_SITTINGS, MIN_PEOPLE = 30, 5
"""Fewer than these do not make a prior of wearers."""
_DEFAULT_WEIGHT = 4.0
_MEAN_WEIGHT = 2.0
_ITERATIONS = 200
_RESAMPLED = 40
_EYES, _WEARER = slice(0, 6), slice(6, 9)


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


def learn_wearers(
    people: Sequence[Sequence[Sequence[Observed]]],
    sitting: SittingPrior,
    progress: Progress = Progress(),
) -> LearnedWearers | None:
    """Learn the prior from repeated sittings of several people.

    Parameters
    ----------
    people : sequence of sequence of sequence of (H, seen, covariance)
        The observations of each sitting of each person, as `Fused.all_observed` has them.
    sitting : SittingPrior
        The default prior, which takes part as a few sittings.
    progress : Progress

    Returns
    -------
    LearnedWearers or None
        None for fewer than `MIN_SITTINGS` sittings or `MIN_PEOPLE` people.

    Raises
    ------
    CancelledError
        If it was cancelled.
    """
    count = sum(map(len, people))
    if count < MIN_SITTINGS or len(people) < MIN_PEOPLE:
        return None
    known = [[_information(observed, sitting) for observed in person] for person in people]
    mean, covariance = _fit([one for person in known for one in person], sitting)
    rng = np.random.default_rng(0)
    sizes = []
    for done in range(_RESAMPLED):
        progress.at(done / _RESAMPLED, "Learning what wearers see wrongly")
        drawn = rng.integers(len(known), size=len(known))
        sizes.append(_size(*_fit([one for k in drawn for one in known[k]], sitting)))
    low, high = np.quantile(sizes, [0.025, 0.975], axis=0)
    learned = LearnedSitting(
        tuple(mean[_WEARER].tolist()), tuple(covariance[_WEARER, _WEARER].ravel().tolist()), count
    )
    return LearnedWearers(
        learned, len(people), _three(_size(mean, covariance)), _three(low), _three(high)
    )


def _information(observed: Sequence[Observed], sitting: SittingPrior) -> tuple[Float64, Float64]:
    """Return what a sitting says on φ of both eyes and the wearer's errors: (9, 9) and (9,)."""
    H, seen_m, noise_m2 = stacked(observed, 12)
    H, by_camera = H[:, :9], H[:, 9:]
    noise_m2 = noise_m2 + by_camera @ sitting.covariance[3:, 3:] @ by_camera.T
    weighted = np.linalg.solve(noise_m2, H).T
    return weighted @ H, weighted @ (seen_m - by_camera @ sitting.mean[3:])


def _fit(
    known: Sequence[tuple[Float64, Float64]], sitting: SittingPrior
) -> tuple[Float64, Float64]:
    """Return mean (9,) and covariance (9, 9), in which eyes and wearer are independent."""
    information, state = (np.array(parts) for parts in zip(*known, strict=True))
    default = block_diag(eye_prior(PriorSettings()).covariance_m2, sitting.covariance[:3, :3])
    start = np.concatenate([np.zeros(6), sitting.mean[:3]])
    mean, covariance = start, default
    for _ in range(_ITERATIONS):
        common = np.linalg.inv(covariance)
        each2 = np.linalg.inv(common + information)
        each = np.einsum("nij,nj->ni", each2, common @ mean + state)
        mean = (each.sum(axis=0) + _MEAN_WEIGHT * start) / (len(known) + _MEAN_WEIGHT)
        apart = each - mean
        scatter = each2.sum(axis=0) + apart.T @ apart
        scatter += _MEAN_WEIGHT * np.outer(mean - start, mean - start)
        full = (_DEFAULT_WEIGHT * default + scatter) / (_DEFAULT_WEIGHT + len(known))
        covariance = block_diag(full[_EYES, _EYES], full[_WEARER, _WEARER])
    return mean, covariance


def _size(mean: Float64, covariance: Float64) -> Float64:
    return np.sqrt(np.diag(covariance)[_WEARER] + mean[_WEARER] ** 2)


def _three(values: Float64) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
