"""The way into the window of evaluations, and what is remembered of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from PySide6.QtWidgets import QLabel, QPushButton
from pytestqt.qtbot import QtBot

from handcal_gui.app.manual import Manual
from handcal_gui.app.preferences import PreferencesFile
from handcal_gui.app.program import Program
from handcal_gui.evaluate.window import EvaluationWindow
from handcal_gui.widgets.path_field import PathField
from tests.gui.helpers import child


def test_the_start_page_leads_to_evaluations(qtbot: QtBot, tmp_path: Path) -> None:
    (tmp_path / "config").mkdir()
    file = PreferencesFile(tmp_path / "config" / "preferences.json")
    program = Program(file)
    qtbot.addWidget(program.window)
    program.window.show()
    button = child(program.start, QPushButton, "evaluate")
    button.click()
    (window,) = program.window.findChildren(EvaluationWindow)
    assert window.isVisible()
    assert program.windows.evaluate() is window
    assert window.entries.users.sessions == program.preferences.station.sessions
    window.show_page("segmentation")
    child(window.page, QLabel, "format").linkActivated.emit(
        "docs/commands.md#handcal-evaluate-segmentation"
    )
    manual = child(program.window, Manual, "manual")
    assert manual.isVisible()
    shown = manual.page.textCursor().block().text()
    assert shown == "handcal evaluate segmentation"
    window.show_page("noise")
    window.page.form.enter(seed=11)
    program.window.close()
    assert not window.isVisible()
    assert file.load()[0].evaluation.noise.seed == 11


def test_the_user_test_proposes_the_session_folder_in_use(qtbot: QtBot, tmp_path: Path) -> None:
    (tmp_path / "config").mkdir()
    program = Program(PreferencesFile(tmp_path / "config" / "preferences.json"))
    qtbot.addWidget(program.window)

    def use(name: str) -> None:
        fields = program.window.findChildren(PathField)
        [field] = [one for one in fields if one.name == "Session folder"]
        field.set_path(str(tmp_path / name))

    for name in ("demonstration", "other"):
        use(name)
        window = program.windows.evaluate()
        assert window.entries.users.sessions == str(tmp_path / name)
        started = replace(program.preferences.station, sessions=str(tmp_path / "started"))
        program._current.change(station=started)
        window.close()
    window = program.windows.evaluate()
    window.show_page("users")
    window.page.form.enter(sessions=str(tmp_path / "chosen"))
    window.close()
    assert program.windows.evaluate().entries.users.sessions == str(tmp_path / "chosen")
    program.window.close()
