"""The preferences dialog changes what it shows and nothing else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtWidgets import (
    QAbstractSpinBox,
    QApplication,
    QCheckBox,
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QDoubleSpinBox,
    QLabel,
    QPushButton,
    QSpinBox,
    QWidget,
)
from pytestqt.qtbot import QtBot

from handcal.bridge.bridges import BridgeSettings
from handcal.station.settings import StationSettings
from handcal_gui.app.preferences import Preferences
from handcal_gui.app.preferences_dialog import PreferencesDialog
from handcal_gui.widgets.path_field import PathField
from tests.gui.helpers import child, letters, show

BEFORE = Preferences(
    station=StationSettings(source="realsense", port=50_000, sessions="/a"),
    sessions=("/s",),
    theme="light",
)


def test_untouched_preferences_stay_as_they_are(qtbot: QtBot) -> None:
    dialog = PreferencesDialog(BEFORE)
    qtbot.addWidget(dialog)
    assert dialog.preferences() == BEFORE


def test_an_address_typed_into_the_file_is_kept(qtbot: QtBot) -> None:
    before = replace(BEFORE, bridges=BridgeSettings("192.0.2.1"))
    dialog = PreferencesDialog(before)
    qtbot.addWidget(dialog)
    assert dialog.preferences() == before


def test_what_is_changed_is_returned(qtbot: QtBot) -> None:
    dialog = PreferencesDialog(BEFORE)
    qtbot.addWidget(dialog)
    theme, folder = dialog.findChild(QComboBox, "theme"), dialog.findChild(PathField)
    guard = dialog.findChild(QDoubleSpinBox, "guard")
    assert isinstance(theme, QComboBox)
    assert isinstance(folder, PathField)
    assert isinstance(guard, QDoubleSpinBox)
    theme.setCurrentIndex(theme.findData("dark"))
    folder.set_path("/b")
    guard.setValue(10.5)
    target, learn = (
        dialog.findChild(QDoubleSpinBox, "target"),
        dialog.findChild(QComboBox, "learnPrior"),
    )
    assert isinstance(target, QDoubleSpinBox)
    assert isinstance(learn, QComboBox)
    target.setValue(6.5)
    assert learn.currentText() == "Where eyes are"
    learn.setCurrentIndex(learn.findText("All of it, even if far"))
    station = dialog.preferences().station
    assert (station.learn_prior, station.use_far_prior, station.learn_wearers) == (True,) * 3
    learn.setCurrentIndex(learn.findText("Nothing"))
    slicer, port = dialog.findChild(QComboBox, "slicer"), dialog.findChild(QSpinBox, "slicerPort")
    lsl = dialog.findChild(QCheckBox, "lsl")
    assert isinstance(slicer, QComboBox)
    assert isinstance(port, QSpinBox)
    assert isinstance(lsl, QCheckBox)
    assert not port.isEnabled()
    slicer.setCurrentIndex(slicer.findText("For this computer"))
    assert port.isEnabled()
    port.setValue(20_000)
    lsl.click()
    after = dialog.preferences()
    assert after.bridges == BridgeSettings("127.0.0.1", 20_000, lsl=True)
    assert after.theme == "dark"
    assert after.station.sessions == "/b"
    assert np.degrees(after.station.calibration.guard.limit_rad) == 10.5
    assert after.station.calibration.solve.verdict.target_arcmin == 6.5
    assert not after.station.learn_prior
    station = replace(
        after.station, sessions="/a", learn_prior=True, calibration=BEFORE.station.calibration
    )
    assert replace(after, theme="light", station=station, bridges=BEFORE.bridges) == BEFORE
    folder.set_path("")  # no folder is no choice
    assert dialog.preferences().station.sessions == "/a"


def _middle(widget: QWidget, dialog: QWidget) -> int:
    return widget.mapTo(dialog, widget.rect().center()).y()


@pytest.fixture
def opened(qtbot: QtBot, tmp_path: Path) -> PreferencesDialog:
    station = replace(BEFORE.station, sessions=str(tmp_path))
    dialog = PreferencesDialog(replace(BEFORE, station=station))
    qtbot.addWidget(dialog)
    show(qtbot, dialog, dialog.width(), dialog.height())
    return dialog


def test_a_gate_without_room_for_a_hand_is_refused_beside_it(opened: PreferencesDialog) -> None:
    near, far = (child(opened, QDoubleSpinBox, name) for name in ("gateNear", "gateFar"))
    found, ok = child(opened, QLabel, "gateFound"), _button(opened, "Ok")
    fields = [one for one in opened.findChildren(QAbstractSpinBox) if one.isVisible()]
    assert ok.isEnabled()
    assert not found.isVisible()
    QApplication.processEvents()
    before = [_middle(one, opened) for one in fields], opened.height()
    far.setValue(0.95)
    near.setValue(0.9)
    assert found.isVisible()
    for _ in range(3):  # a layout may ask for another
        QApplication.processEvents()
    assert ([_middle(one, opened) for one in fields], opened.height()) == before, "moved"
    assert found.height() >= found.heightForWidth(found.width()), "cut off"
    assert "0.90 to 0.95 m, leaves a hand too little room" in found.text()
    assert not ok.isEnabled()
    _button(opened, "RestoreDefaults").click()
    assert (near.value(), far.value()) == (0.35, 0.7)
    assert not found.isVisible()


def test_defaults_are_shown_and_taken_only_by_ok(opened: PreferencesDialog) -> None:
    before = opened.preferences()
    child(opened, QDoubleSpinBox, "target").setValue(3.0)
    _button(opened, "RestoreDefaults").click()
    defaults, shown = Preferences(), opened.preferences()
    assert shown.theme == defaults.theme != before.theme
    assert shown.station.sessions == defaults.station.sessions
    assert shown.station.calibration == defaults.station.calibration
    assert shown.station.source == before.station.source, "not one of the fields"
    opened.reject()
    assert opened.result() == QDialog.DialogCode.Rejected


def _button(dialog: PreferencesDialog, name: str) -> QPushButton:
    box = child(dialog, QDialogButtonBox)
    return box.button(QDialogButtonBox.StandardButton[name])


def test_every_field_has_a_letter_of_its_own(qtbot: QtBot) -> None:
    dialog = PreferencesDialog(BEFORE)
    qtbot.addWidget(dialog)
    found = letters(dialog)
    assert len(set(found)) == len(found) >= 13
