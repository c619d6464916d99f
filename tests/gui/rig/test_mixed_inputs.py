"""A rig whose parts were solved with different inputs is not shown as good."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtWidgets import QLabel, QMessageBox, QPushButton, QTabWidget
from pytestqt.qtbot import QtBot

from handcal_gui.rig.project_folder import ProjectFolder
from handcal_gui.rig.wizard import RigWizard
from handcal_gui.widgets.table import Table
from tests.gui.rig.wizard_steps import (
    LEFT,
    RESULT,
    STEREO,
    VIEWPOINT,
    child,
    findings,
    marks,
    page_of,
    solve,
    tick,
    wait,
)


def test_another_board_makes_every_solved_step_outdated(
    qtbot: QtBot, wizard: RigWizard, folder: Path
) -> None:
    for step in (STEREO, VIEWPOINT, LEFT):
        solve(qtbot, wizard, step)
    solved = marks(wizard)[STEREO : LEFT + 1]
    assert not [mark for mark in solved if "other inputs" in mark]
    board = wizard.project.inputs.board
    wizard.project.enter(board=replace(board, square_m=1.2 * board.square_m))
    assert marks(wizard)[STEREO : LEFT + 1] == 3 * [
        "solved with other inputs (board): solve it again"
    ]
    assert "other inputs (board)" in child(wizard, QLabel, "verdictFound").text()
    solve(qtbot, wizard, STEREO)
    assert "other inputs" not in marks(wizard)[STEREO]
    assert "other inputs" in marks(wizard)[LEFT]
    wizard.show_step(RESULT)
    assert (
        "Doubtful" in child(wizard, QLabel, "savedRigFound").text()
        or "doubtful" in child(wizard, QLabel, "savedRigFound").text()
    )
    listed = findings(wizard)
    assert "other inputs" in listed["Left display"][0]
    assert "other inputs" in listed["Viewpoint camera"][0]
    assert "Depth and headset camera" not in listed
    # It is remembered, and with the board of before the other two are good again.
    wizard.accept()
    again = RigWizard(ProjectFolder(folder))
    qtbot.addWidget(again)
    assert "other inputs" in marks(again)[LEFT]
    again.project.enter(board=board)
    assert marks(again)[VIEWPOINT : LEFT + 1] == solved[1:]
    assert "other inputs" in marks(again)[STEREO]


def test_a_wrong_folder_is_not_shown_beside_an_earlier_verdict(
    qtbot: QtBot, wizard: RigWizard, photographs: Any, folder: Path
) -> None:
    solve(qtbot, wizard, STEREO)
    right = wizard.project.inputs.stereo.headset_images
    page_of(wizard).form.enter(headset_images=str(photographs.folder / "viewpoint"))
    wait(qtbot, wizard)
    text = "Solved with other inputs (headset camera's images): solve it again."
    assert child(wizard, QLabel, "verdictFound").text().startswith(text)
    assert child(wizard, QLabel, "verdictHealth").accessibleName() == "Note"
    assert "Bad" in solve(qtbot, wizard, STEREO)
    wizard.accept()
    again = RigWizard(ProjectFolder(folder))
    qtbot.addWidget(again)
    again.show()
    again.show_step(STEREO)
    wait(qtbot, again)
    assert child(again, QLabel, "verdictFound").text().startswith(text)
    page_of(again).form.enter(headset_images=right)
    wait(qtbot, again)
    assert marks(again)[STEREO] == wizard.project.rig.origins["T_H_D"].verdict
    assert re.search(r"RMS 0\.\d+ px", child(again, QLabel, "verdictFound").text())
    again.accept()


def test_another_viewpoint_camera_makes_the_displays_outdated(
    qtbot: QtBot, wizard: RigWizard
) -> None:
    solve(qtbot, wizard, VIEWPOINT)
    solve(qtbot, wizard, LEFT)
    wizard.project.folder.viewpoint.write_text(
        wizard.project.folder.viewpoint.read_text().replace("verdict", "Verdict")
    )
    wizard.project.camera_solved()
    assert "(viewpoint camera's intrinsics)" in marks(wizard)[LEFT]


def test_images_added_later_make_a_step_outdated(
    qtbot: QtBot, wizard: RigWizard, photographs: Any, tmp_path: Path
) -> None:
    folder = tmp_path / "viewpoint"
    shutil.copytree(wizard.project.inputs.viewpoint.images, folder)
    wizard.show_step(VIEWPOINT)
    page_of(wizard).form.enter(images=str(folder))
    solved = solve(qtbot, wizard, VIEWPOINT)
    assert "other inputs" not in solved
    shutil.copy(folder / "viewpoint-001.png", folder / "viewpoint-100.png")
    child(wizard, QTabWidget, "").setCurrentIndex(0)
    child(wizard, QPushButton, "again").click()
    wait(qtbot, wizard)
    text = "other inputs (viewpoint camera's images)"
    assert text in child(wizard, QLabel, "verdictFound").text()
    wizard.show_step(RESULT)
    assert text in marks(wizard)[VIEWPOINT]


@pytest.mark.parametrize("is_solving", [False, True])
def test_an_image_unticked_makes_the_result_one_of_other_images(
    qtbot: QtBot, wizard: RigWizard, is_solving: bool
) -> None:
    wizard.show_step(STEREO)
    wait(qtbot, wizard)
    shots = child(wizard, Table, "shots")
    child(wizard, QPushButton, "solve").click()
    if not is_solving:
        wait(qtbot, wizard)
    tick(shots, 1, False)
    wait(qtbot, wizard)
    text = "olved with other inputs (excluded images): solve it again"
    assert child(wizard, QLabel, "verdictFound").text() == f"S{text}."
    assert marks(wizard)[STEREO] == f"s{text}"


def test_saving_mixed_inputs_warns(
    qtbot: QtBot,
    wizard: RigWizard,
    choose: Callable[[Path], None],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    solve(qtbot, wizard, STEREO)
    board = wizard.project.inputs.board
    wizard.project.enter(board=replace(board, square_m=1.2 * board.square_m))
    wizard.show_step(RESULT)
    asked: list[str] = []
    answers = [QMessageBox.StandardButton.No, QMessageBox.StandardButton.Yes]

    def question(*words: Any) -> QMessageBox.StandardButton:
        asked.append(words[2])
        assert words[-1] == QMessageBox.StandardButton.No, "the safe answer is the default"
        return answers[len(asked) - 1]

    monkeypatch.setattr(QMessageBox, "question", question)
    choose(tmp_path / "mixed.yaml")
    child(wizard, QPushButton, "saveRig").click()
    assert not (tmp_path / "mixed.yaml").exists()
    assert "Depth and headset camera: solved with other inputs (board)" in asked[0]
    child(wizard, QPushButton, "saveRig").click()
    assert (tmp_path / "mixed.yaml").exists()
