from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtWidgets import (
    QComboBox,
    QDoubleSpinBox,
    QFileDialog,
    QLabel,
    QMessageBox,
    QPushButton,
    QSpinBox,
)
from pytestqt.qtbot import QtBot

from handcal.camera.settings import RealSenseSettings
from handcal.core.types import Origin
from handcal.rig.boards.board import Board
from handcal.rig.example import example_rig
from handcal.rig.rig_file import write_rig
from handcal_gui.rig.board_page import BoardPage
from handcal_gui.rig.project import RigProject
from handcal_gui.rig.project_folder import ProjectFolder
from handcal_gui.widgets.image_view import ImageView
from tests.gui.helpers import child, text

ORIGIN = Origin("as told", "now", 3, 0.1, "good", "as told", ("a",), np.eye(1))


@pytest.fixture
def project(tmp_path: Path) -> RigProject:
    return RigProject(ProjectFolder(tmp_path / "work"), RealSenseSettings())


@pytest.fixture
def page(qtbot: QtBot, project: RigProject) -> Iterator[BoardPage]:
    page = BoardPage(project)
    qtbot.addWidget(page)
    page.show()
    yield page
    page.stop()
    project.save()


def press(page: BoardPage, name: str) -> None:
    button = page.findChild(QPushButton, name) or page.strip.findChild(QPushButton, name)
    assert isinstance(button, QPushButton)
    button.click()


def test_the_board_shown_is_the_one_entered(
    qtbot: QtBot, page: BoardPage, project: RigProject
) -> None:
    kind, columns = page.findChild(QComboBox, "kind"), page.findChild(QSpinBox, "columns")
    square = page.findChild(QDoubleSpinBox, "square")
    assert isinstance(kind, QComboBox)
    assert isinstance(columns, QSpinBox)
    assert isinstance(square, QDoubleSpinBox)
    kind.setCurrentIndex(kind.findData("checkerboard"))
    columns.setValue(12)
    square.setValue(24.9)
    expected = Board("checkerboard", (12, 7), 0.0249)
    assert project.inputs.board == expected
    assert "11 × 6" in text(page, "boardFound")
    assert "No image shows this board yet" in text(page, "boardFound")
    project.note_found(Board())
    assert not project.inputs.board_found, "this is another board"
    project.note_found(expected)
    page.enter()
    assert "found in an image" in text(page, "boardFound")
    preview = child(page, ImageView)
    qtbot.waitUntil(lambda: preview.has_image)


def test_an_impossible_board_is_reported_and_not_taken(
    page: BoardPage, project: RigProject
) -> None:
    marker = child(page, QDoubleSpinBox, "marker")
    marker.setValue(25.0)
    assert "0.3 to 0.95" in text(page, "boardFound")
    page.enter()
    assert "0.3 to 0.95" in text(page, "boardFound"), "the step is shown again"
    assert project.inputs.board == Board()
    assert not page.main.isEnabled()  # or the board before would be saved as this one
    marker.setValue(10.0)
    assert page.main.isEnabled()


def test_the_board_is_saved(
    page: BoardPage, choose: Callable[[Path], None], tmp_path: Path
) -> None:
    choose(tmp_path / "board.pdf")
    press(page, "savePdf")
    assert (tmp_path / "board.pdf").read_bytes().startswith(b"%PDF")
    assert "100 %" in text(page, "boardFound")
    choose(tmp_path / "board.png")
    press(page, "savePicture")
    assert (tmp_path / "board.png").read_bytes().startswith(b"\x89PNG")
    choose(tmp_path / "missing" / "board.pdf")
    press(page, "savePdf")
    assert "Not saved" in text(page, "boardFound")


def test_dialogs_begin_in_the_folder_used_last(
    page: BoardPage, project: RigProject, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    proposed: list[str] = []

    def answer(*words: Any) -> tuple[str, str]:
        proposed.append(words[2])
        return str(tmp_path / "mine" / "board.pdf"), ""

    (tmp_path / "mine").mkdir()
    for ask in ("getSaveFileName", "getOpenFileName"):
        monkeypatch.setattr(QFileDialog, ask, answer)
    for name in ("savePdf", "savePicture", "begin"):
        press(page, name)
    mine = tmp_path / "mine"
    assert proposed == ["board.pdf", str(mine / "board.png"), str(mine)]
    project.save()
    assert ProjectFolder(project.folder.path).load()[0].chosen_folder == str(mine)


def test_the_example_is_offered_unless_it_is_in_use(page: BoardPage, project: RigProject) -> None:
    afresh = page.findChild(QPushButton, "afresh")
    state = page.findChild(QLabel, "initialRigState")
    assert isinstance(afresh, QPushButton)
    assert isinstance(state, QLabel)
    assert state.text() == "Nothing of this rig is calibrated yet."
    assert (afresh.isEnabled(), afresh.toolTip()) == (False, "The example is in use")
    example = example_rig()
    left = replace(example.eyes["left"], z_C0_S_m=1.5)
    for other in (
        replace(example, name="ours"),
        replace(example, origins={"left": ORIGIN}),
        replace(example, eyes={**example.eyes, "left": left}),
    ):
        project.use_rig(other)
        assert afresh.isEnabled()
        project.use_rig(example)
        assert not afresh.isEnabled()


def test_another_rig_is_begun_from(
    page: BoardPage,
    project: RigProject,
    choose: Callable[[Path], None],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    calibrated = replace(example_rig(), name="ours", origins={"left": ORIGIN})
    write_rig(tmp_path / "ours.yaml", calibrated)
    choose(tmp_path / "ours.yaml")
    press(page, "begin")
    assert project.rig.name == "ours"
    # What is calibrated is not given up unasked.
    write_rig(tmp_path / "theirs.yaml", replace(example_rig(), name="theirs"))
    choose(tmp_path / "theirs.yaml")
    monkeypatch.setattr(QMessageBox, "question", lambda *_: QMessageBox.StandardButton.No)
    press(page, "begin")
    assert project.rig.name == "ours"
    monkeypatch.setattr(QMessageBox, "question", lambda *_: QMessageBox.StandardButton.Yes)
    press(page, "begin")
    assert project.rig.name == "theirs"
    choose(tmp_path / "none.yaml")
    press(page, "begin")
    assert "none.yaml" in text(page, "boardFound")


def test_only_what_is_not_saved_is_asked_about_and_no_is_the_default(
    page: BoardPage, project: RigProject, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked: list[str] = []

    def question(*words: Any) -> QMessageBox.StandardButton:
        asked.append(words[2])
        assert words[-1] == QMessageBox.StandardButton.No
        return QMessageBox.StandardButton.No

    monkeypatch.setattr(QMessageBox, "question", question)
    project.use_rig(replace(example_rig(), name="ours", origins={"left": ORIGIN}))
    press(page, "afresh")
    assert project.rig.name == "ours"
    assert "left display" in asked[0]
    project.save_rig_as(tmp_path / "ours.yaml")
    press(page, "afresh")
    assert project.rig.name == example_rig().name
    assert not project.rig.origins
    assert len(asked) == 1
