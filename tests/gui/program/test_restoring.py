"""The window as it was left, restored by the next start."""

from __future__ import annotations

import base64
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QByteArray
from PySide6.QtWidgets import QMainWindow
from pytestqt.qtbot import QtBot

from handcal.station.settings import StationSettings
from handcal_gui.preferences import Preferences, PreferencesFile
from handcal_gui.program import Program
from handcal_gui.window import MainWindow


def test_layouts_are_restored_before_the_window_is_maximized(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else Qt keeps each layout, with tab bars that are deleted meanwhile, and crashes."""
    left = QMainWindow()
    qtbot.addWidget(left)
    left.showMaximized()
    geometry = base64.b64encode(left.saveGeometry().data()).decode()
    file = PreferencesFile(tmp_path / "preferences.json")
    file.save(Preferences(geometry=geometry))
    states: list[bool] = []

    def restore(window: MainWindow, state: QByteArray, version: int = 0) -> bool:
        states.append(window.isMaximized())
        return QMainWindow.restoreState(window, state, version)

    monkeypatch.setattr(MainWindow, "restoreState", restore)
    program = Program(file)
    qtbot.addWidget(program.window)
    assert states
    assert not any(states)
    assert program.window.isMaximized()
    program.close()


def test_settings_for_one_run_are_not_remembered(qtbot: QtBot, tmp_path: Path) -> None:
    file = PreferencesFile(tmp_path / "preferences.json")
    file.save(Preferences(station=StationSettings(seed=1)))
    program = Program(file)
    qtbot.addWidget(program.window)
    for_once = replace(program.preferences.station, seed=7)  # as by --seed 7
    program.start.show_preferences(replace(program.preferences, station=for_once))
    program.close()
    assert file.load()[0].station.seed == 1
