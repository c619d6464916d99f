"""Parameters, trials and blinded comparisons as CSV, with units in the headers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from handcal.core.types import EYES, Eye, EyeShift, Float64
from handcal.export.outcome import SessionOutcome, ShiftOrigin
from handcal.io.files import write_atomic
from handcal.register.benefit import expected_error_arcmin
from handcal.report.rows import rows_csv
from handcal.session.comparison import Comparison, read_comparisons
from handcal.session.trial import Trial

_WHOSE = ("session", "wearer")
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


def write_parameters(path: Path, outcome: SessionOutcome) -> None:
    """Write each eye's φ: a row for every alignment, the fused φ and the one set by hand.

    Columns: docs/export.md.
    """
    _write(path, _PARAMETERS, outcome, parameter_rows(outcome))


def write_trials(path: Path, outcome: SessionOutcome) -> None:
    """Write the user test: a row for every corner of every trial; columns: docs/export.md."""
    _write(path, _TRIALS, outcome, corner_rows(outcome.record.trials))


def parameter_rows(outcome: SessionOutcome) -> Iterator[dict[str, Any]]:
    """Yield a row for every φ of each eye."""
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
        for eye, shift in results.eyes.items():
            verdict = results.verdicts[eye]
            yield {
                "source": "fused",
                **_place(outcome, eye, "solved"),
                **_solved(outcome, shift),
                "expected_error_arcmin": results.benefits[eye].after_arcmin,
                "verdict": verdict.name,
                "reason": verdict.reason,
            }
    for eye in EYES:
        if "fine_tuned" in outcome.shifts_m[eye]:
            yield {
                "source": "fine-tuned",
                **_place(outcome, eye, "fine_tuned"),
                **_triple("phi{}_mm", 1e3 * outcome.shifts_m[eye]["fine_tuned"]),
            }


def _place(outcome: SessionOutcome, eye: Eye, origin: ShiftOrigin) -> dict[str, Any]:
    return {
        "eye": eye,
        "final": _yes(outcome.final(eye) == origin),
        "applied": _yes(outcome.is_applied(eye, origin)),
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


def write_comparisons(path: Path, outcome: SessionOutcome) -> None:
    """Write the blinded comparisons, if there are any; FileError if they cannot be written."""
    comparisons = read_comparisons(outcome.record.events)
    if comparisons:
        _write(path, _COMPARISONS, outcome, _comparison_rows(comparisons))


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


def _write(
    path: Path, columns: tuple[str, ...], outcome: SessionOutcome, rows: Iterable[Mapping[str, Any]]
) -> None:
    whose = {"session": outcome.name, "wearer": outcome.record.wearer}
    write_atomic(path, rows_csv(({**whose, **row} for row in rows), columns))
