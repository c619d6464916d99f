"""Simulated alignments, many at a time, and what the methods make of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from typing import Any, TypeAlias, TypeVar

import numpy as np

from handcal.lab.bench.figure import Figure
from handcal.lab.study.trials import study_hand
from handcal.sim.alignments import AlignmentSettings, SimulatedAlignment, simulate_alignment
from handcal.sim.hand import HandModel
from handcal.types import Float64

Task = TypeVar("Task")
Case = TypeVar("Case")
Outcome = TypeVar("Outcome")

Progress: TypeAlias = Callable[[float], None]
"""Is told the fraction done."""

Errors: TypeAlias = Mapping[str, Float64]
"""Errors of φ by method, or by floor: (3,) of one trial, (trials, 3) of several."""

_HANDS = 10


@dataclass(frozen=True, slots=True)
class Measured:
    """What a part of the benchmark found: its headline figures, and the rest as JSON."""

    figures: list[Figure]
    details: Any


def run_trials(
    trial: Callable[[Task], Outcome], tasks: Sequence[Task], progress: Progress
) -> list[Outcome]:
    """Run a trial for every task, in as many threads as there are cores, and keep the order."""
    outcomes = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for outcome in pool.map(trial, tasks):
            outcomes.append(outcome)
            progress(len(outcomes) / len(tasks))
    return outcomes


def collect_errors(
    trial: Callable[[Case, int], Errors], cases: Sequence[Case], trials: int, progress: Progress
) -> dict[Case, Errors]:
    """Run trials 0, 1, … of every case, and stack the errors of φ that each gives.

    What trial 0 names counts; later trials may leave some out.
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
    """Return the hand of a trial: some people, who come again."""
    return study_hand(trial % _HANDS)


def trial_alignment(trial: int, angle_deg: float, making: AlignmentSettings) -> SimulatedAlignment:
    """Return the alignment of a trial; at other angles it is the same but for the angle."""
    rng = np.random.default_rng(trial)
    return simulate_alignment(rng, trial_hand(trial), np.radians(angle_deg), making)


def mean_length_mm(errors_m: Float64) -> float:
    """Return the mean |Δφ| of (N, 3) errors."""
    return 1e3 * float(np.linalg.norm(errors_m, axis=1).mean())
