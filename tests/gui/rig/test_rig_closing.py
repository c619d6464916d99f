from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtWidgets import QPushButton
from pytestqt.qtbot import QtBot

from handcal.core.progress import Progress
from handcal_gui.rig.project_folder import ProjectFolder
from handcal_gui.rig.solve_box import SolveBox
from handcal_gui.rig.wizard import RigWizard
from tests.gui.helpers import answer_questions, child


def test_closing_asks_before_it_cancels_a_solve(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never_done(progress: Progress) -> None:
        while True:
            progress.check()

    wizard = RigWizard(ProjectFolder(tmp_path / "rig"))
    qtbot.addWidget(wizard)
    wizard.show()
    bar = child(wizard, SolveBox).bar
    bar.run("Solving", never_done, lambda _: None)
    said = answer_questions(monkeypatch, "Keep running")
    for leave in (wizard.close, wizard.reject, child(wizard, QPushButton, "rigClose").click):
        leave()
        assert wizard.isVisible()
        assert bar.is_busy
    assert said == 3 * ["A step is being solved. If it is cancelled, its former result is kept."]
    answer_questions(monkeypatch, "Cancel and close")
    wizard.close()
    assert not wizard.isVisible()
    assert not bar.is_busy
