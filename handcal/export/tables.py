"""Parameters, trials and blinded comparisons as CSV, with units in the headers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from handcal.core.types import EYES, Eye, EyeShift, Float64
from handcal.export.outcome import SessionOutcome
from handcal.io.files import write_atomic
from handcal.register.benefit import expected_error_arcmin
from handcal.register.results import Results
from handcal.report.cells import rows_csv
from handcal.session.drawn import ShiftKind, is_judged
from handcal.session.trial import Comparison, Trial, read_comparisons

_WHOSE = ("session", "wearer", "begun_utc", "simulated")
_PARAMETERS = (
    *_WHOSE,
    "source",
    "alignment",
    "eye",
    "final",
    "applied",
    "method",
    *(f"phi{axis}_mm" for axis in (1, 2, 3)),
    *(f"sigma{axis}_mm" for axis in (1, 2, 3)),
    *(f"covariance{pair}_mm2" for pair in (11, 12, 13, 22, 23, 33)),
    "rms_mm",
    "inlier_ratio",
    "iterations",
    "converged",
    "stop_reason",
    "expected_error_arcmin",
    "verdict",
    "reason",
    "target_arcmin",
    "before_arcmin",
    "probability_better",
    "depth_before_mm",
    "depth_after_mm",
    "verifications",
    "verified",
    "verification_found_arcmin",
    "trials",
    "trials_mean_arcmin",
    "trials_over_target",
    "eyes_open",
    "rotation_deg",
    *(f"drawn_phi{axis}_mm" for axis in (1, 2, 3)),
)
_TRIALS = (
    *_WHOSE,
    "trial",
    "time_utc",
    "eye",
    "target_depth_m",
    *(f"calibrated_phi{axis}_mm" for axis in (1, 2, 3)),
    *(f"adjusted_phi{axis}_mm" for axis in (1, 2, 3)),
    "corner",
    *(f"corner_{axis}_m" for axis in "xyz"),
    "drawn_x_px",
    "drawn_y_px",
    "truth_x_px",
    "truth_y_px",
    "error_px",
    "error_arcmin",
)
_COMPARISONS = (
    *_WHOSE,
    "comparison",
    "time_utc",
    "first",
    "answer",
    "better",
    *(f"{eye}_phi{axis}_mm" for eye in EYES for axis in (1, 2, 3)),
)


_COLUMNS: Mapping[str, tuple[str, ...]] = {
    "parameters.csv": _PARAMETERS,
    "trials.csv": _TRIALS,
    "comparisons.csv": _COMPARISONS,
}
TableRow: TypeAlias = Mapping[str, Any]


def table_rows(outcome: SessionOutcome) -> dict[str, list[TableRow]]:
    """Return the rows of each table of a session, by its file; columns: docs/export.md."""
    record = outcome.record
    whose = {
        "session": outcome.name,
        "wearer": record.wearer,
        "begun_utc": outcome.started,
        "simulated": record.simulated,
    }
    tables = {
        "parameters.csv": parameter_rows(outcome),
        "trials.csv": corner_rows(record.trials),
        "comparisons.csv": _comparison_rows(read_comparisons(record.events)),
    }
    return {name: [{**whose, **row} for row in rows] for name, rows in tables.items()}


def write_tables(folder: Path, tables: Mapping[str, Iterable[TableRow]]) -> None:
    """Write the tables of one session or several, as `table_rows` gives them.

    Blinded comparisons are written only if there are any. FileError if a file cannot be written.
    """
    for name, columns in _COLUMNS.items():
        rows = list(tables[name])
        if rows or name != "comparisons.csv":
            write_atomic(folder / name, rows_csv(rows, columns))


def parameter_rows(outcome: SessionOutcome) -> Iterator[dict[str, Any]]:
    """Yield a row for each eye of each alignment, and one for each known φ of each eye.

    Exactly one row of each eye is final.
    """
    record, results = outcome.record, outcome.results
    if results is not None:
        for number, shifts in results.alignments.items():
            alignment = record.alignments[number]
            for eye, shift in shifts.items():
                yield {
                    "source": "alignment",
                    "alignment": number,
                    "eye": eye,
                    **_solved(outcome, shift),
                    "expected_error_arcmin": expected_error_arcmin(record.rig.eyes[eye], shift),
                    "eyes_open": " ".join(alignment.eyes),
                    "rotation_deg": float(np.degrees(np.linalg.norm(alignment.rotation_rad))),
                    **_triple("drawn_phi{}_mm", 1e3 * alignment.drawn_shift_m[eye]),
                }
    for eye in EYES:
        for kind, shift_m in outcome.shifts_m[eye].items():
            yield {
                "source": kind,
                "eye": eye,
                "final": _yes(kind == outcome.drawn[eye].kind),
                "applied": _yes(outcome.is_applied(eye, kind)),
                **_triple("phi{}_mm", 1e3 * shift_m),
                **(_solved(outcome, results.eyes[eye]) if results and kind == "solved" else {}),
                "expected_error_arcmin": outcome.expected_arcmin(eye, kind),
                **(_judged(outcome, results, eye, kind) if results and eye in results.eyes else {}),
            }


def _judged(outcome: SessionOutcome, results: Results, eye: Eye, kind: ShiftKind) -> dict[str, Any]:
    """Return what is known of an eye, in the rows of its solved and its final φ.

    The verdict is only in the row of a φ that it is about.
    """
    is_final = kind == outcome.drawn[eye].kind
    if not (is_final or kind == "solved"):
        return {}
    verdict, benefit = results.verdicts[eye], results.benefits[eye]
    verification = outcome.record.facts.verified.get(eye)
    verified, trials = results.verified.get(eye), outcome.trials.get(eye)
    judged = {
        "verdict": verdict.name,
        "reason": verdict.reason,
        "probability_better": benefit.probability_better,
        "depth_after_mm": 1e3 * benefit.depth.after_m,
    }
    return {
        **(judged if is_judged(verdict.name, kind) else {}),
        "target_arcmin": outcome.settings.verdict.target_arcmin,
        "before_arcmin": benefit.without_arcmin,
        "depth_before_mm": 1e3 * benefit.depth.without_m,
        "verifications": 1 + len(verification.earlier) if verification else 0,
        "verified": _yes(is_final and outcome.is_verified(eye)),
        "verification_found_arcmin": verified.before_arcmin if verified else None,
        "trials": trials.count if trials else 0,
        "trials_mean_arcmin": trials.mean_arcmin if trials else None,
        "trials_over_target": _yes(trials.is_over) if trials else None,
    }


def _solved(outcome: SessionOutcome, shift: EyeShift) -> dict[str, Any]:
    covariance_mm2 = 1e6 * shift.covariance_m2
    return {
        "method": outcome.settings.method,
        **_triple("phi{}_mm", 1e3 * shift.shift_m),
        **_triple("sigma{}_mm", np.sqrt(np.diag(covariance_mm2))),
        **{
            f"covariance{row + 1}{column + 1}_mm2": float(covariance_mm2[row, column])
            for row, column in zip(*np.triu_indices(3), strict=True)
        },
        **_registered(shift),
    }


def _registered(shift: EyeShift) -> dict[str, Any]:
    if not shift.residuals_m.size:
        return {}  # of verifications alone
    return {
        "rms_mm": 1e3 * shift.rms_m,
        "inlier_ratio": shift.inlier_ratio,
        "iterations": shift.iterations,
        "converged": _yes(shift.converged),
        "stop_reason": shift.stop_reason,
    }


def _comparison_rows(comparisons: Sequence[Comparison]) -> Iterator[dict[str, Any]]:
    for number, comparison in enumerate(comparisons, 1):
        yield {
            "comparison": number,
            "time_utc": comparison.time,
            "first": comparison.first,
            "answer": comparison.answer,
            "better": comparison.better or "neither",
            **{
                name: value
                for eye, shift_m in comparison.applied_shift_m.items()
                for name, value in _triple(f"{eye}_phi{{}}_mm", 1e3 * shift_m).items()
            },
        }


def corner_rows(trials: Mapping[int, Trial]) -> Iterator[dict[str, Any]]:
    """Yield a row for every corner of every trial."""
    for number, trial in trials.items():
        for corner in range(len(trial.corners_E_m)):
            x_m, y_m, z_m = map(float, trial.corners_E_m[corner])
            yield {
                "trial": number,
                "time_utc": trial.time,
                "eye": trial.eye,
                "target_depth_m": trial.target_depth_m,
                **_triple("calibrated_phi{}_mm", 1e3 * trial.calibrated_shift_m),
                **_triple("adjusted_phi{}_mm", 1e3 * trial.adjusted_shift_m),
                "corner": corner + 1,
                "corner_x_m": x_m,
                "corner_y_m": y_m,
                "corner_z_m": z_m,
                "drawn_x_px": float(trial.drawn_px[corner, 0]),
                "drawn_y_px": float(trial.drawn_px[corner, 1]),
                "truth_x_px": float(trial.truth_px[corner, 0]),
                "truth_y_px": float(trial.truth_px[corner, 1]),
                "error_px": float(trial.error_px[corner]),
                "error_arcmin": float(trial.error_arcmin[corner]),
            }


def _triple(name: str, values: Float64) -> dict[str, float]:
    return {name.format(number): float(value) for number, value in enumerate(values, 1)}


def _yes(truth: bool) -> str:
    return "yes" if truth else "no"
