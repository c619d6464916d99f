"""Replaces resources/example_session by a simulated wearer's calibration with trials."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import numpy as np

from handcal.calibration.states import CalibrationSettings
from handcal.core.display import TARGET_DEPTHS_M
from handcal.core.types import EYES, Alignment, Eye, Float64
from handcal.io.settings import settings_json
from handcal.lab.study.wearers import StudyWearer, align_hand, draw_wearer
from handcal.register.results import SolveSettings, results_json, solve_session
from handcal.session.session import Session
from handcal.session.trial import make_trial
from handcal.sim.wearer_settings import WearerSettings

TARGET = Path(__file__).parents[1] / "resources/example_session"
SEED = 13
"""Of a wearer whose eyes are both accepted after one alignment each; most need more."""
POINTS, DEPTH_SIGMA_M = 5000, 0.001
BY_HAND_SIGMA_M = 0.0005
"""Standard deviation with which a wearer puts the drawn target over the real one."""
NOTES = "Simulated: made by docs/example_session.py."


def main() -> None:
    """Make the session, and put it among the resources."""
    rng = np.random.default_rng(SEED)
    wearer = draw_wearer(rng, SEED, WearerSettings())
    simulated = {"source": "simulator", "headset": "virtual"}
    settings = {"calibration": settings_json(CalibrationSettings()), "station": simulated}
    with tempfile.TemporaryDirectory() as scratch:
        with Session.create(
            Path(scratch), wearer.rig, settings, name="example", wearer="Simulated wearer"
        ) as session:
            shift_m = calibrate(session, wearer, rng)
            record_trials(session, wearer, shift_m, rng)
            session.save_notes(NOTES)
            session.finish()
        shutil.rmtree(TARGET, ignore_errors=True)
        shutil.copytree(session.path, TARGET, ignore=shutil.ignore_patterns("lock"))


def calibrate(
    session: Session, wearer: StudyWearer, rng: np.random.Generator
) -> dict[Eye, Float64]:
    """Align one eye after the other, and return the solved φ."""
    alignments: list[Alignment] = []
    shift_m: dict[Eye, Float64] = {eye: np.zeros(3) for eye in EYES}
    for eye in EYES:
        placement = WearerSettings()
        alignments.append(
            align_hand(wearer, rng, (eye,), shift_m, placement, POINTS, DEPTH_SIGMA_M)
        )
        session.save_alignment(alignments[-1])
        results = solve_session(alignments, wearer.rig, SolveSettings())
        session.save_results(results_json(results))
        solved_m = {eye: shift.shift_m for eye, shift in results.eyes.items()}
        session.save_applied(solved_m)
        shift_m |= solved_m
    return shift_m


def record_trials(
    session: Session,
    wearer: StudyWearer,
    shift_m: dict[Eye, Float64],
    rng: np.random.Generator,
) -> None:
    """Let the wearer find φ by hand, for each eye and distance."""
    for eye in EYES:
        for depth_m in TARGET_DEPTHS_M:
            by_hand_m = wearer.true_shift_m[eye] + rng.normal(0.0, BY_HAND_SIGMA_M, 3)
            display = wearer.rig.eyes[eye]
            session.save_trial(make_trial(display, eye, depth_m, shift_m[eye], by_hand_m))


if __name__ == "__main__":
    main()
