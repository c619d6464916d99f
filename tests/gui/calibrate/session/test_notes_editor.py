from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QPlainTextEdit
from pytestqt.qtbot import QtBot

from handcal.session.session import MAX_NOTES_CHARACTERS
from handcal_gui.calibrate.session.panel import SAVE_MS, NotesEditor

ONE, OTHER = Path("one"), Path("other")


@pytest.fixture
def notes(qtbot: QtBot) -> NotesEditor:
    notes = NotesEditor()
    qtbot.addWidget(notes)
    return notes


@pytest.fixture
def edit(notes: NotesEditor) -> QPlainTextEdit:
    [edit] = notes.findChildren(QPlainTextEdit)
    return edit


def state(notes: NotesEditor) -> str:
    [label] = notes.findChildren(QLabel, "notesState")
    return label.text()


def test_nothing_can_be_written_without_a_session(notes: NotesEditor, edit: QPlainTextEdit) -> None:
    assert not edit.isEnabled()
    assert state(notes) == ""


def test_saves_once_after_the_last_key(
    qtbot: QtBot, notes: NotesEditor, edit: QPlainTextEdit
) -> None:
    notes.show_saved(ONE, "")
    assert state(notes) == ""  # there is nothing to save
    [label] = notes.findChildren(QLabel, "notesState")
    assert label.isHidden()
    asked: list[str] = []
    notes.changed.connect(asked.append)
    QTest.keyClicks(edit, "with glasses")
    assert asked == []
    assert state(notes) == "Not saved yet"
    qtbot.waitUntil(lambda: bool(asked), timeout=5 * SAVE_MS)
    assert asked == ["with glasses"]
    notes.show_saved(ONE, "with glasses")
    assert state(notes) == "✓ Saved"


def test_what_is_being_written_is_not_replaced(notes: NotesEditor, edit: QPlainTextEdit) -> None:
    notes.show_saved(ONE, "a")
    QTest.keyClicks(edit, "b")
    notes.show_saved(ONE, "a")
    assert edit.toPlainText() == "ba"
    notes.show_saved(OTHER, "c")
    assert edit.toPlainText() == "c"
    assert state(notes) == "✓ Saved"


def test_flush_saves_at_once_what_was_written(
    qtbot: QtBot, notes: NotesEditor, edit: QPlainTextEdit
) -> None:
    notes.show_saved(ONE, "")
    with qtbot.assertNotEmitted(notes.changed):
        notes.flush()
    edit.setPlainText("b")
    with qtbot.waitSignal(notes.changed) as asked:
        notes.flush()
    assert asked.args == ["b"]


def test_flush_tries_again_what_could_not_be_saved(
    qtbot: QtBot, notes: NotesEditor, edit: QPlainTextEdit
) -> None:
    notes.show_saved(ONE, "a")
    asked: list[str] = []
    notes.changed.connect(asked.append)
    edit.setPlainText("b")
    qtbot.waitUntil(lambda: bool(asked), timeout=5 * SAVE_MS)
    notes.show_saved(ONE, "a")  # the disk was full
    for _ in range(2):
        notes.flush()
    assert asked == ["b", "b"]


@pytest.mark.parametrize("stored", ["a\r\nb", "a\u00a0b", "a\u2028b"])
def test_flush_leaves_notes_that_nobody_edited(
    qtbot: QtBot, notes: NotesEditor, stored: str
) -> None:
    notes.show_saved(ONE, stored)
    with qtbot.assertNotEmitted(notes.changed):
        notes.flush()
    notes.show_saved(ONE, stored)
    assert state(notes) == "✓ Saved"


def test_too_long_notes_are_told_and_not_saved(
    qtbot: QtBot, notes: NotesEditor, edit: QPlainTextEdit
) -> None:
    notes.show_saved(ONE, "")
    edit.setPlainText("x" * (MAX_NOTES_CHARACTERS + 3))
    assert "3 characters" in state(notes)
    with qtbot.assertNotEmitted(notes.changed):
        notes.flush()


def test_what_is_only_read_cannot_be_written(notes: NotesEditor, edit: QPlainTextEdit) -> None:
    notes.show_saved(ONE, "a")
    notes.set_read_only(True)
    QTest.keyClicks(edit, "b")
    assert edit.toPlainText() == "a"
    assert state(notes) == "This session is only shown. To write notes, resume it."
    notes.show_saved(OTHER, "")
    assert edit.placeholderText() == "This session is only shown. To write notes, resume it."
    assert state(notes) == ""
