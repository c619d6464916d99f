"""The list of keys: grouped, searched and printed; it leaves the window usable."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtPrintSupport import QPrinter
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QLineEdit, QTreeWidget
from pytestqt.qtbot import QtBot

from handcal_gui.app.keys import keys_by_group
from handcal_gui.app.keys_dialog import KeysDialog, keys_html
from handcal_gui.calibrate.window import MainWindow
from tests.gui.helpers import child, letters, show


@pytest.fixture
def dialog(qtbot: QtBot, window: MainWindow) -> KeysDialog:
    dialog = KeysDialog(window)
    assert dialog.height() <= 490, "fits 960x510 with its frame"
    return show(qtbot, dialog, dialog.width(), dialog.height())


def listed(dialog: KeysDialog) -> dict[str, list[str]]:
    """Return the keys in sight by their headings."""
    tree = child(dialog, QTreeWidget, "keys")
    headings = [tree.topLevelItem(i) for i in range(tree.topLevelItemCount())]
    return {
        heading.text(0): [
            row.text(0)
            for k in range(heading.childCount())
            if (row := heading.child(k)) and not row.isHidden()
        ]
        for heading in headings
        if heading and not heading.isHidden()
    }


def test_headings_say_where_keys_work(dialog: KeysDialog) -> None:
    shown = listed(dialog)
    assert "Space" in shown["Window: works everywhere"]
    assert {"H", "Ctrl+P"} <= {*shown["Guide: works during a calibration"]}
    assert "F11" in shown["View: a menu; works everywhere"]
    assert {"F", "T"} <= {*shown["Guide: works during a calibration"]}, "of a panel, but anywhere"
    assert "M" in shown["Camera: a panel; works while it has the keyboard focus"]


def test_esc_also_closes_windows_and_each_button_has_a_letter(dialog: KeysDialog) -> None:
    (esc,) = child(dialog, QTreeWidget, "keys").findItems("Esc", Qt.MatchFlag.MatchRecursive)
    assert esc.text(1) == "Close the message, or a dialog or window opened from here"
    assert letters(dialog) == ["p", "c"]


def test_words_are_searched_in_keys_effects_and_headings(dialog: KeysDialog) -> None:
    search = child(dialog, QLineEdit, "keysSearch")
    search.setText("outline far")
    (keys,) = listed(dialog).values()
    assert keys == ["Shift+Left", "Shift+Right", "Shift+Up", "Shift+Down"]
    search.setText("hand cloud zoom")
    assert list(listed(dialog).values()) == [["+, =", "-"]]
    nothing = child(dialog, QLabel, "noKeys")
    assert nothing.isHidden()
    search.setText("no such key")
    assert nothing.isVisible()
    search.clear()
    assert nothing.isHidden()
    assert len(listed(dialog)) > 5


def test_all_keys_are_printed(dialog: KeysDialog, window: MainWindow, tmp_path: Path) -> None:
    printer = QPrinter(QPrinter.PrinterMode.HighResolution)
    printer.setOutputFileName(str(tmp_path / "keys.pdf"))
    dialog.print_to(printer)
    assert (tmp_path / "keys.pdf").read_bytes().startswith(b"%PDF")
    printed = keys_html(keys_by_group(window))
    for keys in listed(dialog).values():
        assert all(f"<b>{one}</b>" in printed for one in keys)


def test_enter_in_the_search_does_not_print(dialog: KeysDialog, qtbot: QtBot) -> None:
    with qtbot.waitSignal(dialog.accepted):
        QTest.keyClick(child(dialog, QLineEdit, "keysSearch"), Qt.Key.Key_Return)


def test_the_menu_shows_one_list_beside_the_window(window: MainWindow) -> None:
    [action] = [one for one in window.findChildren(QAction) if one.text() == "&Keys"]
    for _ in range(2):
        action.trigger()
    [shown] = [one for one in window.findChildren(KeysDialog) if one.isVisible()]
    assert not shown.isModal()
    shown.close()
