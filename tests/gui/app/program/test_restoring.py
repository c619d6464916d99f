"""The window as it was left, restored by the next start."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtWidgets import QComboBox, QSpinBox
from pytestqt.qtbot import QtBot

from handcal.station.settings import StationSettings
from handcal_gui.app import separate_windows
from handcal_gui.app.preferences import HIDDEN_LAYERS, Preferences, PreferencesFile
from handcal_gui.app.preferences_dialog import PreferencesDialog
from handcal_gui.app.program import Program
from tests.gui.helpers import child


def test_a_maximized_window_and_its_layout_are_restored(qtbot: QtBot, tmp_path: Path) -> None:
    file = PreferencesFile(tmp_path / "preferences.json")
    program = Program(file)
    qtbot.addWidget(program.window)
    program.window.showMaximized()
    layout = program.window.layout_text().replace('"chosen": {}', '"chosen": {"cloud": true}')
    program.window.restore_layout(layout)
    program.close()
    program = Program(file)
    qtbot.addWidget(program.window)
    assert program.window.isMaximized()
    assert program.window.layout_text() == layout
    program.close()


def test_hidden_layers_of_the_hand_cloud_are_remembered(qtbot: QtBot, tmp_path: Path) -> None:
    file = PreferencesFile(tmp_path / "preferences.json")
    for hidden in (HIDDEN_LAYERS, ("cursor",)):
        program = Program(file)
        qtbot.addWidget(program.window)
        assert program.window.panels.cloud.hidden_layers == hidden
        program.window.panels.cloud.hide_layers(("cursor",))
        program.close()


def test_settings_for_one_run_are_not_remembered(qtbot: QtBot, tmp_path: Path) -> None:
    file = PreferencesFile(tmp_path / "preferences.json")
    file.save(Preferences(station=StationSettings(seed=1)))
    program = Program(file)
    qtbot.addWidget(program.window)
    for_once = replace(program.preferences.station, seed=7)  # as by --seed 7
    program.use_for_one_run(for_once)
    program.show_start()
    assert program.start.new.settings.seed == 7
    program.close()
    assert file.load()[0].station.seed == 1


def test_the_preferences_keep_what_is_typed_and_the_settings_of_one_run(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def use_dark_theme(dialog: PreferencesDialog) -> bool:
        theme = child(dialog, QComboBox, "theme")
        theme.setCurrentIndex(theme.findData("dark"))
        return True

    monkeypatch.setattr(PreferencesDialog, "exec", use_dark_theme)
    monkeypatch.setattr(separate_windows, "use_theme", lambda _theme: None)
    file = PreferencesFile(tmp_path / "preferences.json")
    file.save(Preferences(station=StationSettings(seed=1)))
    program = Program(file)
    qtbot.addWidget(program.window)
    program.use_for_one_run(replace(program.preferences.station, seed=7))
    wearer = child(program.start, QComboBox, "wearer")
    wearer.setEditText("P 07")
    program.start.new.form.set_rig(str(tmp_path / "rig.yaml"))
    program.windows.edit_preferences()
    shown = program.start.new.settings
    assert (shown.seed, shown.rig) == (7, str(tmp_path / "rig.yaml"))
    assert wearer.currentText() == "P 07"
    stored = file.load()[0]
    assert (stored.theme, stored.station.seed) == ("dark", 1)
    assert stored.station.rig == str(tmp_path / "rig.yaml")
    for seed in (8, 7):  # chosen now, though it is that of the run
        child(program.start, QSpinBox, "seed").setValue(seed)
        program.show_start()
        assert file.load()[0].station.seed == seed
    program.close()
