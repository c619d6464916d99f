"""The priors learned from a lab's sessions: where eyes are, and what wearers see wrongly."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.calibration import lab_prior
from handcal.calibration.lab_prior import run_learn_prior
from handcal.calibration.solve_again import Former
from handcal.core.progress import Progress
from handcal.core.types import EYES, Alignment, EyeDistance, Rig, Verification
from handcal.register.model import nudged_shift_m
from handcal.register.prior import (
    MIN_PEOPLE,
    MIN_SESSIONS,
    MIN_SITTINGS,
    PriorSettings,
    eye_position_m,
    eye_prior,
    learn_wearers,
)
from handcal.register.results import (
    RESULTS_VERSION,
    SolveSettings,
    conclude,
    results_json,
    solve_session,
)
from handcal.register.sitting import SittingSettings, sitting_prior
from handcal.rig.example import example_rig
from handcal.rig.rig_file import write_rig
from handcal.session.library import correct_wearer
from handcal.session.repair import repair_session
from handcal.session.session import Session
from handcal.station.settings import StationSettings
from handcal.station.station import resume_or_create

RIG = example_rig()
SETTINGS = PriorSettings()


@pytest.fixture(scope="module")
def alignment(simulated: Callable[..., Alignment]) -> Alignment:
    return simulated(1)


def _session(
    folder: Path,
    name: str,
    alignment: Alignment,
    *,
    rig: Rig = RIG,
    wearer: str = "",
    contradictions: tuple[str, ...] = (),
    is_finished: bool = True,
    eye_distance: EyeDistance | None = None,
) -> None:
    results = solve_session(
        [alignment],
        RIG,
        SolveSettings(),
        contradictions=contradictions,
        eye_distance=eye_distance,
    )
    with Session.create(folder, rig, {}, name, wearer) as session:
        session.save_alignment(alignment)
        session.save_results(json.loads(json.dumps(results_json(results))))
        if is_finished:
            session.finish()


def test_a_lab_without_sessions_has_no_prior(tmp_path: Path) -> None:
    found = run_learn_prior(tmp_path / "missing", RIG, SETTINGS)
    assert (found.learned, found.used, dict(found.left_out)) == (None, 0, {})


def test_only_sound_finished_sessions_of_the_same_rig_count(
    tmp_path: Path, alignment: Alignment
) -> None:
    moved = replace(RIG, T_H_D=RIG.T_H_D @ np.diag([1.0, -1.0, -1.0, 1.0]))
    _session(tmp_path, "good", alignment)
    _session(tmp_path, "twice", alignment, wearer="P01")
    _session(tmp_path, "twice again", alignment, wearer="P01")
    _session(tmp_path, "contradicted", alignment, contradictions=("the picture froze",))
    _session(tmp_path, "another rig", alignment, rig=moved)
    _session(tmp_path, "interrupted", alignment, is_finished=False)
    with Session.create(tmp_path, RIG, {}, "empty") as session:
        session.finish()
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "journal.jsonl").write_text("nonsense\n")
    found = run_learn_prior(tmp_path, RIG, SETTINGS)
    assert found.used == 2
    assert found.learned is None
    assert dict(found.left_out) == {
        "earlier sessions of the same wearer": 1,
        "contradicted or implausible": 1,
        "of another rig": 1,
        "not finished": 1,
        "not solved": 1,
        "not readable": 1,
    }


def test_enough_sessions_make_a_prior(tmp_path: Path, alignment: Alignment) -> None:
    seen: list[str] = []
    for number in range(MIN_SESSIONS):
        _session(tmp_path, f"{number}", alignment, wearer=f"P{number}")
    progress = Progress(lambda what, _share: seen.append(what))
    found = run_learn_prior(tmp_path, RIG, SETTINGS, progress)
    assert found.learned is not None
    assert found.learned.sessions == found.used == MIN_SESSIONS
    assert seen[0] == f"Reading session 1 of {MIN_SESSIONS}"
    # All wearers here have the same eyes: the lab knows better than the default where they are.
    lab, default = eye_prior(PriorSettings(learned=found.learned)), eye_prior(SETTINGS)
    assert np.trace(lab.covariance_m2) < 0.7 * np.trace(default.covariance_m2)


def test_a_session_counts_by_its_start_and_under_its_corrected_name(
    tmp_path: Path, alignment: Alignment, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts: list[list[int]] = []  # of the observations of each session
    monkeypatch.setattr(
        lab_prior, "learn_prior", lambda sessions, *_: counts.append([*map(len, sessions)])
    )
    _session(tmp_path, "old", alignment, wearer="p7", eye_distance=EyeDistance(0.065))
    _session(tmp_path, "new", alignment, wearer="P7")
    with Session(tmp_path / "new") as session:
        session.save_notes("The headset slipped once.")
    assert run_learn_prior(tmp_path, RIG, SETTINGS).used == 2
    correct_wearer(tmp_path / "old", "P7")  # its journal is now the newer one
    found = run_learn_prior(tmp_path, RIG, SETTINGS)
    assert (found.used, dict(found.left_out)) == (1, {"earlier sessions of the same wearer": 1})
    assert counts == [[2, 1], [1]]
    _session(tmp_path, "nameless", alignment)
    repair_session(tmp_path / "nameless", tmp_path / "copy")
    assert run_learn_prior(tmp_path, RIG, SETTINGS).used == 2, "a copy is no other wearer"


def test_measured_eye_distances_are_learned_from(tmp_path: Path, alignment: Alignment) -> None:
    """One alignment with both eyes open hardly sees the eye distance; a ruler does."""
    left_m, right_m = (eye_position_m(RIG.eyes[eye], np.zeros(3)) for eye in EYES)
    rig_m = float(np.linalg.norm(right_m - left_m))
    for number in range(2 * MIN_SESSIONS):
        measured = EyeDistance(rig_m + 0.003)
        _session(tmp_path, f"{number}", alignment, wearer=f"P{number}", eye_distance=measured)
    found = run_learn_prior(tmp_path, RIG, SETTINGS)
    assert found.learned is not None
    mean_m = np.reshape(found.learned.mean_m, (2, 3))
    assert mean_m[1, 0] - mean_m[0, 0] == pytest.approx(0.003, abs=0.0006)


def test_results_of_another_version_or_without_observations_do_not_count(
    tmp_path: Path, alignment: Alignment
) -> None:
    damaged = {"H": np.eye(3, 6).tolist(), "seen_m": [0.0] * 3, "covariance_m2": [[1.0]]}
    now = RESULTS_VERSION
    for version, observed in ((now - 1, []), (now + 1, []), (now, [damaged]), (now, [])):
        with Session.create(tmp_path, RIG, {}) as session:
            session.save_alignment(alignment)
            session.save_results({"version": version, "eyes": {}, "observed": observed})
            session.finish()
    found = run_learn_prior(tmp_path, RIG, SETTINGS)
    assert dict(found.left_out) == {"solved by another version": 2, "not readable": 2}


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
