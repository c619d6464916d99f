from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QToolButton,
)
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.core.types import EyeDistance
from handcal.register.results import Results
from handcal.session.session import MAX_NOTES_CHARACTERS, Session, SessionRecord
from handcal.session.state import SessionEvent
from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.session.panel import SAVE_MS, SessionPanel
from handcal_gui.widgets.table import Table
from tests.gui.calibrate.conftest import Engine
from tests.gui.helpers import button, child, note_opened, show, text


@pytest.fixture
def panel(qtbot: QtBot, engine: Engine) -> SessionPanel:
    panel = SessionPanel()
    panel.submit = engine
    return show(qtbot, panel, 430, 450)


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
    panel: SessionPanel, record: SessionRecord, results: Results, engine: Engine
) -> None:
    panel.show_record(record, results)
    alignments = child(panel, Table, "alignments")
    alignments.selectRow(1)
    button(panel, QToolButton, "Delete").click()
    engine.station.delete.assert_called_once_with("alignment", 2)
    with Session(record.path) as session:
        session.delete("alignment", 2)
    panel.show_record(Session.open(record.path), None)
    assert alignments.model().rowCount() == 1
    assert text(panel, "undoText") == "Alignment 2 deleted."
    alignments.setFocus()
    QTest.keyClick(alignments, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    engine.station.restore.assert_called_once_with("alignment", 2)
    with Session(record.path) as session:
        session.restore("alignment", 2)
    panel.show_record(Session.open(record.path), None)
    assert alignments.model().rowCount() == 2
    assert text(panel, "undoText") == ""
    assert not button(panel, QToolButton, "Undo").isVisible()


def test_notes_are_saved_a_moment_after_the_last_key_and_at_the_end(
    qtbot: QtBot, panel: SessionPanel, record: SessionRecord
) -> None:
    saved: list[str] = []
    panel.notes.save = saved.append
    edit = child(panel, QPlainTextEdit)
    assert not edit.isEnabled()
    panel.show_record(record, None)
    edit.setPlainText("left")
    edit.setPlainText("left-handed")
    assert text(panel, "notesState") == "Not saved yet"
    assert saved == []
    qtbot.waitUntil(lambda: saved == ["left-handed"], timeout=5 * SAVE_MS)
    panel.show_record(replace(record, notes="left-handed"), None)
    assert (panel.notes.are_saved, text(panel, "notesState")) == (True, "✓ Saved")
    edit.setPlainText("glasses")
    panel.notes.flush()
    assert saved[-1] == "glasses"
    panel.show_record(replace(record, notes="other"), None)
    assert edit.toPlainText() == "glasses", "what is being written is not replaced"


def test_notes_that_are_too_long_are_not_saved_and_say_so(
    panel: SessionPanel, record: SessionRecord
) -> None:
    saved: list[str] = []
    panel.notes.save = saved.append
    panel.show_record(record, None)
    child(panel, QPlainTextEdit).setPlainText("x" * (MAX_NOTES_CHARACTERS + 1))
    panel.notes.flush()
    assert saved == []
    assert "Too long by 1" in text(panel, "notesState")
    panel.set_read_only(True)
    assert child(panel, QPlainTextEdit).isReadOnly()


def test_a_finished_session_is_only_looked_at(panel: SessionPanel, record: SessionRecord) -> None:
    with Session(record.path) as session:
        session.delete("alignment", 2)
        session.finish()
    panel.set_read_only(True)
    panel.show_record(Session.open(record.path), None)
    assert any(text.endswith(", finished") for text in texts(panel))
    child(panel, Table, "alignments").selectRow(0)
    assert not button(panel, QToolButton, "Delete").isEnabled()
    assert text(panel, "undoText") == ""
    assert panel.export_button.isEnabled()
    assert panel.inspect_button.isEnabled()


def test_opens_the_folder(
    panel: SessionPanel, record: SessionRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = note_opened(monkeypatch)
    panel.show_record(record, None)
    button(panel, QPushButton, "Open folder").click()
    assert opened == [record.path]


def test_an_eye_distance_is_taken_in_millimetres_or_refused(
    panel: SessionPanel, record: SessionRecord, results: Results, engine: Engine
) -> None:
    field, problem = (
        child(panel, QLineEdit, "eyeDistance"),
        child(panel, QLabel, "eyeDistanceProblem"),
    )
    assert not field.isEnabled()
    panel.show_record(record, results)
    taken = engine.station.calibration.set_eye_distance

    def asked() -> list[EyeDistance | None]:
        return [call.args[0] for call in taken.mock_calls]

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
    assert asked() == [EyeDistance(0.0635)]
    assert not problem.isVisible()
    assert field.text() == "", "not stored yet"
    for stored, shown, placeholder in (
        (asked()[0], "63.5", "Not measured"),
        (EyeDistance(0.066, source="headset"), "", "66.0 ± 1.0 mm (headset)"),
    ):
        facts = replace(record.facts, eye_distance=stored)
        panel.show_record(replace(record, facts=facts), results)
        assert (field.text(), field.placeholderText()) == (shown, placeholder)
    enter(" ")
    assert asked()[1:] == [None]
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert len(asked()) == 2, "unchanged"
    panel.set_read_only(True)
    assert not field.isEnabled()
