"""The last step: the rig's name."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import QLabel, QLineEdit
from pytestqt.qtbot import QtBot

from handcal.camera.settings import RealSenseSettings
from handcal_gui.windows.rig.project import RigProject
from handcal_gui.windows.rig.project_folder import ProjectFolder
from handcal_gui.windows.rig.result_page import ResultPage
from tests.gui.helpers import child


def test_a_missing_name_is_said_beside_the_field_at_once(qtbot: QtBot, tmp_path: Path) -> None:
    project = RigProject(ProjectFolder(tmp_path), RealSenseSettings())
    page = ResultPage(project)
    qtbot.addWidget(page)
    page.show()
    name, problem = child(page, QLineEdit, "rigName"), child(page, QLabel, "rigNameProblem")
    before = name.text()
    for text in ("", " ", "a\x07"):
        name.setText(text)
        assert problem.isVisible()
        assert not page.main.isEnabled()
        name.editingFinished.emit()
        assert name.text() == text, "it is not replaced unasked"
        assert project.rig.name == before
    name.setText("Rig 7")
    assert not problem.isVisible()
    assert page.main.isEnabled()
