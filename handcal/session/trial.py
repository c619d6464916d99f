"""The user test: trials, what they say about a verdict, and blinded comparisons.

As in Hu et al. 2021 (user test): φ is adjusted by hand until the virtual target covers the real
one; the corners drawn with that φ are the ground truth. In a blinded comparison of the offline
calibration against the applied φ the wearer sees both in a hidden random order, and says which fits
the hand better. The order is in the journal, and only the report shows it.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from handcal.core.display import arcmin_from_px, as_shifts, eye_projection, target_corners_m
from handcal.core.frozen import freeze
from handcal.core.geometry import project
from handcal.core.types import EYES, Eye, EyeDisplay, Float64
from handcal.report import statistics
from handcal.report.statistics import Summary
from handcal.session.journal import Event

_SHAPES: dict[str, tuple[int, ...]] = {
    "corners_E_m": (4, 3),
    "calibrated_shift_m": (3,),
    "adjusted_shift_m": (3,),
    "drawn_px": (4, 2),
    "truth_px": (4, 2),
    "error_px": (4,),
    "error_arcmin": (4,),
}
_MOST = 1e9
"""Limit of a length in metres or pixels, so that no product of two overflows."""
SAME_SHIFT_M = 1e-7
"""φ solved again by another version of NumPy differs by rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """One target at one distance, seen by one eye.

    Raises
    ------
    ValueError
        For a wrong shape, a number that is not finite or beyond all lengths, or an unknown eye.
    """

    eye: Eye
    target_depth_m: float
    """Nominal distance."""
    corners_E_m: Float64
    """(4, 3); the target's corners in E, in order around it."""
    calibrated_shift_m: Float64
    adjusted_shift_m: Float64
    """(3,); calibrated φ, and φ adjusted by hand."""
    drawn_px: Float64
    truth_px: Float64
    """(4, 2); the corners drawn with the calibrated and with the adjusted φ."""
    error_px: Float64
    error_arcmin: Float64
    """(4,); their distances."""
    time: str = ""
    """Time of saving, UTC, ISO 8601; empty before."""

    def __post_init__(self) -> None:
        if self.eye not in EYES:
            raise ValueError(f"Trial.eye: left or right, not {self.eye!r}")
        for name, shape in _SHAPES.items():
            freeze(self, name, np.float64, *shape)
        for name in ("target_depth_m", *_SHAPES):
            if not (np.abs(getattr(self, name)) < _MOST).all():
                raise ValueError(f"Trial.{name}: must be finite and less than {_MOST:g}")


@dataclass(frozen=True, slots=True)
class ErrorStatistics:
    """Errors of several trials."""

    trials: int
    corners: int
    """Number of errors: each corner counts as one, as in the paper."""
    px: Summary
    arcmin: Summary


@dataclass(frozen=True, slots=True)
class TrialStatistics:
    """Error statistics of all trials, by eye and by distance."""

    total: ErrorStatistics | None
    """None without trials."""
    by_eye: Mapping[Eye, ErrorStatistics]
    by_depth_m: Mapping[float, ErrorStatistics]


def make_trial(
    display: EyeDisplay,
    eye: Eye,
    depth_m: float,
    calibrated_shift_m: ArrayLike,
    adjusted_shift_m: ArrayLike,
    corners_E_m: Float64 | None = None,
) -> Trial:
    """Return the trial of a calibrated φ against the φ adjusted by hand.

    Parameters
    ----------
    display : EyeDisplay
    eye : {"left", "right"}
    depth_m : float
        Nominal distance of the target.
    calibrated_shift_m, adjusted_shift_m : (3,) array_like
    corners_E_m : (4, 3) float64, optional
        Corners of a target that is fixed in the world; default: the target fixed to the head.

    Raises
    ------
    ValueError
        If a shift is not three finite numbers, or the target is not in front of the eye.
    """
    if not 0.0 < depth_m < np.inf:
        raise ValueError(f"a target at {depth_m:g} m is not in front of the eye")
    if corners_E_m is None:
        corners_E_m = target_corners_m(depth_m)
    drawn_px, truth_px = (
        project(eye_projection(display, shift_m), corners_E_m)
        for shift_m in (calibrated_shift_m, adjusted_shift_m)
    )
    error_px = np.linalg.norm(drawn_px - truth_px, axis=1)
    return Trial(
        eye=eye,
        target_depth_m=depth_m,
        corners_E_m=corners_E_m,
        calibrated_shift_m=np.array(calibrated_shift_m, dtype=np.float64),
        adjusted_shift_m=np.array(adjusted_shift_m, dtype=np.float64),
        drawn_px=drawn_px,
        truth_px=truth_px,
        error_px=error_px,
        error_arcmin=arcmin_from_px(display, error_px),
    )


