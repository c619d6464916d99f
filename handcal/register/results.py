"""The results of a session: its alignments solved, fused and judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from handcal.progress import Progress
from handcal.register.benefit import Benefit, expected_arcmin
from handcal.register.fuse import Fused, FuseSettings, eye_slice, fuse_alignments
from handcal.register.solve import solve_alignment
from handcal.register.verdict import (
    Advice,
    VerdictSettings,
    advise,
    eye_benefit,
    eye_distance_m,
    judge,
)
from handcal.types import (
    Alignment,
    Eye,
    EyeDistance,
    EyeShift,
    Float64,
    Method,
    Rig,
    Verdict,
    html_table,
    phi_text,
    shift_rows,
)

RESULTS_VERSION = 2


@dataclass(frozen=True, slots=True)
class SolveSettings:
    """Settings of the solver."""

    method: Method = "consistent"
    """One of `handcal.types.METHODS`."""
    fuse: FuseSettings = field(default_factory=FuseSettings)
    verdict: VerdictSettings = field(default_factory=VerdictSettings)


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """Fused eye shifts of all alignments of one wearer, with verdicts."""

    method: Method
    alignments: Mapping[int, Mapping[Eye, EyeShift]]
    """Each alignment alone, without prior, by number."""
    eyes: Mapping[Eye, EyeShift]
    """Fused estimates."""
    verdicts: Mapping[Eye, Verdict]
    eye_distance_m: float | None
    """Eye distance implied by `eyes`; None unless both eyes are solved."""
    measured_eye_distance: EyeDistance | None
    """The wearer's, as used; None if it was not measured."""
    benefits: Mapping[Eye, Benefit]
    """Expected error of each eye without the calibration and with it."""
    advice: Mapping[Eye, Advice]
    """Further alignments that would lead to *accept*, for each eye with the verdict *repeat*."""
    expected_after_another_arcmin: Mapping[Eye, float]
    """Expected error after one more alignment with all solved eyes open."""
    fused: Fused
    """The observations and the prior behind `eyes`."""

    @property
    def rendered_shift_m(self) -> Mapping[Eye, Float64]:
        """φ for the headset to render with, (3,): zero where the offline calibration is kept."""
        return {
            eye: np.zeros(3) if self.verdicts[eye].name == "keep" else shift.shift_m
            for eye, shift in self.eyes.items()
        }

    def __str__(self) -> str:
        solved = (
            f"{eye} {phi_text(shift)}, {self.verdicts[eye].name}"
            for eye, shift in self.eyes.items()
        )
        return f"{self._summary()}: {'; '.join(solved)}"

    def __repr__(self) -> str:
        return f"<Results {self}>"

    def _repr_html_(self) -> str:
        verdicts = self.verdicts.values()
        return html_table(
            [
                [self._summary(), *self.eyes],
                *shift_rows(list(self.eyes.values())),
                ["verdict", *(verdict.name for verdict in verdicts)],
                ["", *(verdict.reason for verdict in verdicts)],
            ]
        )

    def _summary(self) -> str:
        count = len(self.alignments)
        return f"{self.method}, {count} alignment{'s' * (count != 1)}"


def solve_session(
    alignments: Mapping[int, Alignment] | Sequence[Alignment],
    rig: Rig,
    settings: SolveSettings,
    progress: Progress = Progress(),
    eye_distance: EyeDistance | None = None,
    contradictions: Sequence[str] = (),
) -> Results:
    """Solve, fuse and judge alignments; equal input gives identical output, bit for bit.

    Parameters
    ----------
    alignments : mapping of int to Alignment, or sequence of Alignment
        By number; those of a sequence are numbered from 1.
    rig : Rig
    settings : SolveSettings
    progress : Progress
        Reported to before each alignment; the slow methods can be cancelled before each iteration.
    eye_distance : EyeDistance, optional
        The wearer's, if it was measured.
    contradictions : sequence of str
        Evidence from outside the solver against the result, a sentence each.

    Raises
    ------
    ValueError
        If there are no alignments, or a cloud cannot be solved.
    CancelledError
        If it was cancelled.
    """
    numbered = (
        alignments if isinstance(alignments, Mapping) else dict(enumerate(alignments, start=1))
    )
    solved = {}
    for done, (number, alignment) in enumerate(numbered.items()):
        progress.at(done / len(alignments), f"Solving alignment {done + 1} of {len(alignments)}")
        solved[number] = solve_alignment(alignment, rig, settings.method, progress.check)
    pairs = [(numbered[number], shifts) for number, shifts in solved.items()]
    fused = fuse_alignments(pairs, rig, settings.fuse, eye_distance)
    advice = {eye: advise(rig, fused, eye, settings.verdict) for eye in fused.shifts}
    verdicts = judge(rig, fused, advice, settings.verdict, contradictions)
    another_m2 = fused.covariance_after_m2(tuple(fused.shifts), 1)
    return Results(
        method=settings.method,
        alignments=solved,
        eyes=fused.shifts,
        verdicts=verdicts,
        eye_distance_m=eye_distance_m(rig, fused.shifts),
        measured_eye_distance=eye_distance,
        benefits={eye: eye_benefit(rig, fused, eye) for eye in fused.shifts},
        advice={eye: advice[eye] for eye in advice if verdicts[eye].name == "repeat"},
        expected_after_another_arcmin={
            eye: expected_arcmin(
                rig.eyes[eye], np.zeros(3), another_m2[eye_slice(eye), eye_slice(eye)]
            )
            for eye in fused.shifts
        },
        fused=fused,
    )


def results_json(results: Results) -> dict[str, Any]:
    """Return results as JSON-able values, metres, without rounding."""
    measured = results.measured_eye_distance
    return {
        "version": RESULTS_VERSION,
        "method": results.method,
        "eyes": {
            eye: _shift_json(shift)
            | {"verdict": results.verdicts[eye].name, "reason": results.verdicts[eye].reason}
            | {"benefit": asdict(results.benefits[eye])}
            | {"advice": _advice_json(results.advice.get(eye))}
            for eye, shift in results.eyes.items()
        },
        "eye_distance_m": results.eye_distance_m,
        "measured_eye_distance": None if measured is None else asdict(measured),
        "observed": [
            dict(
                zip(
                    ("H", "seen_m", "covariance_m2"),
                    (part.tolist() for part in one.at(results.fused.wearer_scale)),
                    strict=True,
                )
            )
            for one in results.fused.observed
        ],
        "alignments": [
            {eye: _shift_json(shift) for eye, shift in shifts.items()}
            for shifts in results.alignments.values()
        ],
    }


def _advice_json(advice: Advice | None) -> dict[str, Any] | None:
    return None if advice is None else asdict(advice) | {"eyes": list(advice.eyes)}


def _shift_json(shift: EyeShift) -> dict[str, Any]:
    return {
        "shift_m": shift.shift_m.tolist(),
        "covariance_m2": shift.covariance_m2.tolist(),
        "rms_m": shift.rms_m,
        "inlier_ratio": shift.inlier_ratio,
        "iterations": shift.iterations,
        "converged": shift.converged,
        "stop_reason": shift.stop_reason,
    }
