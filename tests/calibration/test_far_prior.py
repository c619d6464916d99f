"""A learned prior that wearers do not explain, and what wearers always see wrongly."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.calibration.lab_prior import run_learn_prior
from handcal.calibration.solve_again import Former
from handcal.core.types import EYES, Verification
from handcal.register.nudge import nudged_shift_m
from handcal.register.prior import MIN_SESSIONS, PriorSettings, eye_prior
from handcal.register.results import SolveSettings, conclude, results_json
from handcal.register.sitting import SittingSettings, sitting_prior
from handcal.register.wearers import MIN_PEOPLE, MIN_SITTINGS, learn_wearers
from handcal.rig.example import example_rig
from handcal.rig.rig_file import write_rig
from handcal.session.session import Session
from handcal.station.settings import StationSettings
from handcal.station.station import resume_or_create

RIG = example_rig()
NEAR_M = (0.0, 0.02, 0.45)


def session(folder: Path, wearer: str, forward_m: float) -> None:
    """Store a finished session of verifications alone, of eyes at a distance before C0."""
    true_m = np.array([0.0, 0.0, forward_m])
    verified = {}
    for eye in EYES:
        after_m = nudged_shift_m(RIG.eyes[eye], true_m, NEAR_M, 0.0, 0.0)
        verified[eye] = Verification((0, 0, 0), (1.0, 0.0), tuple(after_m.tolist()), 0.0, NEAR_M)
    results = conclude([], RIG, SolveSettings(), verified=verified)
    with Session.create(folder, RIG, {}, wearer=wearer) as stored:
        stored.save_facts(verified=verified)
        stored.save_results(json.loads(json.dumps(results_json(results))))
        stored.finish()


@pytest.mark.parametrize(("forward_m", "is_far"), [(0.001, False), (-0.012, True)])
def test_a_prior_far_from_the_viewpoint_is_not_used_before_it_is_confirmed(
    tmp_path: Path, forward_m: float, is_far: bool
) -> None:
    for number in range(MIN_SESSIONS + 10):
        session(tmp_path, f"P{number}", forward_m)
    found = run_learn_prior(tmp_path, RIG, PriorSettings())
    assert found.learned is not None
    assert bool(found.learned.warning) is is_far
    write_rig(tmp_path / "rig.yaml", RIG)
    usual = StationSettings(sessions=str(tmp_path), rig=str(tmp_path / "rig.yaml"))
    for settings in (usual, replace(usual, use_far_prior=True)):
        with resume_or_create(settings, "new", None, Former()) as (created, began):
            prior = began.calibration.solve.fuse.prior
            is_used = settings.use_far_prior or not is_far
            assert (prior.learned == found.learned) is is_used
            assert (prior.unconfirmed is None) is is_used
            shown = eye_prior(prior).warning
            assert ("check the depth camera's edges" in shown) is not is_used
            assert created.path.exists()


def test_what_wearers_always_see_wrongly_is_learned_from_those_with_several_sessions(
    tmp_path: Path,
) -> None:
    sittings = -(-MIN_SITTINGS // MIN_PEOPLE)
    for person in range(MIN_PEOPLE):
        for _ in range(sittings):
            session(tmp_path, f"P{person}", 0.001)
    session(tmp_path, "once", 0.001)
    found = run_learn_prior(tmp_path, RIG, PriorSettings())
    assert [len(person) for person in found.repeated] == [sittings] * MIN_PEOPLE
    assert found.used == MIN_PEOPLE + 1
    wearers = learn_wearers(found.repeated, sitting_prior(RIG, SittingSettings()))
    assert wearers is not None
    settings = StationSettings(sessions=str(tmp_path), learn_wearers=True)
    with resume_or_create(settings, "new", None, Former()) as (_, began):
        assert began.calibration.solve.fuse.sitting.learned == wearers.learned
