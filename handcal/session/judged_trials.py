"""User-test trials against the verdict: whether an accepted eye meets the lab's target in them."""

from __future__ import annotations

from dataclasses import dataclass

from handcal.register.results import Results, read_rendered_shift_m
from handcal.session.record import SessionRecord
from handcal.session.trial import trial_errors_arcmin
from handcal.types import Eye, VerdictName


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
    """Return the trials of a session's results, of each eye that has some."""
    errors = trial_errors_arcmin(
        record.trials.values(), results.rendered_shift_m, read_rendered_shift_m(record.results)
    )
    return {
        eye: EyeTrials(len(found), sum(found) / len(found), target_arcmin)
        for eye, found in errors.items()
    }


def is_doubted(verdict: VerdictName, trials: EyeTrials | None) -> bool:
    """Return whether an accepted eye must not be ticked, as its trials are over the target."""
    return verdict == "accept" and trials is not None and trials.is_over
