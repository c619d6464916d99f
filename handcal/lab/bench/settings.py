"""How much to measure."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BenchSettings:
    """How much to measure; the defaults take some minutes on two cores.

    Attributes
    ----------
    points : int
        Points of every cloud.
    angles_deg : tuple of float
        Rotations between cursor and hand in the paper's simulation; 0 among them.
    cut_angles_deg : tuple of float
        The same, for clouds that are cut differently; 0 among them.
    trials : int
        Alignments at each angle, for the methods that are quick.
    slow_trials : int
        Of these, the ones that ``paper`` and ``linear`` solve too, ``paper`` at some seconds each.
    covariance_trials : int
        Alignments that the covariance is judged by.
    repeats : int
        How often a duration is measured.
    paper_repeats : int
        The same for ``paper``.
    offline_rigs : int
        Rigs calibrated from rendered photographs, at some minutes each.
    offline_wearers : int
        Who calibrate with each of them, and with the true rig.
    study_trials : int
        Alignments of each value in a small noise study, done twice; none of it if 0.
    """

    points: int = 5000
    angles_deg: tuple[float, ...] = (0.0, 3.0, 6.0, 9.0, 12.0, 15.0, 20.0)
    cut_angles_deg: tuple[float, ...] = (0.0, 3.0, 6.0, 9.0)
    trials: int = 40
    slow_trials: int = 3
    covariance_trials: int = 200
    repeats: int = 25
    paper_repeats: int = 3
    offline_rigs: int = 1
    offline_wearers: int = 100
    study_trials: int = 8


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
