"""User-test trials against the verdict: whether an accepted eye meets the lab's target in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from handcal.core.types import Eye
from handcal.register.results import Results, read_rendered_shift_m
from handcal.session.record import SessionRecord
from handcal.session.trial import trial_errors_arcmin


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


def eye_trials(
    results: Results, record: SessionRecord, target_arcmin: float
) -> dict[Eye, EyeTrials]:
    """Return the trials of a session's results, of each eye that has some.

    Stored results count, too, if they are of all alignments: another version may have solved them
    with another φ.
    """
    stored_m = read_rendered_shift_m(record.results if record.is_solved else None)
    trials = (one for one in record.trials.values() if one.eye in results.eyes)
    errors = trial_errors_arcmin(trials, results.rendered_shift_m, stored_m)
    return judge_trials(errors, target_arcmin)


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
