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

TABBED = ("results", "fine_tune", "trials", "session", "link")


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


def has_title(window: MainWindow, name: str) -> bool:
    return window.docks[name].titleBarWidget() is None


def is_in_front(window: MainWindow, name: str) -> bool:
    return not window.docks[name].visibleRegion().isEmpty()


def test_a_dock_has_a_title_unless_its_tab_says_the_same(qtbot: QtBot, window: MainWindow) -> None:
    window.show_page("live")
    assert [name for name in window.docks if not has_title(window, name)] == list(TABBED)
    window.docks["link"].setFloating(True)
    qtbot.waitUntil(lambda: has_title(window, "link"))
    assert not has_title(window, "trials")
    for name in ("fine_tune", "trials", "session"):
        window.docks[name].hide()
    qtbot.waitUntil(lambda: has_title(window, "results"))


def test_the_space_bar_is_the_wizards_in_a_dock_of_its_own_too(
    qtbot: QtBot, window: MainWindow
) -> None:
    window.show_page("live")
    dock = window.docks["link"]
    dock.setFloating(True)
    with qtbot.waitSignal(window.space_pressed, timeout=1000):
        QTest.keyClick(dock.widget(), Qt.Key.Key_Space)
    window.banner.show_message("Could not solve")
    QTest.keyClick(dock.widget(), Qt.Key.Key_Escape)
    assert window.banner.text == ""


def test_the_wizard_has_the_room_it_needs(window: MainWindow) -> None:
    window.show_page("live")
    wizard = window.centralWidget()
    assert wizard is not None
    assert wizard.height() > wizard.sizeHint().height()
    assert window.docks["camera"].width() >= 350


def test_a_step_brings_up_its_panel_but_not_over_work(qtbot: QtBot, window: MainWindow) -> None:
    window.show_page("live")
    window.bring_up("session")
    qtbot.waitUntil(lambda: is_in_front(window, "session"))
    window.go_to("fine_tune")
    qtbot.waitUntil(lambda: is_in_front(window, "fine_tune"))
    window.bring_up("results")
    assert is_in_front(window, "fine_tune")


def test_panels_are_reached_by_keys(qtbot: QtBot, window: MainWindow) -> None:
    window.show_page("live")
    window.activateWindow()
    qtbot.waitActive(window)
    QTest.keyClick(window, Qt.Key.Key_7, Qt.KeyboardModifier.ControlModifier)
    qtbot.waitUntil(lambda: is_in_front(window, "trials"))
    assert window.panels.trials.hasFocus()
    window.show_page("start")
    QTest.keyClick(window, Qt.Key.Key_7, Qt.KeyboardModifier.ControlModifier)
    assert not is_in_front(window, "trials")
