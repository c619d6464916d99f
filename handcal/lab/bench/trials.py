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
from handcal.lab.study.trials import study_hand
from handcal.sim.alignments import AlignmentSettings, SimulatedAlignment, simulate_alignment
from handcal.sim.hand import HandModel


@dataclass(frozen=True, slots=True)
class BenchFigure:
    """One measured number."""

    what: str
    value: float
    unit: str
    """Unit; empty for a ratio."""
    at_least: float | None = None
    at_most: float | None = None
    """Target limits; None if there is none on that side."""

    def to_json(self) -> dict[str, Any]:
        """Return the figure, its target as text, and whether it is met (None without target)."""
        bounds = []
        if self.at_least is not None:
            bounds.append((f"≥ {self.at_least:g}", self.value >= self.at_least))
        if self.at_most is not None:
            bounds.append((f"≤ {self.at_most:g}", self.value <= self.at_most))
        return {
            "what": self.what,
            "value": self.value,
            "unit": self.unit,
            "target": ", ".join(text for text, _ in bounds),
            "met": all(met for _, met in bounds) if bounds else None,
        }


@dataclass(frozen=True, slots=True)
class BenchSettings:
    """Extent of the benchmark; the defaults take a few minutes on two cores."""

    points: int = 5000
    """Number of points of every cloud."""
    angles_deg: tuple[float, ...] = (0.0, 3.0, 6.0, 9.0, 12.0, 15.0, 20.0)
    """Rotations between cursor and hand in the paper's simulation; must include 0."""
    cut_angles_deg: tuple[float, ...] = (0.0, 3.0, 6.0, 9.0)
    """Rotations for differently cut clouds; must include 0."""
    trials: int = 40
    """Alignments at each angle for the fast methods."""
    slow_trials: int = 3
    """Number of these also solved by ``paper`` and ``linear``; ``paper`` takes seconds for
    each."""
    covariance_trials: int = 200
    """Alignments for judging the covariance."""
    repeats: int = 25
    """Repetitions of each timing."""
    paper_repeats: int = 3
    """Repetitions of timing ``paper``."""
    peer_points: tuple[int, ...] = (1000, 2000, 5000, 20_000, 200_000)
    """Sizes of the clouds registered beside other libraries; the middle one is the usual one."""
    peer_trials: int = 48
    """Alignments of each size for these."""
    spoiled_pairs: int = 60
    """Pairs of clouds with outliers or missing parts, for each condition."""
    offline_rigs: int = 1
    """Rigs calibrated from rendered photographs, which takes minutes for each."""
    offline_wearers: int = 100
    """Wearers who calibrate with each of these rigs, and with the true one."""
    camera_wearers: int = 20
    """Wearers who calibrate with each simulated depth camera; 0 to skip it."""
    study_trials: int = 8
    """Alignments per value in a small noise study, run twice; 0 to skip it."""


QUICK = BenchSettings(
    points=500,
    angles_deg=(0.0, 9.0),
    cut_angles_deg=(0.0, 9.0),
    trials=2,
    slow_trials=1,
    covariance_trials=10,
    repeats=3,
    paper_repeats=1,
    peer_points=(500, 1000, 2000),
    peer_trials=1,
    spoiled_pairs=1,
    offline_rigs=0,
    camera_wearers=0,
    study_trials=0,
)
"""Smoke-test settings: a few seconds; the figures are not meaningful."""


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
