"""Taking images with cameras that the tests hold in their hands."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QLabel,
    QPushButton,
)
from pytestqt.qtbot import QtBot

from handcal.camera.playback import PlaybackSettings
from handcal.camera.settings import RealSenseSettings
from handcal.camera.viewpoint import ViewpointCamera
from handcal.core.errors import CameraError
from handcal.rig.boards.choose import ALIKE, ChooseSettings
from handcal_gui.rig.maps import CoverageMap
from handcal_gui.rig.shots import read_color
from handcal_gui.rig.step_page import StepPage
from handcal_gui.rig.take_dialog import TakeDialog
from handcal_gui.rig.wizard import RigWizard
from handcal_gui.widgets.fields import MainButton
from handcal_gui.widgets.path_field import PathField
from tests.gui.helpers import child, text
from tests.gui.rig.wizard_steps import STEREO, wait

REALSENSE_SETTINGS = RealSenseSettings(serial="42")


@pytest.fixture
def cameras(photographs: Any, still_camera: Any) -> dict[str, Any]:
    names = {"0": "depth", "1": "headset"}
    return {source: still_camera(photographs.image(name)) for source, name in names.items()}


@pytest.fixture
def dialog(
    qtbot: QtBot, photographs: Any, cameras: dict[str, Any], tmp_path: Path
) -> Iterator[TakeDialog]:
    def open_still(source: str, *how: object) -> ViewpointCamera:
        assert how[:2] == (REALSENSE_SETTINGS, PlaybackSettings(real_time=True, loop=True))
        camera: ViewpointCamera = cameras[source]
        return camera

    folders = {"Depth camera": tmp_path / "depth", "Headset camera": tmp_path / "headset"}
    dialog = TakeDialog(
        folders,
        photographs.work.board,
        ChooseSettings(most=2, apart_share=0.0),
        REALSENSE_SETTINGS,
        open_source=open_still,
        list_cameras=lambda: [0, 1],
    )
    qtbot.addWidget(dialog)
    dialog.show()
    sources = dialog.findChildren(QComboBox, "source")
    qtbot.waitUntil(lambda: [one.currentText() for one in sources] == ["Camera 0", "Camera 1"])
    yield dialog
    dialog.reject()


def start(qtbot: QtBot, dialog: TakeDialog) -> None:
    child(dialog, QPushButton, "startCameras").click()
    qtbot.waitUntil(child(dialog, QPushButton, "takeImage").isEnabled)


def test_both_cameras_images_are_taken(
    qtbot: QtBot, dialog: TakeDialog, cameras: dict[str, Any], tmp_path: Path
) -> None:
    assert not child(dialog, QPushButton, "takeImage").isEnabled()
    start(qtbot, dialog)
    QTest.keyClick(dialog, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: "corners" in text(dialog, "takenFound"))
    assert text(dialog, "takenFound").startswith("depth-001.png: ")
    cameras["1"].image = np.full((360, 640, 3), 90, np.uint8)
    qtbot.waitUntil(lambda: dialog.shown_images is not None and dialog.shown_images[1].max() == 90)
    child(dialog, QPushButton, "takeImage").click()
    qtbot.waitUntil(lambda: text(dialog, "takenFound").startswith("headset-002.png: "))
    assert "Take another" in text(dialog, "takenFound")
    depth = read_color(tmp_path / "depth" / "depth-002.png")
    np.testing.assert_array_equal(depth, cameras["0"].image)
    dialog.accept()
    assert not any(camera.is_open for camera in cameras.values())


def test_what_is_taken_is_counted_and_what_it_covers_is_shown_at_once(
    qtbot: QtBot, dialog: TakeDialog, cameras: dict[str, Any]
) -> None:
    def count() -> str:
        return child(dialog, QLabel, "takenCount").text()

    maps = dialog.findChildren(CoverageMap)
    assert [one.caption for one in maps] == ["Depth camera: –", "Headset camera: –"]
    assert count() == "0 of 20 usable pairs of images"
    kinds = child(dialog, QLabel, "takenKinds")
    assert kinds.text() == "0 near, 0 far, 0 tilted"
    start(qtbot, dialog)
    child(dialog, QPushButton, "takeImage").click()
    qtbot.waitUntil(lambda: "corners" in text(dialog, "takenFound"))
    assert count() == "1 of 20 usable pairs of images"
    assert re.fullmatch(r"[01] near, [01] far, [01] tilted", kinds.text())
    assert kinds.text() != "0 near, 0 far, 0 tilted", "the board is tilted in it"
    covered = [one.caption for one in maps]
    assert all(caption.endswith(" %") for caption in covered)
    cameras["1"].image = np.full((360, 640, 3), 90, np.uint8)
    qtbot.waitUntil(lambda: dialog.shown_images is not None and dialog.shown_images[1].max() == 90)
    child(dialog, QPushButton, "takeImage").click()
    qtbot.waitUntil(lambda: "Take another" in text(dialog, "takenFound"))
    assert count() == "1 of 20 usable pairs of images", "the headset camera's shows no board"
    assert [one.caption for one in maps] == covered


def test_earlier_images_count(qtbot: QtBot, wizard: RigWizard, photographs: Any) -> None:
    for place in ("depth", "headset"):
        shutil.copytree(photographs.folder / place, wizard.project.folder.path / place)
    wizard.show_step(STEREO)
    page = wizard.page
    assert isinstance(page, StepPage)
    folders = {
        f"{name}_images": str(wizard.project.folder.path / name) for name in ("depth", "headset")
    }
    page.form.enter(**folders)
    wait(qtbot, wizard)
    page.panels[0].take.click()
    taking = child(wizard, TakeDialog)
    assert child(taking, QLabel, "takenCount").text() == "8 of 20 usable pairs of images"
    assert "–" not in taking.findChildren(CoverageMap)[1].caption
    taking.reject()


def test_what_has_been_taken_is_not_taken_again(
    qtbot: QtBot, dialog: TakeDialog, tmp_path: Path
) -> None:
    start(qtbot, dialog)
    child(dialog, QPushButton, "takeImage").click()
    qtbot.waitUntil(lambda: "corners" in text(dialog, "takenFound"))
    qtbot.waitUntil(child(dialog, QPushButton, "takeImage").isEnabled)
    child(dialog, QPushButton, "takeImage").click()
    qtbot.waitUntil(
        lambda: text(dialog, "takenFound") == "This has been taken already. Take another."
    )
    assert len(list(tmp_path.rglob("*.png"))) == 2


def test_the_large_button_does_what_the_sentence_asks_for(
    qtbot: QtBot, dialog: TakeDialog, tmp_path: Path
) -> None:
    def large() -> list[str]:
        return [one.text() for one in dialog.findChildren(MainButton) if one.isVisible()]

    assert large() == ["&Show"]
    QTest.keyClick(dialog, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: large() == ["Take"])
    assert not list(tmp_path.rglob("*.png"))
    QTest.keyClick(dialog, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: len(list(tmp_path.rglob("*.png"))) == 2)
    source = dialog.findChildren(QComboBox, "source")[1]
    source.setCurrentIndex(source.findText("RealSense, colour"))
    assert dialog.shown_images is None, "of another camera than the one chosen"
    assert large() == ["&Show"]


def test_a_failing_camera_is_reported_and_can_be_shown_again(
    qtbot: QtBot, dialog: TakeDialog, cameras: dict[str, Any]
) -> None:
    start(qtbot, dialog)
    cameras["1"].failure = CameraError("it was unplugged")
    told = "It was unplugged. Press Show to open the camera again."
    qtbot.waitUntil(lambda: text(dialog, "takenFound") == told)
    assert not child(dialog, QPushButton, "takeImage").isEnabled()
    start(qtbot, dialog)
    assert text(dialog, "takenFound") == "", "it is over"


def test_images_are_taken_by_themselves_until_they_are_enough(
    qtbot: QtBot, dialog: TakeDialog, tmp_path: Path
) -> None:
    by_itself = child(dialog, QCheckBox, "byItself")
    start(qtbot, dialog)
    by_itself.click()
    qtbot.waitUntil(lambda: text(dialog, "takenFound") == "2 taken: enough images.")
    assert child(dialog, QLabel, "takenCount").text() == "2 of 20 usable pairs of images"
    assert not by_itself.isChecked()
    for folder in ("depth", "headset"):
        names = [path.name for path in sorted((tmp_path / folder).iterdir())]
        assert names == [f"{folder}-00{number}.png" for number in (1, 2)]


def test_a_recording_that_begins_again_is_not_taken_again_by_itself(
    qtbot: QtBot, dialog: TakeDialog, cameras: dict[str, Any], tmp_path: Path
) -> None:
    for number, source in enumerate(dialog.findChildren(QComboBox, "source")):
        path = str(tmp_path / f"{number}.mp4")
        cameras[path] = cameras[str(number)]
        source.setCurrentIndex(source.findText("Recording or video"))
        dialog.findChildren(PathField)[number].set_path(path)
    start(qtbot, dialog)
    child(dialog, QCheckBox, "byItself").click()
    qtbot.waitUntil(lambda: text(dialog, "takenFound") == "1 taken; this has been taken already.")
    assert len(list(tmp_path.rglob("*.png"))) == 2


def test_what_is_not_taken_by_itself_is_explained(
    qtbot: QtBot, dialog: TakeDialog, cameras: dict[str, Any], tmp_path: Path
) -> None:
    cameras["1"].image = np.full((360, 640, 3), 90, np.uint8)
    start(qtbot, dialog)
    by_itself = child(dialog, QCheckBox, "byItself")
    by_itself.click()
    told = "0 taken; the board is not seen by the headset camera: bring it into view, "
    qtbot.waitUntil(lambda: text(dialog, "takenFound") == f"{told}and see to focus and light.")
    assert not (tmp_path / "depth").exists()


def test_what_is_missing_is_said_and_nothing_can_be_shown_without_it(
    qtbot: QtBot, dialog: TakeDialog, cameras: dict[str, Any], tmp_path: Path
) -> None:
    task, show = child(dialog, QLabel, "takeTask"), child(dialog, QPushButton, "startCameras")
    source = dialog.findChildren(QComboBox, "source")[1]
    source.setCurrentIndex(source.findText("Recording or video"))
    assert task.text() == "Choose the recording or video of the headset camera."
    assert not show.isEnabled()
    source.setCurrentIndex(source.findText("Camera 0"))
    assert task.text() == "Both are the same camera: choose another for one of them."
    assert not show.isEnabled()
    source.setCurrentIndex(source.findText("Camera 1"))
    assert task.text() == "Choose a camera or a recording, and press Show."
    assert show.isEnabled()


def test_one_camera_takes_images_and_two_take_pairs(
    qtbot: QtBot, dialog: TakeDialog, photographs: Any, tmp_path: Path
) -> None:
    folders = {"Viewpoint camera": tmp_path / "grid"}
    board, settings = photographs.work.board, RealSenseSettings()
    one = TakeDialog(folders, board, ChooseSettings(), settings, list_cameras=lambda: [0])
    qtbot.addWidget(one)
    assert child(one, QLabel, "takenCount").text() == "0 of 20 usable images"
    assert child(dialog, QLabel, "takenCount").text() == "0 of 20 usable pairs of images"
    kinds = [child(shown, QLabel, "takenKinds").text() for shown in (one, dialog)]
    assert kinds == ["0 tilted", "0 near, 0 far, 0 tilted"]
    one.reject()
    few = TakeDialog(folders, board, ALIKE, settings, asked=3, list_cameras=lambda: [0])
    qtbot.addWidget(few)
    assert not child(few, QLabel, "takenKinds").text(), "the camera stands still"
    few.reject()
