"""A path is typed or chosen; giving up the dialog changes nothing."""

from __future__ import annotations

from typing import Any

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QTextDocument
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QFileDialog, QLineEdit, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from handcal_gui.widgets.layouts import vbox
from handcal_gui.widgets.path_field import PathField
from tests.gui.helpers import child, show


def test_a_key_in_the_field_presses_its_buttons(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: ("/a/file.db3", ""))
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: "/a/folder")
    page = QWidget()
    fields = PathField("Recording", "either"), PathField("Results", "folder")
    vbox(*fields, on=page)
    show(qtbot, page, 400, 100)
    page.activateWindow()
    qtbot.waitActive(page)
    none, shift = Qt.KeyboardModifier.NoModifier, Qt.KeyboardModifier.ShiftModifier
    for field, modifier, name, path in (
        (fields[0], none, "F4", "/a/file.db3"),
        (fields[0], shift, "Shift+F4", "/a/folder"),
        (fields[1], none, "F4", "/a/folder"),
    ):
        field.setFocus()
        qtbot.waitUntil(child(field, QLineEdit).hasFocus)
        QTest.keyClick(page.windowHandle(), Qt.Key.Key_F4, modifier)
        assert field.path == path
        tooltips = [one.toolTip() for one in field.findChildren(QPushButton)]
        assert any(f"({name} in the field)" in tooltip for tooltip in tooltips)


@pytest.mark.parametrize("path", ["/a/<b>x</b>", "/a/&lt;b&gt;"])
def test_a_path_like_markup_is_shown_as_it_is(qtbot: QtBot, path: str) -> None:
    field = PathField("Folder", "folder")
    qtbot.addWidget(field)
    field.setToolTip("Explained")
    field.set_path(path)
    document = QTextDocument()
    document.setHtml(child(field, QLineEdit).toolTip())
    assert document.toPlainText().splitlines() == [path, "Explained"]


def test_a_file_or_a_folder_is_chosen_in_a_dialog(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[Any, ...]] = []

    def answer_file(*asked_for: Any) -> tuple[str, str]:
        asked.append(asked_for[1:])
        return "/a/rig.yaml", ""

    monkeypatch.setattr(QFileDialog, "getOpenFileName", answer_file)
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: "")
    file = PathField("Rig file", "file", "Rig files (*.yaml)", "Example")
    folder = PathField("Folder", "folder")
    for field in (file, folder):
        qtbot.addWidget(field)
    button = child(file, QPushButton, "fileChoice")
    with qtbot.waitSignal(file.changed):
        button.click()
    assert file.path == "/a/rig.yaml"
    assert asked == [("Rig file", "", "Rig files (*.yaml)")]
    folder.set_path("/b")
    with qtbot.assertNotEmitted(folder.changed):
        folder.choose_folder()
    assert folder.path == "/b"


def test_blanks_around_a_typed_path_do_not_count(qtbot: QtBot) -> None:
    field = PathField("Rig file", "file")
    qtbot.addWidget(field)
    line = child(field, QLineEdit)
    with qtbot.waitSignal(field.changed):
        line.setText("  /a b ")
    assert field.path == "/a b"
