"""Clouds as from a sensor: cut at different places, sampled independently, noisy."""

from __future__ import annotations

import numpy as np

from handcal.core.progress import Progress
from handcal.lab.bench.figure import BenchFigure
from handcal.lab.bench.settings import BenchSettings
from handcal.lab.bench.trials import (
    Errors,
    Measured,
    collect_errors,
    mean_length_mm,
    measured_alignment,
    run_trials,
)
from handcal.lab.study.trials import floor_error_m, solve_trial

_CUT_SIGMA_M = 0.0015
_SIGMA_M = 0.0005, 0.002
_ANGLE_MAX_DEG = 9.0


def measure_cuts(settings: BenchSettings, progress: Progress) -> Measured:
    """Compare ``consistent`` on differently cut clouds with the floor."""

    def solve(angle_deg: float, trial: int) -> Errors:
        rng = np.random.default_rng([trial, 1])
        made = measured_alignment(rng, trial, angle_deg, _CUT_SIGMA_M, settings.points)
        solved = solve_trial(made, "consistent")
        error_m = solved.shift_m - made.shift_m
        return {
            "floor": floor_error_m(made, exact=True),
            "consistent": error_m,
            "whitened": np.linalg.solve(np.linalg.cholesky(solved.covariance_m2), error_m),
        }

    by_angle = collect_errors(solve, settings.cut_angles_deg, settings.trials, progress)
    rows = [
        {
            "angle_deg": angle_deg,
            "trials": settings.trials,
            "floor_mean_mm": mean_length_mm(errors["floor"]),
            "consistent_mean_mm": mean_length_mm(errors["consistent"]),
            "normalised_squared_error_mean": float(np.mean(np.sum(errors["whitened"] ** 2, 1))),
        }
        for angle_deg, errors in by_angle.items()
    ]
    straight, *turned = rows
    excess_mm = max(row["consistent_mean_mm"] - row["floor_mean_mm"] for row in turned)
    what = "other cut, noise: mean |Δφ|"
    return Measured(
        [
            BenchFigure(f"{what} at 0°", straight["consistent_mean_mm"], "mm", at_most=1.0),
            BenchFigure(f"{what} above floor", excess_mm, "mm", at_most=0.5),
        ],
        rows,
    )


def measure_covariance(settings: BenchSettings, progress: Progress) -> Measured:
    """Measure whether the covariance matches the errors.

    If it does, the squared error normalised by the covariance averages 3.
    """

    def solve(trial: int) -> float:
        rng = np.random.default_rng([trial, 2])
        angle_deg, sigma_m = rng.uniform(0.0, _ANGLE_MAX_DEG), rng.uniform(*_SIGMA_M)
        made = measured_alignment(rng, trial, angle_deg, sigma_m, settings.points)
        solved = solve_trial(made, "consistent")
        error_m = solved.shift_m - made.shift_m
        return float(error_m @ np.linalg.solve(solved.covariance_m2, error_m))

    squares = run_trials(solve, range(settings.covariance_trials), progress)
    mean = float(np.mean(squares))
    return Measured(
        [BenchFigure("normalised squared error, mean", mean, "", at_least=2.4, at_most=3.6)],
        {"trials": len(squares), "mean": mean, "median": float(np.median(squares))},
    )
