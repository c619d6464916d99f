"""The dialog with a recorder that asks as the real one does."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QProgressBar, QPushButton
from pytestqt.qtbot import QtBot

from handcal.core.display import eye_projection
from handcal.core.errors import HandcalError
from handcal.core.geometry import project
from handcal.core.progress import Progress
from handcal.core.types import Float64
from handcal.rig.example import example_rig
from handcal.session.session import Session
from handcal.session.trial import Trial
from handcal.station.user_test.cube import StudyLeader, TrialOrder
from handcal_gui.evaluate.entries import UserEntries
from handcal_gui.evaluate.trials_dialog import STEP_M, TrialsDialog
from handcal_gui.widgets.table import Table
from tests.gui.helpers import child
from tests.helpers import ROOT


class Recorder:
    """Asks for one trial of a stored session, and notes what is drawn."""

    def __init__(self) -> None:
        self.drawn_m: list[Float64] = []
        self.found_m = np.zeros(3)
        self.order: TrialOrder | None = None
        self.failure = ""

    def __call__(
        self, order: TrialOrder, connect: Any, _camera: Any, leader: StudyLeader, _: Progress
    ) -> tuple[Trial, ...]:
        self.order = order
        assert connect is None
        if self.failure:
            raise HandcalError(self.failure)
        leader.place(0.5)
        self.found_m = leader.adjust(
            "left", np.zeros(3), lambda shift_m: self.drawn_m.append(shift_m.copy())
        )
        return tuple(Session.open(order.session).trials.values())[:1]


@pytest.fixture
def session(tmp_path: Path) -> Path:
    return Path(shutil.copytree(ROOT / "resources" / "example_session", tmp_path / "session"))


@pytest.fixture
def make(qtbot: QtBot, session: Path) -> Iterator[Callable[[Recorder], TrialsDialog]]:
    made: list[TrialsDialog] = []

    def make_one(recorder: Recorder) -> TrialsDialog:
        entries = UserEntries(sessions=str(session), headset="virtual")
        made.append(TrialsDialog(entries, record=recorder))
        qtbot.addWidget(made[-1])
        made[-1].show()
        return made[-1]

    yield make_one
    for dialog in made:
        dialog.reject()


def test_the_study_leader_places_the_cube_and_moves_the_drawing(
    qtbot: QtBot, make: Callable[[Recorder], TrialsDialog], session: Path
) -> None:
    recorder = Recorder()
    dialog = make(recorder)
    whose = "Simulated wearer (simulated: camera, headset and wearer)"
    held = f"The session of {whose} holds 6 trials; new ones are added."
    assert child(dialog, QLabel, "trialsFound").text() == held
    instruction, follow = child(dialog, QLabel, "instruction"), child(dialog, QPushButton, "next")
    right, doing = child(dialog, QPushButton, "right"), child(dialog, QLabel, "doing")
    child(dialog, QPushButton, "start").click()
    qtbot.waitUntil(lambda: instruction.text().startswith("Put the cube 0.5 m"), timeout=20_000)
    assert not right.isEnabled()
    assert doing.text() == "Waiting for you…", "not for the headset"
    assert child(dialog, QProgressBar, "progress").maximum() > 0, "nothing moves"
    follow.click()
    assert doing.text() == "Looking for the cube…"
    qtbot.waitUntil(lambda: instruction.text().startswith("Left eye: move"), timeout=20_000)
    assert doing.text() == "Waiting for you…"
    right.click()
    QTest.keyClick(dialog, Qt.Key.Key_Right)
    child(dialog, QPushButton, "up").click()
    qtbot.waitUntil(lambda: len(recorder.drawn_m) == 3, timeout=20_000)
    follow.click()
    table = child(dialog, Table, "trials-recorded")
    qtbot.waitUntil(lambda: len(table.keys) == 1, timeout=20_000)
    np.testing.assert_allclose(recorder.found_m, STEP_M * np.array([-2.0, 1.0, 0.0]))
    np.testing.assert_allclose(recorder.drawn_m[-1], recorder.found_m)
    display = example_rig().eyes["left"]
    before_px, after_px = (
        project(eye_projection(display, shift_m), [[0.0, 0.0, 0.5]])[0]
        for shift_m in (np.zeros(3), recorder.found_m)
    )
    right_px, down_px = after_px - before_px
    assert right_px > 0.0
    assert down_px < 0.0
    assert recorder.order == TrialOrder(session)
    assert child(dialog, QLabel, "trialsFound").text() == f"Trials stored: 1. {held}"
    assert instruction.text().startswith("The trials are stored. Close, or start again")


def test_a_failure_is_shown_and_trials_can_be_started_again(
    qtbot: QtBot, make: Callable[[Recorder], TrialsDialog]
) -> None:
    recorder = Recorder()
    recorder.failure = "the cube did not come to rest"
    dialog = make(recorder)
    start = child(dialog, QPushButton, "start")
    start.click()
    found = child(dialog, QLabel, "trialsFound")
    qtbot.waitUntil(lambda: "did not come to rest" in found.text(), timeout=20_000)
    qtbot.waitUntil(start.isEnabled, timeout=20_000)


def test_closing_ends_a_running_trial(
    qtbot: QtBot, make: Callable[[Recorder], TrialsDialog]
) -> None:
    dialog = make(Recorder())
    child(dialog, QPushButton, "start").click()
    instruction = child(dialog, QLabel, "instruction")
    qtbot.waitUntil(lambda: instruction.text().startswith("Put the cube"), timeout=20_000)
    dialog.reject()
    assert not dialog.isVisible()


def test_a_simulated_session_is_said_to_be_one(qtbot: QtBot, tmp_path: Path) -> None:
    settings = {"station": {"source": "simulator", "headset": "virtual"}}
    with Session.create(tmp_path, example_rig(), settings, wearer="Ann") as session:
        pass
    dialog = TrialsDialog(UserEntries(sessions=str(session.path)))
    qtbot.addWidget(dialog)
    assert child(dialog, QLabel, "trialsFound").text() == (
        "The session of Ann (simulated: camera, headset and wearer) holds no trial yet."
    )


def test_a_folder_of_sessions_is_refused_at_once(qtbot: QtBot, tmp_path: Path) -> None:
    dialog = TrialsDialog(UserEntries(sessions=str(tmp_path), headset="virtual"))
    qtbot.addWidget(dialog)
    assert "is not one session" in child(dialog, QLabel, "trialsFound").text()
    assert not child(dialog, QPushButton, "start").isEnabled()
