"""The priors of a wearer's eyes and of what wearers see wrongly: default, or learned.

[φ_left; φ_right] is Gaussian. By default its mean is zero, each φ lies in the eye box, and the two
eyes differ little. A lab's finished sessions with one rig show more: how far its headset sits from
the viewpoint on average, and how much wearers differ. Mean and covariance are estimated by
expectation maximisation, as every session measures φ with an error of its own, and a single
alignment with both eyes open measures three of the six numbers. The default prior takes part as
if it were `_DEFAULT_WEIGHT` sessions (an inverse Wishart prior of the covariance), so that few
sessions change little (empirical Bayes: Efron & Morris 1975; Dempster, Laird & Rubin 1977).

Nothing inside one sitting can tell an error of φ from one that the wearer always makes: an error
of φ falls with the distance of the hand, and a sitting has few distances. Many sittings tell the
size of such errors, which are Gaussian among sittings like φ and learned in the same way. People
differ more than one person's sittings do, so the interval is by resampling people (Efron &
Tibshirani 1993).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.linalg import block_diag

from handcal.core.display import view_of_eye
from handcal.core.geometry import invert, transform
from handcal.core.progress import Progress
from handcal.core.types import EYES, Eye, EyeDisplay, EyeDistance, Float64, Rig
from handcal.register.sitting import LearnedSitting, SittingPrior

FAR_M = 0.004
"""A learned prior whose mean for an eye is farther from C0 than this is not used unasked: wearers
differ by as much, their mean does not."""
MIN_SESSIONS = 10
"""Fewer sessions than this do not make a prior."""
# H (n, 6), what was seen (n,), and its covariance (n, n): a displacement, n = 3, or a distance.
# With the derivatives by the errors of a sitting beside them, H is (n, 12).
Observed: TypeAlias = tuple[Float64, Float64, Float64]

_DEFAULT_WEIGHT = 4.0
_MEAN_WEIGHT = 2.0
_ITERATIONS = 100


@dataclass(frozen=True, slots=True)
class LearnedPrior:
    """Mean and covariance of [φ_left; φ_right] among the wearers of one rig."""

    mean_m: tuple[float, ...]
    """(6,)."""
    covariance_m2: tuple[float, ...]
    """(36,); row by row."""
    sessions: int
    """Number of sessions it was learned from."""

    def __post_init__(self) -> None:
        if len(self.mean_m) != 6 or len(self.covariance_m2) != 36:
            raise ValueError("a prior has a mean of 6 numbers and a covariance of 36")
        covariance = np.reshape(self.covariance_m2, (6, 6))
        is_symmetric = np.allclose(covariance, covariance.T, rtol=1e-6, atol=1e-12)
        if not is_symmetric or np.linalg.eigvalsh(covariance)[0] <= 0.0:
            raise ValueError("the prior's covariance is not symmetric and positive definite")

    @property
    def offset_m(self) -> float:
        """The larger distance of the mean of an eye from C0."""
        return float(np.linalg.norm(np.reshape(self.mean_m, (2, 3)), axis=1).max())

    @property
    def warning(self) -> str:
        """Reason not to use it before somebody has confirmed it; empty if there is none."""
        if self.offset_m <= FAR_M:
            return ""
        return (
            f"the mean of {self.sessions} sessions lies {1e3 * self.offset_m:.1f} mm from the "
            "rig's viewpoint, which wearers do not explain: check the depth camera's edges and "
            "the rig"
        )


@dataclass(frozen=True, slots=True)
class PriorSettings:
    """The prior on φ of both eyes."""

    eye_box_sigma_m: float = 0.004
    """Standard deviation of each component of φ if nothing is known about the wearers."""
    eye_difference_sigma_m: tuple[float, float, float] = (0.0022, 0.0008, 0.0008)
    """Standard deviation of the right φ minus the left. x is the difference of the wearer's eye
    distance from the rig's: 2 mm if the headset is adjusted to the wearer; 3.6 mm among adults
    (Gordon et al. 2014, ANSUR II)."""
    learned: LearnedPrior | None = None
    """Used instead, if there is one."""
    unconfirmed: LearnedPrior | None = None
    """Learned, but not used, as nobody has confirmed it (`LearnedPrior.warning`)."""


@dataclass(frozen=True, slots=True, eq=False)
class EyePrior:
    """The prior on [φ_left; φ_right], Gaussian; errors of the sitting may follow.

    With them (`with_sitting`) it has 12 unknowns; the last six have the units of
    `handcal.register.sitting`.
    """

    mean_m: Float64
    """(6,) or (12,)."""
    covariance_m2: Float64
    """(6, 6) or (12, 12)."""
    sessions: int = 0
    """Number of sessions it was learned from; 0 for the default."""
    warning: str = ""
    """Reason why a learned prior is not used; empty if there is none."""


def eye_prior(settings: PriorSettings = PriorSettings()) -> EyePrior:
    """Return the learned prior of the settings, or else the default one."""
    learned = settings.learned
    if learned is not None:
        covariance_m2 = np.reshape(learned.covariance_m2, (6, 6))
        return EyePrior(np.array(learned.mean_m), covariance_m2, learned.sessions)
    information = np.kron(np.eye(2), np.eye(3) / settings.eye_box_sigma_m**2)
    apart = np.diag(1.0 / np.square(settings.eye_difference_sigma_m))
    information += np.kron([[1.0, -1.0], [-1.0, 1.0]], apart)
    warning = "" if settings.unconfirmed is None else settings.unconfirmed.warning
    return EyePrior(np.zeros(6), np.asarray(np.linalg.inv(information)), warning=warning)


def widened(mean_m: Float64, covariance_m2: Float64, slip_m: Sequence[float]) -> LearnedPrior:
    """Return an earlier posterior as the prior of a wearer whose headset has moved since.

    Parameters
    ----------
    mean_m, covariance_m2 : (6,), (6, 6) float64
        Of [φ_left; φ_right].
    slip_m : (3,) sequence of float
        Standard deviation of the headset's movement, common to both eyes, E axes.
    """
    moved_m2 = np.kron(np.ones((2, 2)), np.diag(np.square(slip_m)))
    wide_m2 = covariance_m2 + moved_m2
    return LearnedPrior(
        tuple(mean_m.tolist()), tuple((0.5 * (wide_m2 + wide_m2.T)).ravel().tolist()), 1
    )


def with_sitting(prior: EyePrior, sitting: SittingPrior) -> EyePrior:
    """Return the prior of the eyes and of the errors of the sitting together."""
    return EyePrior(
        np.concatenate([prior.mean_m, sitting.mean]),
        block_diag(prior.covariance_m2, sitting.covariance),
        prior.sessions,
        prior.warning,
    )


def posterior(prior: EyePrior, observed: Sequence[Observed]) -> tuple[Float64, Float64]:
    """Return mean and covariance of the prior's unknowns after observations.

    An unknown without variance stays as it is.
    """
    if not observed:
        return prior.mean_m, prior.covariance_m2
    H, seen_m, noise_m2 = stacked(observed, len(prior.mean_m))
    common_m2 = prior.covariance_m2 @ H.T
    gain = np.linalg.solve(H @ common_m2 + noise_m2, common_m2.T).T
    covariance_m2 = prior.covariance_m2 - gain @ common_m2.T
    return prior.mean_m + gain @ (seen_m - H @ prior.mean_m), 0.5 * (
        covariance_m2 + covariance_m2.T
    )


def stacked(observed: Sequence[Observed], unknowns: int) -> Observed:
    """Return several observations as one of the first unknowns; the others are taken as zero."""
    H = np.zeros((sum(len(one[1]) for one in observed), unknowns))
    row = 0
    for by, _, _ in observed:
        columns = min(unknowns, by.shape[1])
        H[row : row + len(by), :columns] = by[:, :columns]
        row += len(by)
    return (
        H,
        np.concatenate([one[1] for one in observed]),
        block_diag(*[one[2] for one in observed]),
    )


def information_of(
    observed: Sequence[Observed], kept: int, mean: Float64, covariance: Float64
) -> tuple[Float64, Float64]:
    """Return the information (K, K) and (K,) of one sitting's observations on the first unknowns.

    Parameters
    ----------
    observed : sequence of Observed
    kept : int
        Number K of unknowns.
    mean, covariance : (12 - K,), (12 - K, 12 - K) float64
        Of the other unknowns.
    """
    H, seen_m, noise_m2 = stacked(observed, 12)
    by_kept, by_others = H[:, :kept], H[:, kept:]
    noise_m2 = noise_m2 + by_others @ covariance @ by_others.T
    weighted = np.linalg.solve(noise_m2, by_kept).T
    return weighted @ by_kept, weighted @ (seen_m - by_others @ mean)


def fit_population(
    known: Sequence[tuple[Float64, Float64]],
    start: Float64,
    default: Float64,
    iterations: int,
    independent: int | None = None,
) -> tuple[Float64, Float64]:
    """Return mean (K,) and covariance (K, K) among sittings, by expectation maximisation.

    Parameters
    ----------
    known : sequence of (information, state)
        As `information_of` gives them, of each sitting.
    start, default : (K,), (K, K) float64
        Mean and covariance that take part as a few sittings.
    iterations : int
    independent : int, optional
        The first so many unknowns are independent of the others.
    """
    information, state = (np.array(parts) for parts in zip(*known, strict=True))
    mean, covariance = start, default
    for _ in range(iterations):
        common = np.linalg.inv(covariance)
        each2 = np.linalg.inv(common + information)
        each = np.einsum("nij,nj->ni", each2, common @ mean + state)
        mean = (each.sum(axis=0) + _MEAN_WEIGHT * start) / (len(known) + _MEAN_WEIGHT)
        apart = each - mean
        scatter = each2.sum(axis=0) + apart.T @ apart
        scatter += _MEAN_WEIGHT * np.outer(mean - start, mean - start)
        covariance = (_DEFAULT_WEIGHT * default + scatter) / (_DEFAULT_WEIGHT + len(known))
        if independent is not None:
            covariance[:independent, independent:] = covariance[independent:, :independent] = 0.0
    return mean, covariance


def learn_prior(
    sessions: Sequence[Sequence[Observed]],
    settings: PriorSettings = PriorSettings(),
    sitting: SittingPrior | None = None,
) -> LearnedPrior | None:
    """Learn the prior from the observations of earlier sessions, each of another wearer.

    Parameters
    ----------
    sessions : sequence of sequence of (H, seen, covariance)
        The observations of each session's alignments, as in `Fused.observed`, and of the wearer's
        eye distance, if it was measured.
    settings : PriorSettings
        Of the default prior, which takes part as a few sessions.
    sitting : SittingPrior, optional
        Of the errors that the observations of one session have in common; without it, none.

    Returns
    -------
    LearnedPrior or None
        None for fewer than `MIN_SESSIONS` sessions.
    """
    if len(sessions) < MIN_SESSIONS:
        return None
    default = eye_prior(PriorSettings(settings.eye_box_sigma_m, settings.eye_difference_sigma_m))
    others = (
        (np.zeros(6), np.zeros((6, 6))) if sitting is None else (sitting.mean, sitting.covariance)
    )
    known = [information_of(observed, 6, *others) for observed in sessions]
    mean_m, covariance_m2 = fit_population(
        known, default.mean_m, default.covariance_m2, _ITERATIONS
    )
    symmetric = 0.5 * (covariance_m2 + covariance_m2.T)
    return LearnedPrior(tuple(mean_m.tolist()), tuple(symmetric.ravel().tolist()), len(sessions))


def eye_slice(eye: Eye) -> slice:
    """Return an eye's components in [φ_left; φ_right]."""
    return slice(3 * EYES.index(eye), 3 * EYES.index(eye) + 3)


