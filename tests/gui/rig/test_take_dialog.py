"""Taking images with cameras that the tests hold in their hands."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QLabel, QPushButton
from pytestqt.qtbot import QtBot

from handcal.camera.viewpoint import ViewpointCamera
from handcal.errors import CameraError, CameraTimeoutError
from handcal.types import UInt8
from handcal_gui.rig.live import open_camera
from handcal_gui.rig.shots import read_color
from handcal_gui.rig.take_dialog import TakeDialog


class StillCamera(ViewpointCamera):
    """Always sees the same; fails when told."""

    def __init__(self, image: UInt8) -> None:
        self.name = "still"
        self.image = image
        self.failure: CameraError | None = None
        self.is_open = True

    def read(self) -> tuple[UInt8, int]:
        failure, self.failure = self.failure, None
        if failure is not None:
            raise failure
        return self.image.copy(), 0

    def close(self) -> None:
        self.is_open = False


@pytest.fixture
def cameras(photographs: Any) -> dict[str, StillCamera]:
    names = {"0": "depth", "1": "headset"}
    return {source: StillCamera(photographs.image(name)) for source, name in names.items()}


@pytest.fixture
def dialog(
    qtbot: QtBot, photographs: Any, cameras: dict[str, StillCamera], tmp_path: Path
) -> Iterator[TakeDialog]:
    def open_still(source: str, folder: Path) -> ViewpointCamera:
        assert folder == tmp_path
        return cameras[source]

    folders = {"Depth camera": tmp_path / "depth", "Headset camera": tmp_path / "headset"}
    dialog = TakeDialog(folders, photographs.work.board, open_camera=open_still)
    qtbot.addWidget(dialog)
    dialog.show()
    yield dialog
    dialog.reject()


def button(dialog: TakeDialog, name: str) -> QPushButton:
    found = dialog.findChild(QPushButton, name)
    assert isinstance(found, QPushButton)
    return found


def said(dialog: TakeDialog) -> str:
    found = dialog.findChild(QLabel, "takenFound")
    assert isinstance(found, QLabel)
    return found.text()


def start(qtbot: QtBot, dialog: TakeDialog) -> None:
    button(dialog, "startCameras").click()
    qtbot.waitUntil(button(dialog, "takeImage").isEnabled)


def test_both_cameras_images_are_taken(
    qtbot: QtBot, dialog: TakeDialog, cameras: dict[str, StillCamera], tmp_path: Path
) -> None:
    assert not button(dialog, "takeImage").isEnabled()
    start(qtbot, dialog)
    QTest.keyClick(dialog, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: "corners" in said(dialog))
    assert said(dialog).startswith("Depth-001.png: ")
    cameras["1"].image = np.full((360, 640, 3), 90, np.uint8)
    qtbot.waitUntil(lambda: dialog.shown_images is not None and dialog.shown_images[1].max() == 90)
    button(dialog, "takeImage").click()
    qtbot.waitUntil(lambda: "headset-002.png" in said(dialog).lower())
    assert "Take another" in said(dialog)
    depth = read_color(tmp_path / "depth" / "depth-002.png")
    np.testing.assert_array_equal(depth, cameras["0"].image)
    dialog.accept()
    assert not any(camera.is_open for camera in cameras.values())


def test_a_camera_that_is_late_is_waited_for(
    qtbot: QtBot, dialog: TakeDialog, cameras: dict[str, StillCamera]
) -> None:
    cameras["0"].failure = CameraTimeoutError("late")
    start(qtbot, dialog)


def test_a_camera_that_fails_is_told_and_can_be_shown_again(
    qtbot: QtBot, dialog: TakeDialog, cameras: dict[str, StillCamera]
) -> None:
    start(qtbot, dialog)
    cameras["1"].failure = CameraError("it was unplugged")
    qtbot.waitUntil(lambda: said(dialog) == "It was unplugged.")
    assert not button(dialog, "takeImage").isEnabled()
    start(qtbot, dialog)


def test_one_camera_cannot_be_both(dialog: TakeDialog) -> None:
    for source in dialog.findChildren(QComboBox, "source"):
        source.setCurrentIndex(3)
    button(dialog, "startCameras").click()
    assert "cannot be both" in said(dialog)


def test_a_camera_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(CameraError, match="camera 9"):
        open_camera("9", tmp_path)
