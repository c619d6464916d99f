from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from handcal_gui.preferences import PreferencesFile
from handcal_gui.program import Program
from handcal_gui.window import MainWindow


@pytest.fixture
def program(qtbot: QtBot, tmp_path: Path) -> Iterator[Program]:
    program = Program(PreferencesFile(tmp_path / "preferences.json"))
    qtbot.addWidget(program.window)
    program.window.resize(1280, 800)
    program.window.show()
    yield program
    program.window.close()


@pytest.fixture
def window(program: Program) -> MainWindow:
    return program.window


def shown(window: MainWindow) -> set[str]:
    return {name for name, dock in window.docks.items() if not dock.isHidden()}


def test_every_page_has_its_docks(window: MainWindow) -> None:
    assert shown(window) == set()
    window.show_page("live")
    assert shown(window) == set(window.docks)
    window.show_page("review")
    assert shown(window) == {"cloud", "results", "trials", "session"}
    assert not window.docks["camera"].toggleViewAction().isEnabled()
    window.show_page("start")
    assert shown(window) == set()


def test_a_dock_closed_stays_closed_on_its_page_until_the_layout_is_reset(
    window: MainWindow,
) -> None:
    window.show_page("live")
    window.docks["link"].close()
    window.show_page("review")
    window.show_page("live")
    assert "link" not in shown(window)
    window.reset_layout()
    assert shown(window) == set(window.docks)


def test_layouts_are_remembered_for_each_page(
    program: Program, qtbot: QtBot, tmp_path: Path
) -> None:
    program.window.show_page("live")
    program.window.docks["camera"].close()
    program.window.show_page("review")
    program.window.docks["cloud"].close()
    program.window.close()
    again = Program(PreferencesFile(tmp_path / "preferences.json"))
    qtbot.addWidget(again.window)
    again.window.show_page("live")
    assert shown(again.window) == set(again.window.docks) - {"camera"}
    again.window.show_page("review")
    assert shown(again.window) == {"results", "trials", "session"}
    again.window.close()


@pytest.mark.parametrize("text", ["", "garbage", "AAAA"])
def test_a_layout_that_does_not_fit_is_left_out(window: MainWindow, text: str) -> None:
    window.restore_layouts({"live": text})
    window.show_page("live")
    assert shown(window) == set(window.docks)


def test_space_asks_for_what_comes_next_and_escape_closes_the_message(
    window: MainWindow, qtbot: QtBot
) -> None:
    window.show_page("live")
    with qtbot.waitSignal(window.space_pressed, timeout=1000):
        QTest.keyClick(window, Qt.Key.Key_Space)
    window.banner.show_message("Could not solve")
    QTest.keyClick(window, Qt.Key.Key_Escape)
    assert window.banner.text == ""


def test_no_key_is_taken_twice(window: MainWindow) -> None:
    keys = [
        action.shortcut().toString()
        for menu in window.menuBar().actions()
        for action in menu.menu().actions()  # type: ignore[attr-defined]
        if not action.shortcut().isEmpty()
    ]
    assert {"Ctrl+N", "Ctrl+O", "Ctrl+E", "F1"} <= set(keys)
    assert len(keys) == len(set(keys))
