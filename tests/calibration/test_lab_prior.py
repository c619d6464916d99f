"""The prior learned from a lab's sessions."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.calibration import lab_prior
from handcal.calibration.lab_prior import run_learn_prior
from handcal.core.progress import Progress
from handcal.core.types import EYES, Alignment, EyeDistance, Rig
from handcal.register.prior import MIN_SESSIONS, PriorSettings, eye_position_m, eye_prior
from handcal.register.results import RESULTS_VERSION, SolveSettings, results_json, solve_session
from handcal.rig.example import example_rig
from handcal.session.library import correct_wearer
from handcal.session.repair import repair_session
from handcal.session.session import Session

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
