"""Settings of the benchmark."""

from __future__ import annotations

from dataclasses import dataclass


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
