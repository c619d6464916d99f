"""The results of a session: its alignments solved, fused and judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from handcal.core.frozen import html_table
from handcal.core.progress import Progress
from handcal.core.types import (
    EYES,
    Alignment,
    Eye,
    EyeDistance,
    EyeShift,
    Float64,
    Method,
    PlanName,
    Rig,
    Verdict,
    VerdictName,
    Verification,
    phi_text,
    shift_rows,
)
from handcal.register.benefit import Benefit, expected_arcmin, expected_error_arcmin
from handcal.register.fuse import Fused, FuseSettings, fuse_alignments
from handcal.register.prior import eye_slice
from handcal.register.solve import solve_alignment
from handcal.register.verdict import (
    MOST_ALIGNMENTS,
    Advice,
    VerdictSettings,
    Verified,
    advise,
    describe_verified,
    eye_benefit,
    eye_distance_m,
    judge,
    planned_eyes,
)

RESULTS_VERSION = 3
USED: tuple[VerdictName, ...] = ("accept", "repeat")
"""Verdicts of eyes that are drawn with the solved φ; others keep the offline calibration."""


@dataclass(frozen=True, slots=True)
class SolveSettings:
    """Settings of the solver."""

    method: Method = "consistent"
    """One of `handcal.core.types.METHODS`."""
    fuse: FuseSettings = field(default_factory=FuseSettings)
    verdict: VerdictSettings = field(default_factory=VerdictSettings)


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """Fused eye shifts of all alignments of one wearer, with verdicts.

    Attributes
    ----------
    method
        Solver of each alignment.
    alignments
        Each alignment alone, without prior, by number.
    eyes
        Fused estimates.
    verdicts
        Decision whether each eye's φ may be used, with its reason.
    eye_distance_m
        Eye distance implied by `eyes`; None unless both eyes are solved.
    measured_eye_distance
        The wearer's, as used; None if it was not measured.
    benefits
        Expected error of each eye without the calibration and with it.
    advice
        Further alignments that would lead to *accept*, for each eye with the verdict *repeat*.
    expected_after_another_arcmin
        Expected error after one more alignment with all solved eyes open.
    fused
        The observations and the prior behind `eyes`.
    verified
        The outcome of the verifications of each verified eye.
    """

    method: Method
    alignments: Mapping[int, Mapping[Eye, EyeShift]]
    eyes: Mapping[Eye, EyeShift]
    verdicts: Mapping[Eye, Verdict]
    eye_distance_m: float | None
    measured_eye_distance: EyeDistance | None
    benefits: Mapping[Eye, Benefit]
    advice: Mapping[Eye, Advice]
    expected_after_another_arcmin: Mapping[Eye, float]
    fused: Fused
    verified: Mapping[Eye, Verified] = field(default_factory=dict)

    @property
    def evidence(self) -> tuple[str, ...]:
        """Names of what in the observations speaks against the result."""
        misfit = self.fused.misfit
        return ("misfit",) if misfit is not None and misfit.ratio > 1.0 else ()

    @property
    def rendered_shift_m(self) -> Mapping[Eye, Float64]:
        """φ for the headset to render with, (3,): zero, the offline calibration, if not used.

        A result to be repeated is used, as it is expected to be better than none.
        """
        return {
            eye: shift.shift_m if self.verdicts[eye].name in USED else np.zeros(3)
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


def residuals_reach_m(results: Results) -> float:
    """Return the end of a colour scale for the residuals of all alignments, in metres.

    98 % of the residuals are smaller. The scale is the same for all alignments, so that they
    compare.
    """
    residuals_m = [
        shift.residuals_m for each in results.alignments.values() for shift in each.values()
    ]
    return float(np.nanpercentile(np.concatenate(residuals_m), 98))


def solve_session(
    alignments: Mapping[int, Alignment] | Sequence[Alignment],
    rig: Rig,
    settings: SolveSettings,
    progress: Progress = Progress(),
    eye_distance: EyeDistance | None = None,
    contradictions: Sequence[str] = (),
    verified: Mapping[Eye, Verification] = MappingProxyType({}),
    plan: PlanName | None = None,
    usable_eyes: tuple[Eye, ...] = EYES,
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
    verified : mapping of eye to Verification
        The wearer's verifications. With them, alignments may be missing.
    plan : {"paper", "recommended"}, optional
        The plan that the session follows; advice counts its next alignments.
    usable_eyes : tuple of eye
        Only one for a wearer who sees with one eye.

    Raises
    ------
    ValueError
        If there are neither alignments nor verifications, or a cloud cannot be solved.
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
    return conclude(
        [(numbered[number], shifts) for number, shifts in solved.items()],
        rig,
        settings,
        eye_distance=eye_distance,
        contradictions=contradictions,
        verified=verified,
        plan=plan,
        usable_eyes=usable_eyes,
        numbers=tuple(solved),
    )


def conclude(
    pairs: Sequence[tuple[Alignment, Mapping[Eye, EyeShift]]],
    rig: Rig,
    settings: SolveSettings,
    *,
    eye_distance: EyeDistance | None = None,
    contradictions: Sequence[str] = (),
    verified: Mapping[Eye, Verification] = MappingProxyType({}),
    plan: PlanName | None = None,
    usable_eyes: tuple[Eye, ...] = EYES,
    numbers: Sequence[int] = (),
) -> Results:
    """Fuse and judge alignments that are solved already; as `solve_session`.

    Parameters
    ----------
    pairs : sequence of (Alignment, mapping of eye to EyeShift)
        As `solve_alignment` returns them.
    numbers : sequence of int
        Numbers of the alignments in the session; from 1 if empty.
    """
    fused = fuse_alignments(pairs, rig, settings.fuse, eye_distance, verified)
    aligned = [alignment.eyes for alignment, _ in pairs]
    ahead = [] if plan is None else _upcoming(plan, aligned, usable_eyes)
    advice = {eye: advise(rig, fused, eye, settings.verdict, ahead) for eye in fused.shifts}
    checked = {
        eye: describe_verified(rig, fused, eye, verified[eye])
        for eye in EYES
        if eye in fused.verified
    }
    verdicts = judge(rig, fused, advice, settings.verdict, contradictions, checked)
    another_m2 = fused.foreseen_m2([tuple(fused.shifts)])
    return Results(
        method=settings.method,
        alignments=dict(
            zip(numbers or range(1, len(pairs) + 1), (one for _, one in pairs), strict=True)
        ),
        eyes=fused.shifts,
        verdicts=verdicts,
        eye_distance_m=eye_distance_m(rig, fused.shifts),
        measured_eye_distance=eye_distance,
        benefits={eye: eye_benefit(rig, fused, eye) for eye in fused.shifts},
        advice={eye: advice[eye] for eye in advice if verdicts[eye].name == "repeat"},
        expected_after_another_arcmin={
            eye: min(
                expected_error_arcmin(rig.eyes[eye], fused.shifts[eye]),
                expected_arcmin(
                    rig.eyes[eye], np.zeros(3), another_m2[eye_slice(eye), eye_slice(eye)]
                ),
            )
            for eye in fused.shifts
        },
        fused=fused,
        verified=checked,
    )


def _upcoming(
    plan: PlanName, done: Sequence[tuple[Eye, ...]], usable_eyes: tuple[Eye, ...]
) -> list[tuple[Eye, ...]]:
    """Return the eyes to keep open in each of a plan's next alignments."""
    eyes = list(done)
    for _ in range(MOST_ALIGNMENTS):
        eyes.append(planned_eyes(plan, eyes, usable_eyes))
    return eyes[len(done) :]


