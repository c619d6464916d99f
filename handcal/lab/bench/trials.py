"""Many simulated alignments, solved by several methods."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from typing import Any, TypeAlias, TypeVar

import numpy as np

from handcal.core.progress import Progress
from handcal.core.types import Float64
from handcal.lab.bench.figure import BenchFigure
from handcal.lab.study.trials import study_hand
from handcal.sim.alignments import AlignmentSettings, SimulatedAlignment, simulate_alignment
from handcal.sim.hand import HandModel

Task = TypeVar("Task")
Case = TypeVar("Case")
Result = TypeVar("Result")


Errors: TypeAlias = Mapping[str, Float64]
"""Errors of φ by method or floor: (3,) for one trial, (trials, 3) for several."""

_HANDS = 10
_FOREARM_M = 0.02, 0.06


@dataclass(frozen=True, slots=True)
class Measured:
    """The result of a part of the benchmark: headline figures, and details as JSON."""

    figures: list[BenchFigure]
    details: Any


def run_trials(
    trial: Callable[[Task], Result], tasks: Sequence[Task], progress: Progress
) -> list[Result]:
    """Run a trial for every task, with one thread per core; the order is kept."""
    outcomes = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for outcome in pool.map(trial, tasks):
            outcomes.append(outcome)
            progress.at(len(outcomes) / len(tasks))
    return outcomes


def collect_errors(
    trial: Callable[[Case, int], Errors], cases: Sequence[Case], trials: int, progress: Progress
) -> dict[Case, Errors]:
    """Run trials 0, 1, … of every case, and stack their errors of φ.

    Trial 0 determines the methods; later trials may omit some.
    """
    tasks = list(product(cases, range(trials)))
    outcomes = run_trials(lambda task: trial(*task), tasks, progress)
    blocks = (outcomes[start : start + trials] for start in range(0, len(outcomes), trials))
    return {
        case: {
            name: np.array([errors[name] for errors in block if name in errors])
            for name in block[0]
        }
        for case, block in zip(cases, blocks, strict=True)
    }


def trial_hand(trial: int) -> HandModel:
    """Return the hand of a trial, one of a few that repeat."""
    return study_hand(trial % _HANDS)


def trial_alignment(trial: int, angle_deg: float, making: AlignmentSettings) -> SimulatedAlignment:
    """Return the alignment of a trial; it is the same at all angles except for the angle."""
    rng = np.random.default_rng(trial)
    return simulate_alignment(rng, trial_hand(trial), np.radians(angle_deg), making)


def measured_alignment(
    rng: np.random.Generator, trial: int, angle_deg: float, sigma_m: float, points: int
) -> SimulatedAlignment:
    """Return an alignment whose forearms are cut 20 to 60 mm below the wrist."""
    cursor_forearm_m, hand_forearm_m = rng.uniform(*_FOREARM_M, 2)
    making = AlignmentSettings(
        count=points,
        resample=True,
        depth_sigma_m=sigma_m,
        cursor_forearm_m=cursor_forearm_m,
        hand_forearm_m=hand_forearm_m,
    )
    return trial_alignment(trial, angle_deg, making)


def mean_length_mm(errors_m: Float64) -> float:
    """Return the mean |Δφ| of (N, 3) errors."""
    return 1e3 * float(np.linalg.norm(errors_m, axis=1).mean())
