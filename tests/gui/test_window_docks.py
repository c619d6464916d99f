"""The window's docks: their titles, who is in front, the keyboard."""

from __future__ import annotations

import json
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
def window(qtbot: QtBot, tmp_path: Path) -> Iterator[MainWindow]:
    path = tmp_path / "preferences.json"
    path.write_text(json.dumps({"station": {"sessions": str(tmp_path)}}))
    program = Program(PreferencesFile(path), remembers=False)
    program.window.resize(1280, 800)
    program.window.show()
    program.window.show_page("live")
    qtbot.waitExposed(program.window)
    yield program.window
    program.window.close()
    program.close()


def has_title(window: MainWindow, name: str) -> bool:
    return window.docks[name].titleBarWidget() is None


def is_in_front(window: MainWindow, name: str) -> bool:
    return not window.docks[name].visibleRegion().isEmpty()


def test_a_dock_has_a_title_unless_its_tab_says_the_same(qtbot: QtBot, window: MainWindow) -> None:
    assert [name for name in window.docks if not has_title(window, name)] == list(TABBED)
    window.docks["link"].setFloating(True)
    qtbot.waitUntil(lambda: has_title(window, "link"))
    assert not has_title(window, "trials")
    for name in ("fine_tune", "trials", "session"):
        window.docks[name].hide()
    qtbot.waitUntil(lambda: has_title(window, "results"))


def test_the_wizard_has_the_room_it_needs(window: MainWindow) -> None:
    wizard = window.centralWidget()
    assert wizard is not None
    assert wizard.height() > wizard.sizeHint().height()
    assert window.docks["camera"].width() >= 350


def test_a_step_brings_up_its_panel_but_not_over_work(qtbot: QtBot, window: MainWindow) -> None:
    window.bring_up("session")
    qtbot.waitUntil(lambda: is_in_front(window, "session"))
    window.go_to("fine_tune")
    qtbot.waitUntil(lambda: is_in_front(window, "fine_tune"))
    window.bring_up("results")
    assert is_in_front(window, "fine_tune")


def test_panels_are_reached_by_keys(qtbot: QtBot, window: MainWindow) -> None:
    window.activateWindow()
    qtbot.waitActive(window)
    QTest.keyClick(window, Qt.Key.Key_7, Qt.KeyboardModifier.ControlModifier)
    qtbot.waitUntil(lambda: is_in_front(window, "trials"))
    assert window.panels.trials.hasFocus()
    window.show_page("start")
    QTest.keyClick(window, Qt.Key.Key_7, Qt.KeyboardModifier.ControlModifier)
    assert not is_in_front(window, "trials")
