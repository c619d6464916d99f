from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QTabWidget,
    QToolButton,
)
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.core.types import EyeDistance, Rig
from handcal.register.results import Results
from handcal.session.session import Session, SessionRecord
from handcal.session.state import SessionEvent
from handcal.session.trial import make_trial
from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.session.panel import SessionPanel
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.table import Table
from tests.gui.helpers import button, child, note_opened, show, text


@pytest.fixture
def panel(qtbot: QtBot) -> SessionPanel:
    return show(qtbot, SessionPanel(), 430, 450)


def cell(table: Table, row: int, column: int) -> str:
    return str(table.model().index(row, column).data())


def texts(panel: SessionPanel) -> list[str]:
    return [label.text() for label in panel.findChildren(QLabel)]


def test_empty(panel: SessionPanel) -> None:
    assert any("Start or open a session" in text for text in texts(panel))
    assert not button(panel, QPushButton, "Open folder").isEnabled()
    assert not button(panel, QPushButton, "Export…").isEnabled()


def test_shows_the_session_of_a_snapshot(
    panel: SessionPanel, snapshot: Callable[..., Snapshot], record: SessionRecord
) -> None:
    panel.show_snapshot(snapshot(State.SOLVED))
    assert str(record.path) in texts(panel)
    alignments = child(panel, Table, "alignments")
    assert alignments.model().rowCount() == 2
    assert "–" not in [cell(alignments, 0, column) for column in range(8)]
    panel.show_snapshot(snapshot(State.ALIGN))
    assert cell(alignments, 0, 3) == "–", "the results are gone"


def test_the_numbers_of_a_tab_are_explained_while_there_are_any(
    panel: SessionPanel, record: SessionRecord
) -> None:
    def seen(shown: SessionRecord) -> list[str]:
        panel.show_record(shown, None)
        tabs, found = child(panel, QTabWidget), []
        for tab in range(3):
            tabs.setCurrentIndex(tab)
            notes = (one.text() for one in panel.findChildren(ElidedLabel) if one.isVisible())
            found.append(next((one for one in notes if "φ" in one), ""))
        return found

    alone = "φ of each alignment alone; the result is in Results"
    assert seen(replace(record, trials={})) == [alone, "", ""]
    trial = make_trial(record.rig.eyes["left"], "left", 0.4, np.zeros(3), [1e-3, 0.0, 0.0])
    error = "Error: between the calibrated φ and the fine-tuned one"
    assert seen(replace(record, trials={1: trial})) == [alone, error, ""]
    assert seen(replace(record, alignments={}, trials={})) == ["", "", ""]


def test_alignments_that_are_not_written_yet_are_counted(
    panel: SessionPanel, snapshot: Callable[..., Snapshot], record: SessionRecord
) -> None:
    told = child(panel, QLabel, "unwritten")
    panel.show_snapshot(snapshot(State.SOLVED))
    assert not told.isVisible()
    saved = [event for event in record.events if event.name == SessionEvent.ALIGNMENT_SAVED]
    unwritten = replace(record, unwritten=(saved[-1],))
    panel.show_snapshot(snapshot(State.SOLVED, record=unwritten))
    assert (told.text(), told.isVisible()) == ("1 alignment not written yet.", True)
    panel.show_snapshot(snapshot(State.SOLVED))
    assert not told.isVisible()


def test_an_unchanged_session_is_not_shown_again(
    panel: SessionPanel, snapshot: Callable[..., Snapshot], monkeypatch: pytest.MonkeyPatch
) -> None:
    panel.show_snapshot(snapshot(State.SOLVED))
    shown: list[SessionRecord] = []
    monkeypatch.setattr(panel, "show_record", lambda record, _results: shown.append(record))
    panel.show_snapshot(snapshot(State.SOLVED, number=2))
    assert shown == []