def trial_errors_arcmin(
    trials: Iterable[Trial], *shifts_m: Mapping[Eye, Float64]
) -> dict[Eye, list[float]]:
    """Return the mean error of each trial that judges a calibration, of each eye that has some.

    Parameters
    ----------
    trials : iterable of Trial
        Those of another φ, such as of a calibration that was then repeated, are left out.
    shifts_m : mapping of Eye to (3,) float64
        The calibrated φ, as solved by this version and as stored by that of the session.
    """
    found: dict[Eye, list[float]] = {}
    for one in trials:
        calibrated_m = [shift_m[one.eye] for shift_m in shifts_m if one.eye in shift_m]
        if any(np.abs(one.calibrated_shift_m - m).max() < SAME_SHIFT_M for m in calibrated_m):
            found.setdefault(one.eye, []).append(float(one.error_arcmin.mean()))
    return found


def summarise_trials(trials: Collection[Trial]) -> TrialStatistics:
    """Return statistics of trials; JSON-able with `dataclasses.asdict`."""
    return TrialStatistics(
        total=_errors(trials) if trials else None,
        by_eye=_by(trials, "eye"),
        by_depth_m=_by(trials, "target_depth_m"),
    )


def calibration_numbers(trials: Mapping[int, Trial]) -> dict[int, int]:
    """Return the number, from 1, of the calibration that each of a session's trials judges.

    Trials with the same calibrated φ belong to one calibration. Both eyes are aligned together, so
    the first calibration of the left eye is also the first of the right, and so on.
    """
    known: dict[Eye, dict[bytes, int]] = {eye: {} for eye in EYES}
    return {
        number: known[trial.eye].setdefault(
            trial.calibrated_shift_m.tobytes(), 1 + len(known[trial.eye])
        )
        for number, trial in trials.items()
    }


@dataclass(frozen=True, slots=True)
class TrialSpread:
    """Errors of trials, each trial counting once with the mean of its corners, in arcminutes."""

    trials: int
    calibrations: int
    mean_arcmin: float
    median_arcmin: float
    max_arcmin: float
    trial_sd_arcmin: float | None
    """Standard deviation between trials; None for a single trial."""
    calibration_sd_arcmin: float | None
    """Standard deviation between the calibrations' means; None for a single calibration."""


def trial_spread(trials: Mapping[int, Trial], chosen: Collection[int]) -> TrialSpread:
    """Return the spread of some of a session's trials; ValueError if none is chosen.

    Parameters
    ----------
    trials : mapping of int to Trial
        All trials of the session, by number.
    chosen : collection of int
        Numbers of those to summarise.
    """
    calibrations = calibration_numbers(trials)
    errors = {number: float(trials[number].error_arcmin.mean()) for number in chosen}
    by_calibration: dict[int, list[float]] = {}
    for number, error in errors.items():
        by_calibration.setdefault(calibrations[number], []).append(error)
    each = statistics.summarise(list(errors.values()))
    means = statistics.summarise([float(np.mean(one)) for one in by_calibration.values()])
    return TrialSpread(
        trials=each.count,
        calibrations=means.count,
        mean_arcmin=each.mean,
        median_arcmin=each.median,
        max_arcmin=each.max,
        trial_sd_arcmin=each.sd if each.count > 1 else None,
        calibration_sd_arcmin=means.sd if means.count > 1 else None,
    )


def trial_json(trial: Trial) -> dict[str, Any]:
    """Return a trial, without its time, as JSON-able values."""
    arrays = {name: getattr(trial, name).tolist() for name in _SHAPES}
    return {"eye": trial.eye, "target_depth_m": trial.target_depth_m} | arrays


def read_trial(data: Mapping[str, Any], time: str) -> Trial:
    """Return the trial encoded by `trial_json`.

    Raises
    ------
    ValueError
        If anything is missing or invalid.
    """
    try:
        depth_m = float(data["target_depth_m"])
        arrays = {name: data[name] for name in _SHAPES}
        return Trial(eye=data["eye"], target_depth_m=depth_m, **arrays, time=time)
    except KeyError as error:
        raise ValueError(f"the trial has no {error}") from error
    except (TypeError, OverflowError) as error:
        raise ValueError(f"the trial contains something other than numbers: {error}") from error


