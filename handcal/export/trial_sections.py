"""Sections of a session's report on the wearer's judgement: user test and blinded comparison."""

from __future__ import annotations

import math
from collections.abc import Sequence

from handcal.export import figures
from handcal.export.figure_rows import running_mean_rows
from handcal.export.outcome import SessionOutcome
from handcal.export.tables import corner_rows
from handcal.report.cells import extremes, interval_ends, length_mm, mean_sd, median_quartiles
from handcal.report.document import Column, Figure, Section, Table
from handcal.report.statistics import mean_interval
from handcal.session.record import eye_trials
from handcal.session.trial import (
    Comparison,
    ErrorStatistics,
    calibration_numbers,
    count_comparisons,
    summarise_trials,
)


def user_test_section(outcome: SessionOutcome) -> Section:
    """Return the errors of all trials together, by eye and by distance."""
    record = outcome.record
    statistics = summarise_trials(record.trials.values())
    groups = {"all": statistics.total} if statistics.total else {}
    groups |= {f"{eye} eye": errors for eye, errors in statistics.by_eye.items()}
    groups |= {f"at {depth_m:g} m": errors for depth_m, errors in statistics.by_depth_m.items()}
    table = Table(
        [
            Column("trials", "left"),
            Column("number"),
            Column("corners"),
            Column("mean ± SD, px"),
            Column("mean ± SD, arcmin"),
            Column("median (quartiles), arcmin"),
            Column("min–max, arcmin"),
        ],
        [[name, *_error_cells(errors)] for name, errors in groups.items()],
        "Reprojection error; each corner of the target counts once.",
    )
    boxes = Figure(
        "trial-errors",
        "Boxes: quartiles and median; whiskers: the farthest within 1.5 interquartile ranges.",
        lambda axes: figures.draw_trial_errors(axes, record.trials.values()),
        list(corner_rows(record.trials)),
        height_mm=62.0,
        columns=2,
    )
    running = Figure(
        "running-mean",
        "Points: mean error of each trial; lines: mean of all so far.",
        lambda axes: figures.draw_running_mean(axes[0], record.trials),
        list(running_mean_rows(record.trials)),
        height_mm=48.0,
    )
    return Section("User test", [table, _interval(outcome), boxes, running])


def _interval(outcome: SessionOutcome) -> str:
    """Return sentences on the calibrations that were tried and the uncertainty of the mean."""
    trials = outcome.record.trials
    calibrations = list(calibration_numbers(trials).values())
    judged = eye_trials(outcome.results, outcome.record, math.inf) if outcome.results else {}
    former = len(trials) - sum(one.count for one in judged.values())
    said = (
        f"{former} of {len(trials)} trials judge an earlier φ than the result. " if former else ""
    )
    if len(set(calibrations)) < 2:
        return said + (
            "All trials judge one calibration, so how far another would differ is not known: no "
            "interval is given for the mean."
        )
    errors = [float(trial.error_arcmin.mean()) for trial in trials.values()]
    found = mean_interval(errors, calibrations)
    return said + (
        f"Mean over {found.clusters} calibrations of this wearer: {found.mean:.2f} arcmin "
        f"({100 * found.level:g} % interval {interval_ends(found)})."
    )


def trials_section(outcome: SessionOutcome) -> Section:
    """Return each trial with its two φ and its error."""
    record = outcome.record
    table = Table(
        [
            Column("no."),
            Column("time, UTC"),
            Column("eye", "left"),
            Column("distance, m"),
            Column("calibrated φ, mm"),
            Column("adjusted φ, mm"),
            Column("mean error, px"),
            Column("mean error, arcmin"),
        ],
        [
            [
                str(number),
                trial.time[11:19],
                trial.eye,
                f"{trial.target_depth_m:g}",
                "\u00a0\u00a0".join(map(length_mm, trial.calibrated_shift_m)),
                "\u00a0\u00a0".join(map(length_mm, trial.adjusted_shift_m)),
                f"{trial.error_px.mean():.2f}",
                f"{trial.error_arcmin.mean():.2f}",
            ]
            for number, trial in record.trials.items()
        ],
    )
    return Section("Trials", [table])


def comparisons_section(comparisons: Sequence[Comparison]) -> Section:
    """Return the answers of the blinded comparisons, and their sign test."""
    counts = count_comparisons(comparisons)
    table = Table(
        [
            Column("time, UTC"),
            Column("shown first", "left"),
            Column("answer", "left"),
            Column("better", "left"),
        ],
        [[one.time[11:19], one.first, one.answer, one.better or "neither"] for one in comparisons],
        "offline: without the calibration; applied: with it. The order was drawn by lot, and "
        "neither wearer nor technician knew it.",
    )
    sentence = (
        f"Better with the calibration: {counts.applied}; without it: {counts.offline}; neither: "
        f"{counts.neither}. Two-sided sign test of this wearer's answers: p = {counts.p_value:.3f}."
    )
    return Section("Blinded comparison", [sentence, table])


def _error_cells(errors: ErrorStatistics) -> list[str]:
    return [
        str(errors.trials),
        str(errors.corners),
        mean_sd(errors.px),
        mean_sd(errors.arcmin),
        median_quartiles(errors.arcmin),
        extremes(errors.arcmin),
    ]
