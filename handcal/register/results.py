"""From alignments to what a session reports: solved, fused and judged."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from handcal.errors import CancelledError
from handcal.register.fuse import FuseSettings, covariances_after_another, fuse_alignments
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
    """How alignments are solved."""

    method: Method = "consistent"
    """One of `handcal.types.METHODS`."""
    fuse: FuseSettings = field(default_factory=FuseSettings)
    verdict: VerdictSettings = field(default_factory=VerdictSettings)


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """Eye shifts of one wearer: each alignment alone, all of them fused, and judged."""

    method: Method
    alignments: tuple[Mapping[Eye, EyeShift], ...]
    """Each alignment alone, without prior."""
    eyes: Mapping[Eye, EyeShift]
    """Fused; what the headset shall render with."""
    verdicts: Mapping[Eye, Verdict]
    eye_distance_m: float | None
    """Implied by `eyes`; None unless both eyes are solved."""
    expected_after_another_arcmin: Mapping[Eye, float]
    """What `expected_error_arcmin` of `eyes` would become with one more alignment like those so
    far."""

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
    alignments: Sequence[Alignment],
    rig: Rig,
    settings: SolveSettings,
    report: Callable[[str, float], object] = lambda *_: None,
    is_cancelled: Callable[[], bool] = lambda: False,
) -> Results:
    """Solve, fuse and judge alignments; equal input gives equal output, bit for bit.

    Parameters
    ----------
    alignments : sequence of Alignment
    rig : Rig
    settings : SolveSettings
    report : callable
        Told before each alignment what is going on and which share of the whole is done.
    is_cancelled : callable
        Asked before each alignment, and by the slow methods before each iteration.

    Raises
    ------
    ValueError
        If there are no alignments, or a cloud cannot be solved.
    CancelledError
        If it was cancelled.
    """

    def checkpoint() -> None:
        if is_cancelled():
            raise CancelledError("solving was cancelled")

    solved = []
    for done, alignment in enumerate(alignments):
        checkpoint()
        report(f"Solving alignment {done + 1} of {len(alignments)}", done / len(alignments))
        solved.append(solve_alignment(alignment, rig, settings.method, checkpoint))
    pairs = list(zip(alignments, solved, strict=True))
    shifts = fuse_alignments(pairs, rig, settings.fuse)
    after_another_m2 = covariances_after_another(pairs, rig, settings.fuse)
    return Results(
        method=settings.method,
        alignments=tuple(solved),
        eyes=shifts,
        verdicts=judge(rig, shifts, settings.verdict),
        eye_distance_m=eye_distance_m(rig, shifts),
        expected_after_another_arcmin={
            eye: expected_error_arcmin(
                rig.eyes[eye], replace(shift, covariance_m2=after_another_m2[eye])
            )
            for eye, shift in shifts.items()
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
            for shifts in results.alignments
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
