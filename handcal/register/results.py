"""The results of a session: its alignments solved, fused and judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from handcal.progress import Progress
from handcal.register.fuse import FuseSettings, fuse_alignments
from handcal.register.solve import solve_alignment
from handcal.register.verdict import (
    VerdictSettings,
    expected_error_arcmin,
    eye_distance_m,
    judge,
)
from handcal.types import (
    Alignment,
    Eye,
    EyeShift,
    Method,
    Rig,
    Verdict,
    html_table,
    phi_text,
    shift_rows,
)

RESULTS_VERSION = 1


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
    """Fused estimates, for the headset to render with."""
    verdicts: Mapping[Eye, Verdict]
    eye_distance_m: float | None
    """Eye distance implied by `eyes`; None unless both eyes are solved."""
    expected_after_another_arcmin: Mapping[Eye, float]
    """`expected_error_arcmin` of `eyes` after one more alignment like those so far."""

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
    fused = fuse_alignments(pairs, rig, settings.fuse)
    return Results(
        method=settings.method,
        alignments=solved,
        eyes=fused.shifts,
        verdicts=judge(rig, fused.shifts, settings.verdict),
        eye_distance_m=eye_distance_m(rig, fused.shifts),
        expected_after_another_arcmin={
            eye: expected_error_arcmin(
                rig.eyes[eye],
                replace(shift, covariance_m2=fused.covariances_after_another_m2[eye]),
            )
            for eye, shift in fused.shifts.items()
        },
    )


def results_json(results: Results) -> dict[str, Any]:
    """Return results as JSON-able values, metres, without rounding."""
    return {
        "version": RESULTS_VERSION,
        "method": results.method,
        "eyes": {
            eye: _shift_json(shift)
            | {"verdict": results.verdicts[eye].name, "reason": results.verdicts[eye].reason}
            for eye, shift in results.eyes.items()
        },
        "eye_distance_m": results.eye_distance_m,
        "alignments": [
            {eye: _shift_json(shift) for eye, shift in shifts.items()}
            for shifts in results.alignments.values()
        ],
    }


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