def eye_position_m(display: EyeDisplay, shift_m: Float64) -> Float64:
    """Return where an eye with φ is, (3,), in H."""
    eye_V = shift_m - display.t_C0_V_m
    return np.asarray(transform(invert(display.T_V_H), eye_V[None])[0])


def observe_eye_distance(rig: Rig, eye_distance: EyeDistance, near_m: Float64) -> Observed:
    """Return a measured eye distance as an observation of [φ_left; φ_right], linear near `near_m`.

    H is (1, 6), the distance seen (1,), and its covariance (1, 1).
    """
    left_m, right_m = (eye_position_m(rig.eyes[eye], near_m[eye_slice(eye)]) for eye in EYES)
    between_m = right_m - left_m
    distance_m = float(np.linalg.norm(between_m))
    H = np.zeros((1, 6))
    for eye, sign in zip(EYES, (-1.0, 1.0), strict=True):
        H[0, eye_slice(eye)] = sign * rig.eyes[eye].T_V_H[:3, :3] @ between_m / distance_m
    seen_m = np.array([eye_distance.value_m - distance_m]) + H @ near_m[:6]
    return H, seen_m, np.array([[eye_distance.sigma_m**2]])


def with_eye_distance(prior: EyePrior, rig: Rig, eye_distance: EyeDistance | None) -> EyePrior:
    """Return the prior with a measured eye distance, if there is one."""
    if eye_distance is None:
        return prior
    observed = observe_eye_distance(rig, eye_distance, prior.mean_m)
    return EyePrior(*posterior(prior, [observed]), prior.sessions, prior.warning)


def shift_by_depth(point_E_m: Float64, display: EyeDisplay, rig: Rig) -> Float64:
    """Return derivatives (3, 2), E axes, of φ by scale and offset of the depth of a hand."""
    T_E_D = view_of_eye(display, np.eye(4)) @ rig.T_H_D
    point_D_m = transform(invert(T_E_D), point_E_m[None])[0]
    ray_E = T_E_D[:3, :3] @ (point_D_m / point_D_m[2])
    gain = 1.0 / (1.0 - point_E_m[2] / display.z_C0_S_m)
    moved: Float64 = gain * np.outer(ray_E, [point_D_m[2], 1.0])
    return moved


MIN_SITTINGS, MIN_PEOPLE = 30, 5
"""Fewer than these do not make a prior of wearers."""
_SITTING_ITERATIONS = 200
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
    return fit_population(known, start, default, _SITTING_ITERATIONS, independent=6)


def _size(mean: Float64, covariance: Float64) -> Float64:
    return np.sqrt(np.diag(covariance) + mean**2)


def _three(values: Float64) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
