"""The program's window without a station."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QPushButton
from pytestqt.qtbot import QtBot

from handcal.station.snapshot import Snapshot
from handcal_gui.app.preferences import PreferencesFile
from handcal_gui.app.program import Program
from handcal_gui.calibrate.guide.action_bar import ActionBar
from handcal_gui.calibrate.guide.steps import Wizard
from handcal_gui.calibrate.guide.view import Action, ButtonSpec, Step, WizardView
from handcal_gui.calibrate.window import MainWindow


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


def main_button(window: MainWindow) -> QPushButton:
    found = window.findChild(QPushButton, "wizardMain")
    assert isinstance(found, QPushButton)
    return found


def offer_solve(window: MainWindow) -> None:
    bar = window.findChild(ActionBar)
    assert isinstance(bar, ActionBar)
    bar.show_view(WizardView(Step.SOLVE, "Solve.", (), ButtonSpec(Action.TAKE_STEP, "Solve")))


_NONE = Qt.KeyboardModifier.NoModifier
Maker = Callable[..., Snapshot]


class Saying(Wizard):
    """A wizard that says what it is given."""

    said: WizardView

    def view(self, _snapshot: Snapshot) -> WizardView:
        return self.said


def say(program: Program, snapshot: Snapshot, view: WizardView) -> None:
    program.wizard_panel.wizard = wizard = Saying()
    wizard.said = view
    program.wizard_panel.show_snapshot(snapshot)


def press(window: MainWindow, key: Qt.Key, modifiers: Qt.KeyboardModifier = _NONE) -> None:
    """Press a key as the window system does."""
    # A press in the same millisecond as the last release repeats a key that is held down.
    QTest.qSleep(2)
    QTest.keyClick(window.windowHandle(), key, modifiers)
