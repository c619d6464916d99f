"""The evaluations that are offered, on little data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pytestqt.qtbot import QtBot

from handcal.display import TARGET_DEPTHS_M
from handcal.errors import FileError
from handcal.lab.study.noise import QUICK_NOISE
from handcal.rig.example import example_rig
from handcal.session.session import Session
from handcal.session.trial import make_trial
from handcal.sim.cube_captures import CaptureSettings
from handcal.types import EYES, Rig
from handcal_gui.evaluation_entries import (
    CubeEntries,
    EvaluationEntries,
    MethodEntries,
    NoiseEntries,
    UserEntries,
)
from handcal_gui.windows.evaluation.cube import evaluate_cube
from handcal_gui.windows.evaluation.offers import make_offers
from handcal_gui.windows.evaluation.work import GivenData, SimulatedStudy


@pytest.fixture
def sessions(tmp_path: Path) -> Path:
    """Return a folder of two wearers' sessions, each of one calibration."""
    rig = example_rig()
    for wearer, shift_m in (("a", 0.001), ("b", 0.002)):
        with Session.create(tmp_path / "sessions", rig, {}, wearer) as session:
            for eye in EYES:
                for depth_m in TARGET_DEPTHS_M:
                    given_m = np.array([shift_m, 0.0, 0.0])
                    session.save_trial(
                        make_trial(rig.eyes[eye], eye, depth_m, given_m, np.zeros(3))
                    )
    return tmp_path / "sessions"


def test_every_form_shows_and_returns_its_entries(qtbot: QtBot) -> None:
    entries = EvaluationEntries(
        NoiseEntries("quick", 3, 2, "tcp://host:1", "/n"),
        MethodEntries(12, 4, 3, "tcp://host:2", "/m"),
        CubeEntries("/captures", "/cube.json", "/camera.json", "/rig.yaml", "right", 60, 5, "/c"),
        UserEntries("/sessions", "/u"),
    )
    for name, offer in make_offers().items():
        form = offer.form()
        qtbot.addWidget(form)
        form.show_entries(getattr(entries, name))
        assert form.take(getattr(EvaluationEntries(), name)) == getattr(entries, name)


def test_studies_are_those_of_the_commands() -> None:
    offers = make_offers()
    noise, methods = offers["noise"].evaluation, offers["methods"].evaluation
    assert isinstance(noise, SimulatedStudy)
    assert noise.study(NoiseEntries("quick", seed=3)).settings == replace(QUICK_NOISE, seed=3)
    assert isinstance(methods, SimulatedStudy)
    study = methods.study(MethodEntries(wearers=7, seed=3))
    assert (study.settings.wearers, study.settings.seed) == (7, 3)


def test_a_user_test_is_evaluated(sessions: Path, tmp_path: Path) -> None:
    evaluation = make_offers()["users"].evaluation
    assert isinstance(evaluation, GivenData)
    entries = UserEntries(str(sessions), str(tmp_path / "results"))
    assert evaluation.standing(entries).can_run
    told: list[tuple[str, float]] = []
    report = evaluation.describe(entries, lambda *one: told.append(one))
    assert report.subject == "2 wearers, 2 sessions, 12 trials"
    assert told == [("Reading sessions", 0.0), ("Reading sessions", 0.5)]
    with pytest.raises(FileError, match="no trial"):
        evaluation.describe(replace(entries, sessions=str(tmp_path / "none")), lambda *_: None)


def test_without_sessions_there_is_no_user_test(tmp_path: Path) -> None:
    evaluation = make_offers()["users"].evaluation
    standing = evaluation.standing(UserEntries("", str(tmp_path)))
    assert not standing.can_run
    assert "folder of sessions" in standing.finding.found


def test_a_cube_test_is_run_once_there_are_captures_to_look_at(tmp_path: Path) -> None:
    offer = make_offers()["cube"]
    assert offer.preparation is not None
    entries = CubeEntries(output=str(tmp_path / "results"))
    assert offer.evaluation.standing(entries).can_run
    assert not offer.preparation.is_possible(entries)
    entries = replace(entries, captures=str(tmp_path / "captures"))
    assert offer.preparation.is_possible(entries)
    standing = offer.evaluation.standing(entries)
    assert "no folder" in standing.finding.found
    assert not standing.can_run
    pose = tmp_path / "captures" / "centre" / "pose-1"
    pose.mkdir(parents=True)
    with pytest.raises(FileError, match="no captures"):
        offer.evaluation.standing(entries)
    for name in ("real.png", "virtual.png"):
        (pose / name).touch()
    assert offer.evaluation.standing(entries).can_run


def test_a_cube_test_says_what_it_lacks(tmp_path: Path) -> None:
    entries = CubeEntries(captures=str(tmp_path))
    with pytest.raises(FileError, match=r"cube\.json"):
        evaluate_cube(entries, lambda *_: None)


def test_a_cube_test_without_captures_renders_them(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[tuple[str, float]] = []
    asked: list[CaptureSettings] = []

    def render(
        folder: Path, rig: Rig, settings: CaptureSettings, report: Callable[[str, float], None]
    ) -> None:
        assert not any(folder.iterdir())
        asked.append(settings)
        report("centre, pose 1", 0.5)
        raise FileError("no space left")

    monkeypatch.setattr("handcal_gui.windows.evaluation.cube.write_captures", render)
    with pytest.raises(FileError, match="no space left"):
        evaluate_cube(CubeEntries(eye="right", seed=4), lambda *one: told.append(one))
    assert asked == [CaptureSettings(seed=4, eye="right")]
    assert told == [("Rendering centre, pose 1", 0.35)]
