"""The program when hand, headset, camera, disk or engine fail."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QMessageBox, QPlainTextEdit, QPushButton

from handcal.calibration.states import State
from handcal.session.session import Session
from handcal.station.snapshot import Snapshot
from handcal.station.station import Station
from handcal_gui.app import launch
from handcal_gui.calibrate.guide.view import Action
from tests.gui.app.program.technician import (
    PATIENCE_MS,
    Technician,
    align,
    can_start,
    is_turned,
    make_cursor,
)


def test_a_hand_lost_is_said_and_nothing_can_be_made_of_it(live: Technician, studio: Any) -> None:
    studio.camera.shows = "cursor"
    live.press_space_for(Action.NEXT)
    live.wait(lambda: live.can_take("Make cursor"))
    studio.camera.shows = "nothing"
    live.wait(lambda: not live.can(Action.TAKE_STEP))
    shown = live.program.wizard_panel.shown
    assert shown is not None
    assert "hand" in shown.preconditions[0].text
    assert not shown.preconditions[0].holds
    assert not live.child(QPushButton, "wizardMain").isEnabled()
    QTest.keyClick(live.program.window, Qt.Key.Key_Space)
    live.qtbot.wait(200)
    assert live.snapshot.procedure.state is State.SHOW_HAND


def test_a_turned_hand_is_refused_then_taken(live: Technician, studio: Any) -> None:
    make_cursor(live, studio)
    studio.camera.shows = "turned"
    live.wait(
        lambda: live.snapshot.observation is not None and live.snapshot.observation.is_over_limit
    )
    studio.headset.confirm()
    live.wait(lambda: live.snapshot.record.refused == 1)
    live.wait(lambda: "more than 9°" in live.child(QLabel, "wizardFact").text())
    assert live.record.alignments == {}
    studio.camera.shows = "live"
    live.wait(
        lambda: (
            live.snapshot.observation is not None and not live.snapshot.observation.is_over_limit
        )
    )
    live.qtbot.wait(300)
    studio.headset.confirm()
    live.wait_for_state(State.ALIGNED)
    live.wait(lambda: len(live.record.alignments) == 1)
    live.wait(lambda: live.child(QLabel, "wizardFact").isHidden())
    assert live.child(QLabel, "wizardNote").text() == ""


def test_a_silent_headset_is_reported_and_sending_repeated(live: Technician, studio: Any) -> None:
    align(live, studio)
    live.press_space_to("Solve")
    live.wait_for_state(State.SOLVED)
    studio.headset.fall_silent()
    live.press_space_for(Action.TAKE_STEP)
    live.wait_for_state(State.APPLYING)
    live.wait_for_state(State.SOLVED)
    live.wait(lambda: "no headset is connected" in live.snapshot.link_problem)
    live.wait(lambda: live.banner.startswith("the headset did not answer"))
    assert live.banner.endswith("check that it is on and that its app runs; see Link")
    assert live.child(QLabel, "wizardNote").text() == "", "it is said once"
    assert live.snapshot.observation is not None
    assert live.snapshot.observation.problem == "the headset sends no poses"
    live.program.window.go_to("link")
    state = live.child(QLabel, "link-state")
    live.wait(lambda: state.text().startswith("No headset is connected"))
    studio.headset.come_back()
    live.wait(lambda: state.text() == "Connected")
    live.wait(lambda: not live.snapshot.link_problem)
    live.press_space_for(Action.TAKE_STEP)
    live.wait_for_state(State.APPLIED)
    live.wait(lambda: live.banner == "")


def test_a_camera_unplugged_comes_back_to_the_same_session(live: Technician, studio: Any) -> None:
    make_cursor(live, studio)
    studio.camera.is_plugged = False
    live.wait(lambda: "unplugged" in live.banner or "plug one in" in live.banner)
    studio.camera.is_plugged = True
    live.wait(lambda: live.banner == "")
    assert live.snapshot.procedure.state is State.ALIGN
    studio.camera.shows = "live"
    live.wait(lambda: live.snapshot.observation is not None)
    live.qtbot.wait(300)
    studio.headset.confirm()
    live.wait_for_state(State.ALIGNED)


def test_a_full_disk_costs_nothing_once_there_is_space(live: Technician, studio: Any) -> None:
    make_cursor(live, studio)
    path = live.snapshot.session_path
    away = path.with_name("away")
    path.rename(away)  # as good as a full disk
    studio.camera.shows = "live"
    live.wait(lambda: is_turned(live))
    studio.headset.confirm()
    live.wait_for_state(State.ALIGNED)
    live.wait(lambda: "cannot write" in live.banner)
    assert "moved or deleted. Make room on the disk" in live.banner
    assert "make the folder writable, or put it back: " in live.banner
    live.press_space_to("Solve")
    live.wait_for_state(State.SOLVED)
    assert len(live.snapshot.record.unwritten) == 2
    assert len(live.snapshot.record.alignments) == 1
    away.rename(path)
    live.wait(lambda: live.banner == "")
    live.wait(lambda: live.snapshot.record.is_solved)
    assert len(live.record.alignments) == 1


@pytest.mark.parametrize("leave", ["close", "next wearer"])
def test_data_not_written_yet_are_left_only_on_request(
    live: Technician, studio: Any, monkeypatch: pytest.MonkeyPatch, leave: str
) -> None:
    buttons = QMessageBox.StandardButton
    answers, asked = [buttons.Cancel, buttons.Discard], []

    def answer(_parent: object, _title: str, text: str, *_: object) -> object:
        asked.append(text)
        return answers[len(asked) - 1]

    monkeypatch.setattr(QMessageBox, "warning", answer)
    make_cursor(live, studio)
    path = live.snapshot.session_path
    path.rename(path.with_name("away"))
    studio.camera.shows = "live"
    live.wait(lambda: is_turned(live))
    studio.headset.confirm()
    live.wait(lambda: "cannot write" in live.banner)
    window = live.program.window
    next_wearer = live.program.live.on[Action.NEXT_WEARER]
    leave_now: Callable[[], object] = window.close if leave == "close" else next_wearer
    leave_now()
    assert "cannot write" in asked[0].lower()
    assert "They are lost" in asked[0]
    assert window.isVisible()
    assert window.page == "live"
    leave_now()
    assert len(asked) == 2
    assert live.program.live.snapshot is None


@pytest.mark.parametrize("begins", ["typed just now", "refused before"])
def test_notes_that_cannot_be_saved_are_left_only_on_request(
    technician: Technician, studio: Any, monkeypatch: pytest.MonkeyPatch, begins: str
) -> None:
    answers, asked = [QMessageBox.StandardButton.Cancel], []

    def answer(_parent: object, _title: str, text: str, *_: object) -> object:
        asked.append(text)
        return answers[0]

    monkeypatch.setattr(QMessageBox, "warning", answer)
    folder = Path(studio.settings.sessions).with_name("<b>sessions")
    technician.program.start_calibration(replace(studio.settings, sessions=str(folder)), "Ada")
    technician.wait_for_page("live")
    window = technician.program.window
    window.go_to("session")
    notes = technician.child(QPlainTextEdit, "")
    technician.wait(notes.isEnabled)
    path = technician.snapshot.session_path
    path.rename(path.with_name("away"))  # as good as a full disk
    notes.setPlainText("wears glasses")
    if begins == "refused before":
        technician.wait(lambda: "Could not save the notes" in technician.banner)
    window.close()
    assert "Could not save the notes" in asked[0]
    assert "&lt;b&gt;sessions" in asked[0]
    assert window.isVisible()
    path.with_name("away").rename(path)  # now there is room
    window.close()
    assert len(asked) == 1
    assert Session.open(path).notes == "wears glasses"


def test_notes_are_saved_once_they_can_be(
    open_program: Callable[[], Technician], studio: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("handcal_gui.calibrate.control.live._SAVE_AGAIN_MS", 50)
    technician = open_program()
    technician.program.start_calibration(studio.settings, "Ada")
    technician.wait_for_page("live")
    technician.program.window.go_to("session")
    notes = technician.child(QPlainTextEdit, "")
    technician.wait(notes.isEnabled)
    path = technician.snapshot.session_path
    away = path.rename(path.with_name("away"))  # as good as a full disk
    notes.setPlainText("wears glasses")
    technician.wait(lambda: "Could not save the notes" in technician.banner)
    away.rename(path)
    technician.wait(lambda: technician.banner == "")
    assert technician.record.notes == "wears glasses"


def test_a_signal_ends_the_program_without_a_question(
    live: Technician, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live.program.window, "may_close", lambda: False)
    live.program.end()
    assert not live.program.window.isVisible()


@pytest.mark.parametrize("leave", ["close", "next wearer"])
def test_a_signal_ends_the_program_while_it_asks(
    live: Technician, monkeypatch: pytest.MonkeyPatch, leave: str
) -> None:
    program = live.program
    monkeypatch.setattr(program.live, "save_notes", lambda: "cannot write")

    def end_once_it_asks() -> None:
        asked = QApplication.activeModalWidget()
        if isinstance(asked, QMessageBox):
            asking.stop()
            QTimer.singleShot(PATIENCE_MS, asked.reject)  # or the test would never end
            program.end()

    asking = QTimer(program, interval=20)
    asking.timeout.connect(end_once_it_asks)
    asking.start()
    leave_now: Callable[[], object] = (
        program.window.close if leave == "close" else program.live.on[Action.NEXT_WEARER]
    )
    leave_now()
    live.wait(lambda: not program.window.isVisible())
    assert program.live.snapshot is None


def test_notes_outlive_an_engine_that_breaks_down(
    live: Technician, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = live.snapshot.session_path
    live.program.window.go_to("session")
    live.wait(lambda: live.child(QPlainTextEdit, "").isEnabled())
    live.child(QPlainTextEdit, "").setPlainText("wears glasses")

    def break_down(_station: Station) -> Snapshot:
        raise ZeroDivisionError("oh")

    monkeypatch.setattr(Station, "step", break_down)
    live.wait_for_page("start")
    assert "unexpected error" in live.banner
    assert Session.open(path).notes == "wears glasses"


def test_an_unexpected_error_is_logged_and_shown(
    technician: Technician, caplog: pytest.LogCaptureFixture
) -> None:
    error = ZeroDivisionError("oh")
    launch._report_error(technician.program, type(error), error, error.__traceback__)
    assert "ZeroDivisionError: oh" in technician.banner
    assert "unexpected error" in caplog.text
    technician.program.show_start()
    technician.wait(lambda: can_start(technician))
