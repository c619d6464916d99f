"""The acceptance in the window, on rendered images in place of cameras."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QLabel,
    QPushButton,
)
from pytestqt.qtbot import QtBot

from handcal.camera.settings import RealSenseSettings
from handcal.core.types import EYES
from handcal.rig.formats import write_intrinsics
from handcal.sim.photographs import BOARD, VIEWPOINT_CAMERA, write_acceptance
from handcal_gui.rig.accept_dialog import AcceptDialog
from handcal_gui.rig.project import RigProject
from handcal_gui.rig.project_folder import ProjectFolder, ViewpointEntries
from handcal_gui.rig.result_page import ResultPage
from handcal_gui.rig.take_dialog import TakeDialog
from handcal_gui.widgets.drawing import Drawing
from handcal_gui.widgets.path_field import PathField
from handcal_gui.widgets.table import Table
from tests.gui.helpers import child
from tests.gui.rig.wizard_steps import findings


@pytest.fixture
def project(tmp_path: Path) -> RigProject:
    project = RigProject(ProjectFolder(tmp_path / "project"), RealSenseSettings())
    camera = tmp_path / "viewpoint.json"
    write_intrinsics(camera, VIEWPOINT_CAMERA, "json")
    project.enter(board=BOARD, viewpoint=ViewpointEntries(intrinsics=str(camera)))
    return project


@pytest.fixture
def dialog(qtbot: QtBot, project: RigProject) -> Iterator[AcceptDialog]:
    dialog = AcceptDialog(project)
    qtbot.addWidget(dialog)
    dialog.show()
    yield dialog
    dialog.reject()


def test_the_images_of_each_eye_are_counted_towards_what_is_needed(
    qtbot: QtBot, project: RigProject
) -> None:
    folder = project.folder.path / "accept"
    write_acceptance(folder, project.rig, 6, np.random.default_rng(1), samples=1)
    shutil.rmtree(folder / "right")
    dialog = AcceptDialog(project)
    qtbot.addWidget(dialog)
    told = {label.text() for label in dialog.findChildren(QLabel)}
    assert "Grid: 0 of 1 or more images. Board: 6 of 5 or more pairs." in told
    assert "Grid: 0 of 1 or more images. Board: 0 of 5 or more pairs." in told
    dialog.reject()


def test_images_are_taken_with_both_cameras_at_once(dialog: AcceptDialog) -> None:
    assert not child(dialog, QPushButton, "runAcceptance").isEnabled()
    child(dialog, QPushButton, "left-board").click()
    taking = child(dialog, TakeDialog, "takeDialog")
    assert {"&Viewpoint camera", "&Depth camera"} <= {
        label.text() for label in taking.findChildren(QLabel)
    }
    taking.reject()


def test_the_sources_are_those_of_the_last_time(
    qtbot: QtBot, dialog: AcceptDialog, project: RigProject, tmp_path: Path
) -> None:
    def open_take() -> tuple[TakeDialog, QComboBox, PathField]:
        child(dialog, QPushButton, "left-board").click()
        taking = dialog.findChildren(TakeDialog)[-1]
        return taking, taking.findChildren(QComboBox)[1], taking.findChildren(PathField)[1]

    recording = tmp_path / "depth.db3"
    recording.touch()
    taking, source, path = open_take()
    source.setCurrentIndex(source.findText("Recording or video"))
    path.set_path(str(recording))
    taking.start()
    taking.reject()
    project.save()
    assert ProjectFolder(project.folder.path).load()[0].sources["Depth camera"] == str(recording)
    taking, source, path = open_take()
    assert source.currentText() == "Recording or video"
    assert path.path == str(recording)
    taking.reject()


def test_what_is_missing_is_in_sight(
    qtbot: QtBot, dialog: AcceptDialog, project: RigProject, tmp_path: Path
) -> None:
    found = child(dialog, QLabel, "acceptedFound")
    assert "5 or more of the board" in found.text()
    project.enter(viewpoint=ViewpointEntries(intrinsics=str(tmp_path / "none.json")))
    other = AcceptDialog(project)
    qtbot.addWidget(other)
    assert "intrinsics are missing" in child(other, QLabel, "acceptedFound").text()
    assert not child(other, QPushButton, "runAcceptance").isEnabled()
    other.reject()


def test_one_eye_of_a_right_rig_passes(qtbot: QtBot, project: RigProject) -> None:
    folder = project.folder.path / "accept"
    write_acceptance(folder, project.rig, 6, np.random.default_rng(1), samples=1)
    shutil.rmtree(folder / "right")
    (folder / "left" / "grid").mkdir()
    (folder / "left" / "grid.png").rename(folder / "left" / "grid" / "grid-001.png")
    dialog = AcceptDialog(project)
    qtbot.addWidget(dialog)
    dialog.show()
    found = child(dialog, QLabel, "acceptedFound")
    assert "lie, on average, within 5′ of those seen" in child(dialog, QLabel, "how").text()
    assert "Press Check the rig" in found.text()
    assert child(dialog, QLabel, "acceptedHealth").accessibleName() == "Not yet", "as in Result"
    child(dialog, QPushButton, "runAcceptance").click()
    assert found.text() == "", "it is pressed"
    child(dialog, QPushButton, "cancel").click()
    qtbot.waitUntil(lambda: "Press Check the rig" in found.text(), timeout=30_000)
    child(dialog, QPushButton, "runAcceptance").click()
    qtbot.waitUntil(lambda: "passes: left" in found.text(), timeout=30_000)
    assert child(dialog, QPushButton, "runAcceptance").text() == "Check again"
    table = child(dialog, Table, "drawn-against-seen")
    limited = [one for one in table.as_text().splitlines()[0].split("\t") if "5" in one]
    assert limited == ["Mean, ′ (at most 5)"], "the limit is that of the mean of each pair"
    QApplication.processEvents()
    assert not child(dialog, Drawing, "drawing").isVisible(), "the numbers need its room"
    sign = child(dialog, QLabel, "acceptedHealth")
    assert sign.accessibleName() == "Note", "the right display was not looked at"
    assert "right not looked at" in found.text()
    assert len(table.keys) >= 5
    assert (folder / "page" / "report.html").exists()
    dialog.reject()


def test_result_shows_the_last_acceptance_of_this_rig(qtbot: QtBot, project: RigProject) -> None:
    folder = project.folder.path / "accept"
    write_acceptance(folder, project.rig, 8, np.random.default_rng(1), samples=1)
    for eye in EYES:
        (folder / eye / "grid").mkdir()
        (folder / eye / "grid.png").rename(folder / eye / "grid" / "grid-001.png")
    left = project.rig.eyes["left"]
    wrong = replace(left, K=np.array([[1, 0, 40], [0, 1, 0], [0, 0, 1.0]]) @ left.K)
    project.use_rig(replace(project.rig, eyes={**project.rig.eyes, "left": wrong}))
    page = ResultPage(project)
    qtbot.addWidget(page)

    def acceptance() -> str:
        return findings(page)["Acceptance"][0]

    assert acceptance().startswith("Not yet")
    child(page, QPushButton, "acceptRig").click()
    dialog = child(page, AcceptDialog, "acceptDialog")
    child(dialog, QPushButton, "runAcceptance").click()
    found = child(dialog, QLabel, "acceptedFound")
    qtbot.waitUntil(lambda: "fails: left" in found.text(), timeout=30_000)
    assert "(step Left display)" in found.text()
    assert "handcal rig" not in found.text()
    dialog.reject()
    assert "fails: left" in acceptance()
    project.use_rig(replace(project.rig, name="another name"))
    assert "fails: left" in acceptance()
    project.save()
    again = RigProject(ProjectFolder(project.folder.path), RealSenseSettings())
    assert again.acceptance == project.acceptance is not None
    project.use_rig(replace(project.rig, eyes={**project.rig.eyes, "left": left}))
    assert acceptance().startswith("Not yet")
