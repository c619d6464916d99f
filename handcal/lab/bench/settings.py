"""How much to measure."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BenchSettings:
    """How much to measure; the defaults take some minutes on two cores."""

    points: int = 5000
    """Points of every cloud."""
    angles_deg: tuple[float, ...] = (0.0, 3.0, 6.0, 9.0, 12.0, 15.0, 20.0)
    """Rotations between cursor and hand in the paper's simulation; 0 among them."""
    cut_angles_deg: tuple[float, ...] = (0.0, 3.0, 6.0, 9.0)
    """The same, for clouds that are cut differently; 0 among them."""
    trials: int = 40
    """Alignments at each angle, for the methods that are quick."""
    slow_trials: int = 3
    """Of these, the ones that ``paper`` and ``linear`` solve too, ``paper`` at some seconds
    each."""
    covariance_trials: int = 200
    """Alignments that the covariance is judged by."""
    repeats: int = 25
    """How often a duration is measured."""
    paper_repeats: int = 3
    """The same for ``paper``."""
    offline_rigs: int = 1
    """Rigs calibrated from rendered photographs, at some minutes each."""
    offline_wearers: int = 100
    """Who calibrate with each of them, and with the true rig."""
    study_trials: int = 8
    """Alignments of each value in a small noise study, done twice; none of it if 0."""


QUICK = BenchSettings(
    points=500,
    angles_deg=(0.0, 9.0),
    cut_angles_deg=(0.0, 9.0),
    trials=2,
    slow_trials=1,
    covariance_trials=10,
    repeats=3,
    paper_repeats=1,
    offline_rigs=0,
    study_trials=0,
)
"""A look whether everything runs, in some seconds; its figures say little."""
