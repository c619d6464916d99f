"""The paper's own simulation (Hu et al. 2021, "Simulation test on rotation-constrained ICP").

A hand, the cursor made from it with a known φ, and the cursor turned about a random point of the
cloud. One set of data follows the paper, made from UQ itself (κ = 1); the other has a hand of
constant size (κ = 1 - φ3φ4).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product, takewhile
from typing import Any

import numpy as np

from handcal.core.progress import Progress
from handcal.core.types import METHODS, Float64
from handcal.lab.bench.figure import BenchFigure
from handcal.lab.bench.settings import BenchSettings
from handcal.lab.bench.trials import (
    Errors,
    Measured,
    collect_errors,
    mean_length_mm,
    trial_alignment,
)
from handcal.lab.study.trials import floor_error_m, solve_trial
from handcal.sim.alignments import AlignmentSettings

_SLOW = "paper", "linear"
_PUBLISHED_MM = 4.0
_FLOOR_RATIO = 1.1
# Lower limit of the floor and of the paper's error, which may be only rounding.
_ROUNDING_MM = 0.01
# The two sets of data, and whether their equation is exact.
_DATA = {"paper's data": False, "honest data": True}


def measure_paper_simulation(settings: BenchSettings, progress: Progress) -> Measured:
    """Compare the methods with each other, with the floor and with the published result."""

    def solve(case: tuple[str, float], trial: int) -> Errors:
        data, angle_deg = case
        making = AlignmentSettings(count=settings.points, exact=_DATA[data])
        made = trial_alignment(trial, angle_deg, making)
        errors = {_floor(of): floor_error_m(made, exact=exact) for of, exact in _DATA.items()}
        for method in METHODS:
            if method == "icp-open3d":
                continue
            if method not in _SLOW or trial < settings.slow_trials:
                errors[method] = solve_trial(made, method).shift_m - made.shift_m
        return errors

    cases = list(product(_DATA, settings.angles_deg))
    by_case = collect_errors(solve, cases, settings.trials, progress)
    figures = _published({angle: by_case["paper's data", angle] for angle in settings.angles_deg})
    for data in _DATA:
        figures += _compare(data, [by_case[data, angle] for angle in settings.angles_deg])
    rows = [
        _row(*case, name, errors_m)
        for case, errors in by_case.items()
        for name, errors_m in errors.items()
    ]
    return Measured(figures, rows)


def _floor(data: str) -> str:
    return f"floor for {data}"


def _published(by_angle: Mapping[float, Errors]) -> list[BenchFigure]:
    """Return the largest angle at which ``paper`` reaches the published accuracy."""

    def reach_deg(measure_mm: Callable[[Float64], float]) -> float:
        good = takewhile(lambda a: measure_mm(by_angle[a]["paper"]) <= _PUBLISHED_MM, by_angle)
        return max(good, default=0.0)

    measures: dict[str, Callable[[Float64], float]] = {
        "mean |Δφ|": mean_length_mm,
        "mean |Δφi|": lambda errors_m: float(np.mean(_components_mm(errors_m))),
    }
    return [
        BenchFigure(f"paper: {name} ≤ 4 mm up to (published: 9°)", reach_deg(measure), "°")
        for name, measure in measures.items()
    ]


def _compare(data: str, by_angle: Sequence[Errors]) -> list[BenchFigure]:
    """Compare ``consistent`` with the floor and with ``paper``, in the worst case."""
    limits = {_floor(data): _FLOOR_RATIO, "paper": 1.0}
    return [
        BenchFigure(
            f"worst consistent / {name.split()[0]}, {data}",
            max(_ratio(errors["consistent"], errors[name]) for errors in by_angle),
            "",
            at_most=limit,
        )
        for name, limit in limits.items()
    ]


def _ratio(errors_m: Float64, baseline_m: Float64) -> float:
    """Return the ratio of mean |Δφ| over the trials common to both."""
    shared = errors_m[: len(baseline_m)]
    return mean_length_mm(shared) / max(mean_length_mm(baseline_m), _ROUNDING_MM)


def _components_mm(errors_m: Float64) -> list[float]:
    components_mm: list[float] = (1e3 * np.abs(errors_m).mean(axis=0)).tolist()
    return components_mm


def _row(data: str, angle_deg: float, name: str, errors_m: Float64) -> dict[str, Any]:
    return {
        "data": data,
        "angle_deg": angle_deg,
        "method": name,
        "trials": len(errors_m),
        "mean_mm": mean_length_mm(errors_m),
        "component_means_mm": _components_mm(errors_m),
    }