def _by(trials: Collection[Trial], name: str) -> dict[Any, ErrorStatistics]:
    return {
        value: _errors([trial for trial in trials if getattr(trial, name) == value])
        for value in sorted({getattr(trial, name) for trial in trials})
    }


def _errors(trials: Collection[Trial]) -> ErrorStatistics:
    px = np.concatenate([trial.error_px for trial in trials])
    arcmin = np.concatenate([trial.error_arcmin for trial in trials])
    return ErrorStatistics(
        len(trials), len(px), statistics.summarise(px), statistics.summarise(arcmin)
    )


@dataclass(frozen=True, slots=True)
class EyeTrials:
    """The trials of one eye's φ, against the lab's target."""

    count: int
    mean_arcmin: float
    target_arcmin: float

    @property
    def is_over(self) -> bool:
        """True if the mean error is over the target."""
        return self.mean_arcmin > self.target_arcmin


def judge_trials(
    errors_arcmin: Mapping[Eye, Sequence[float]], target_arcmin: float
) -> dict[Eye, EyeTrials]:
    """Return the trials of each eye by their errors."""
    return {
        eye: EyeTrials(len(found), sum(found) / len(found), target_arcmin)
        for eye, found in errors_arcmin.items()
    }


def is_doubted(verdict: str, trials: EyeTrials | None) -> bool:
    """Return whether trials over the target contradict an acceptance."""
    return verdict == "accept" and trials is not None and trials.is_over


Drawing: TypeAlias = Literal["offline", "applied"]
Place: TypeAlias = Literal["first", "second"]
Answer: TypeAlias = Literal["first", "second", "neither"]
COMPARED = "compared"
"""Name of the event."""


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """One answer of the wearer."""

    first: Drawing
    """The drawing that was shown first; the other one was shown second."""
    answer: Answer
    """The one that fits better."""
    applied_shift_m: Mapping[Eye, Float64]
    """each (3,); φ of the drawing *applied*."""
    time: str = ""
    """UTC, ISO 8601; empty before it is saved."""

    @property
    def better(self) -> Drawing | None:
        """The drawing that fits better; None if neither does."""
        if self.answer == "neither":
            return None
        if self.answer == "first":
            return self.first
        return "applied" if self.first == "offline" else "offline"


@dataclass(frozen=True, slots=True)
class ComparisonCounts:
    """Answers of several comparisons."""

    applied: int
    offline: int
    neither: int
    p_value: float
    """Two-sided sign test of *applied* against *offline*; 1 without either. Answers of one wearer
    say nothing about other wearers."""


def comparison_json(comparison: Comparison) -> dict[str, Any]:
    """Return the data of the event of a comparison."""
    shifts_m = {eye: shift_m.tolist() for eye, shift_m in comparison.applied_shift_m.items()}
    return {"first": comparison.first, "answer": comparison.answer, "applied_shift_m": shifts_m}


def read_comparisons(events: Iterable[Event]) -> list[Comparison]:
    """Return the comparisons of a session's events; those that lack something are left out."""
    found = []
    for event in events:
        first: Any = event.data.get("first")
        answer: Any = event.data.get("answer")
        is_sound = first in get_args(Drawing) and answer in get_args(Answer)
        if event.name != COMPARED or not is_sound:
            continue
        with suppress(KeyError, TypeError, ValueError, AttributeError):
            shifts_m = as_shifts(event.data["applied_shift_m"])
            found.append(Comparison(first, answer, shifts_m, event.time))
    return found


def count_comparisons(comparisons: Iterable[Comparison]) -> ComparisonCounts:
    """Return how often each drawing was the better one."""
    better = [one.better for one in comparisons]
    applied, offline = better.count("applied"), better.count("offline")
    return ComparisonCounts(applied, offline, better.count(None), sign_test(applied, offline))


def sign_test(first: int, second: int) -> float:
    """Return the two-sided p-value of two counts that are equally likely by chance, exactly."""
    total = first + second
    tail = sum(math.comb(total, k) for k in range(min(first, second) + 1))
    return float(min(1.0, 2 * tail / 2**total))