def test_deletes_and_takes_back(
    qtbot: QtBot, panel: SessionPanel, record: SessionRecord, results: Results
) -> None:
    panel.show_record(record, results)
    alignments = child(panel, Table, "alignments")
    alignments.selectRow(1)
    with qtbot.waitSignal(panel.delete_requested) as asked:
        button(panel, QToolButton, "Delete").click()
    assert asked.args == ["alignment", 2]
    with Session(record.path) as session:
        session.delete("alignment", 2)
    panel.show_record(Session.open(record.path), None)
    assert alignments.model().rowCount() == 1
    assert text(panel, "undoText") == "Alignment 2 deleted."
    alignments.setFocus()
    with qtbot.waitSignal(panel.restore_requested) as asked:
        QTest.keyClick(alignments, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert asked.args == ["alignment", 2]
    with Session(record.path) as session:
        session.restore("alignment", 2)
    panel.show_record(Session.open(record.path), None)
    assert alignments.model().rowCount() == 2
    assert text(panel, "undoText") == ""
    assert not button(panel, QToolButton, "Undo").isVisible()


def test_deletes_trials_and_takes_back(
    qtbot: QtBot, panel: SessionPanel, record: SessionRecord, rig: Rig
) -> None:
    with Session(record.path) as session:
        trial = make_trial(rig.eyes["left"], "left", 0.4, np.zeros(3), [0.001, 0.0, 0.0])
        for _ in range(2):
            session.save_trial(trial)
        session.delete("trial", 2)
    panel.show_record(Session.open(record.path), None)
    [tabs] = panel.findChildren(QTabWidget)
    tabs.setCurrentIndex(1)
    child(panel, Table, "trials-of-the-session").selectRow(0)
    with qtbot.waitSignal(panel.delete_requested) as asked:
        button(panel, QToolButton, "Delete").click()
    assert asked.args == ["trial", 1]
    with qtbot.waitSignal(panel.restore_requested) as asked:
        button(panel, QToolButton, "Undo").click()
    assert asked.args == ["trial", 2]
    tabs.setCurrentIndex(2)
    assert not button(panel, QToolButton, "Delete").isVisible()


def test_notes_are_passed_on(qtbot: QtBot, panel: SessionPanel, record: SessionRecord) -> None:
    panel.show_record(record, None)
    [edit] = panel.findChildren(QPlainTextEdit)
    edit.setPlainText("left-handed")
    with qtbot.waitSignal(panel.notes_changed) as asked:
        panel.flush()
    assert asked.args == ["left-handed"]


def test_a_finished_session_is_only_looked_at(
    qtbot: QtBot, panel: SessionPanel, record: SessionRecord
) -> None:
    with Session(record.path) as session:
        session.delete("alignment", 2)
        session.finish()
    panel.set_read_only(True)
    panel.show_record(Session.open(record.path), None)
    assert any(text.endswith(", finished") for text in texts(panel))
    child(panel, Table, "alignments").selectRow(0)
    assert not button(panel, QToolButton, "Delete").isEnabled()
    assert text(panel, "undoText") == ""
    with qtbot.waitSignal(panel.export_requested):
        button(panel, QPushButton, "Export…").click()
    with qtbot.waitSignal(panel.inspect_requested):
        button(panel, QPushButton, "Inspect in 3D").click()


def test_opens_the_folder(
    panel: SessionPanel, record: SessionRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = note_opened(monkeypatch)
    panel.show_record(record, None)
    button(panel, QPushButton, "Open folder").click()
    assert opened == [record.path]


def test_an_eye_distance_is_taken_in_millimetres_or_refused(
    qtbot: QtBot, panel: SessionPanel, record: SessionRecord, results: Results
) -> None:
    field, problem = (
        child(panel, QLineEdit, "eyeDistance"),
        child(panel, QLabel, "eyeDistanceProblem"),
    )
    assert not field.isEnabled()
    panel.show_record(record, results)
    asked: list[EyeDistance | None] = []
    panel.eye_distance_changed.connect(asked.append)

    def enter(text: str) -> None:
        field.selectAll()
        QTest.keyClick(field, Qt.Key.Key_Delete)
        QTest.keyClicks(field, text)
        QTest.keyClick(field, Qt.Key.Key_Return)

    for wrong in ("0.063", "90", "wide", "nan"):
        enter(wrong)
        assert problem.isVisible()
        assert "enter 45 to 85 mm" in problem.text()
        panel.show_record(record, results)
        assert field.text() == wrong, "what is being corrected is not replaced"
    enter("63,5")
    assert asked == [EyeDistance(0.0635)]
    assert not problem.isVisible()
    assert field.text() == "", "not stored yet"
    for stored, shown, placeholder in (
        (asked[0], "63.5", "Not measured"),
        (EyeDistance(0.066, source="headset"), "", "66.0 ± 1.0 mm (headset)"),
    ):
        facts = replace(record.facts, eye_distance=stored)
        panel.show_record(replace(record, facts=facts), results)
        assert (field.text(), field.placeholderText()) == (shown, placeholder)
    enter(" ")
    assert asked[1:] == [None]
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert len(asked) == 2, "unchanged"
    panel.set_read_only(True)
    assert not field.isEnabled()
