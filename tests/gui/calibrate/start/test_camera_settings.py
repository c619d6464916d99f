"""The camera's settings come back as they went in, are changed one by one, and reset."""

from __future__ import annotations

import pytest
from PySide6.QtWidgets import QCheckBox, QComboBox, QPushButton, QSpinBox
from pytestqt.qtbot import QtBot

from handcal.camera.settings import RealSenseSettings
from handcal_gui.calibrate.start.camera_settings import CameraSettingsDialog
from tests.gui.helpers import child, letters

ALL_SET = RealSenseSettings(
    serial="42",
    profile="848x480",
    preset="high_accuracy",
    exposure_us=12_000.0,
    laser_power_mw=0.0,
    expose_whole_image=True,
    spatial_filter=True,
    temporal_filter=True,
    hole_filling=True,
)


@pytest.mark.parametrize("settings", [RealSenseSettings(), ALL_SET])
def test_untouched_settings_stay_as_they_are(qtbot: QtBot, settings: RealSenseSettings) -> None:
    dialog = CameraSettingsDialog(settings)
    qtbot.addWidget(dialog)
    assert dialog.settings() == settings


def test_what_is_changed_is_returned(qtbot: QtBot) -> None:
    dialog = CameraSettingsDialog(RealSenseSettings(serial="42"))
    qtbot.addWidget(dialog)
    for name, option in (("profile", "848x480"), ("preset", "high_accuracy")):
        field = dialog.findChild(QComboBox, name)
        assert isinstance(field, QComboBox)
        field.setCurrentIndex(field.findData(option))
    for name, value in (("exposure", 12_000), ("laser", 0)):
        number = child(dialog, QSpinBox, name)
        assert not number.text()[0].isdigit(), "left to the camera"
        number.setValue(value)
        assert number.text()[0].isdigit()
    for name in ("wholeImage", "spatial", "temporal", "holes"):
        box = dialog.findChild(QCheckBox, name)
        assert isinstance(box, QCheckBox)
        box.click()
    assert dialog.settings() == ALL_SET


def test_the_defaults_are_restored_but_the_camera_stays_the_same(qtbot: QtBot) -> None:
    dialog = CameraSettingsDialog(ALL_SET)
    qtbot.addWidget(dialog)
    restore = dialog.findChild(QPushButton, "restore")
    assert isinstance(restore, QPushButton)
    restore.click()
    assert dialog.settings() == RealSenseSettings(serial="42")


def test_only_filters_are_read_out_as_filters(qtbot: QtBot) -> None:
    dialog = CameraSettingsDialog(RealSenseSettings())
    qtbot.addWidget(dialog)
    names = {box.objectName(): box.accessibleName() for box in dialog.findChildren(QCheckBox)}
    assert names["wholeImage"] == "Exposure of colour for the whole image"
    assert [name for name, read in names.items() if "filter" in read] == [
        "spatial",
        "temporal",
        "holes",
    ]


def test_every_field_has_a_letter_of_its_own(qtbot: QtBot) -> None:
    dialog = CameraSettingsDialog(RealSenseSettings())
    qtbot.addWidget(dialog)
    found = letters(dialog)
    assert len(set(found)) == len(found)
    for box in dialog.findChildren(QCheckBox):
        assert "&" in box.text()
        assert "&" not in box.accessibleName()
