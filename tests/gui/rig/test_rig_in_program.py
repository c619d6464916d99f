"""The way into the rig wizard, and out of it with a rig."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QPushButton
from pytestqt.qtbot import QtBot

from handcal.rig.example import example_rig
from handcal_gui.app.manual import Manual
from handcal_gui.app.preferences import PreferencesFile
from handcal_gui.app.program import Program
from handcal_gui.rig.wizard import RigWizard
from tests.gui.rig.wizard_steps import LEFT, RESULT, child


@pytest.fixture
def program(qtbot: QtBot, tmp_path: Path) -> Iterator[Program]:
    file = PreferencesFile(tmp_path / "config" / "preferences.json")
    (tmp_path / "config").mkdir()
    program = Program(file)
    qtbot.addWidget(program.window)
    program.window.show()
    yield program
    program.window.close()


def test_the_start_page_leads_to_a_rig_that_it_uses(program: Program, tmp_path: Path) -> None:
    program.start.new.form.calibrate_rig.click()
    (wizard,) = program.window.findChildren(RigWizard)
    assert wizard.isVisible()
    assert (tmp_path / "config" / "rig").is_dir()
    path = tmp_path / "ours.yaml"
    wizard.project.save_rig_as(path)
    wizard.show_step(RESULT)
    child(wizard, QPushButton, "useRig").click()
    assert program.start.new.settings.rig == str(path)
    assert program.preferences.station.rig == str(path)
    program.window.close()
    assert not wizard.isVisible()
    assert (tmp_path / "config" / "rig" / "work.json").exists()


def test_the_rig_is_named_as_soon_as_the_wizard_is_closed(
    qtbot: QtBot, program: Program, tmp_path: Path
) -> None:
    [found] = program.window.findChildren(QLabel, "rigFound")
    qtbot.waitUntil(lambda: "Example" in found.text())
    wizard = program.windows.calibrate_rig()
    assert wizard is not None
    path = tmp_path / "ours.yaml"
    wizard.project.use_rig(replace(example_rig(), name="Rig 7"))
    wizard.project.save_rig_as(path)
    wizard.show_step(RESULT)
    child(wizard, QPushButton, "useRig").click()
    settle, again = (program.start.new.findChildren(QTimer)[place] for place in (0, 1))
    qtbot.waitUntil(lambda: not settle.isActive())
    again.stop()
    wizard.accept()
    qtbot.waitUntil(lambda: "Rig 7" in found.text(), timeout=2000)


def test_a_missing_folder_is_reported_with_the_reason(program: Program, tmp_path: Path) -> None:
    (tmp_path / "config" / "rig").touch()
    assert program.windows.calibrate_rig() is None
    assert "cannot create the folder" in program.window.banner.text


def test_a_link_shows_what_the_file_of_poses_contains_in_a_manual_that_can_be_used(
    qtbot: QtBot, program: Program
) -> None:
    wizard = program.windows.calibrate_rig()
    assert wizard is not None
    wizard.show_step(LEFT)
    with qtbot.waitActive(wizard):
        wizard.activateWindow()
    hints = [one for one in wizard.findChildren(QLabel, "hint") if one.isVisible()]
    (told,) = (one for one in hints if "<a " in one.text())
    told.setFocus()
    for key in (Qt.Key.Key_Tab, Qt.Key.Key_Return):
        QTest.keyClick(told, key)
    (manual,) = wizard.findChildren(Manual)
    qtbot.waitUntil(manual.isVisible)
    assert manual.page.textCursor().block().text() == "Left and right display"
    assert "handcal_tracked" in manual.page.toPlainText()
    place = manual.search.mapTo(manual, manual.search.rect().center())
    QTest.mouseClick(
        manual.windowHandle(), Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, place
    )
    qtbot.waitUntil(manual.search.hasFocus)
    wizard.accept()