def results_json(results: Results) -> dict[str, Any]:
    """Return results as JSON-able values, metres, without rounding."""
    measured = results.measured_eye_distance
    return {
        "version": RESULTS_VERSION,
        "method": results.method,
        "eyes": {
            eye: _shift_json(shift)
            | {"verdict": results.verdicts[eye].name, "reason": results.verdicts[eye].reason}
            | _benefit_json(results.benefits[eye])
            | {"advice": _advice_json(results.advice.get(eye))}
            | _verified_json(results.verified.get(eye))
            for eye, shift in results.eyes.items()
        },
        "evidence": list(results.evidence),
        "prior_warning": results.fused.prior.warning,
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
            for one in results.fused.all_observed
        ],
        "alignments": [
            {eye: _shift_json(shift) for eye, shift in shifts.items()}
            for shifts in results.alignments.values()
        ],
    }


def read_solved_shift_m(results: Mapping[str, Any] | None) -> dict[Eye, Float64]:
    """Return φ as solved, (3,), of each eye in what `results_json` made.

    Eyes without three numbers are left out: results come from files, and None are no results.
    """
    eyes = (results or {}).get("eyes")
    shifts_m: dict[Eye, Float64] = {}
    for eye in EYES:
        values = eyes.get(eye) if isinstance(eyes, dict) else None
        if isinstance(values, dict):
            with suppress(TypeError, ValueError):
                shifts_m[eye] = np.array(values.get("shift_m"), np.float64).reshape(3)
    return shifts_m


def read_rendered_shift_m(results: Mapping[str, Any] | None) -> dict[Eye, Float64]:
    """Return φ as rendered, (3,), of each eye that `read_solved_shift_m` finds."""
    return {
        eye: shift_m if (results or {})["eyes"][eye].get("verdict") in USED else np.zeros(3)
        for eye, shift_m in read_solved_shift_m(results).items()
    }


def _benefit_json(benefit: Benefit) -> dict[str, Any]:
    values = asdict(benefit)
    depth = values.pop("depth")
    del values["by_distance"]  # follows from the covariance; journals hold many results
    return {"benefit": values, "depth": depth}


def _advice_json(advice: Advice | None) -> dict[str, Any] | None:
    return None if advice is None else asdict(advice) | {"eyes": list(advice.eyes)}


def _verified_json(verified: Verified | None) -> dict[str, Any]:
    if verified is None:
        return {}
    values = asdict(verified)
    before_after = [values.pop("before_arcmin"), values.pop("now_arcmin")]
    return {"measured_arcmin": before_after, "verification": values}


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
