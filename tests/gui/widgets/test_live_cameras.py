"""Live pictures of cameras that the tests hold in their hands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from PySide6.QtWidgets import QComboBox
from pytestqt.qtbot import QtBot

from handcal.camera.playback import PlaybackSettings
from handcal.camera.settings import RealSenseSettings
from handcal.camera.viewpoint import ViewpointCamera
from handcal.core.errors import CameraError, CameraTimeoutError
from handcal.core.types import CameraIdentity
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.live_cameras import LiveCameras
from handcal_gui.widgets.path_field import PathField

REALSENSE_SETTINGS = RealSenseSettings(serial="42")


class Pair:
    """Two cameras, and what is said of them."""

    def __init__(self, still_camera: Any) -> None:
        images = [np.full((36, 64, 3), level, np.uint8) for level in (50, 90)]
        self.cameras = {str(number): still_camera(image) for number, image in enumerate(images)}
        self.widget = LiveCameras(
            ("Left camera", "Right camera"), REALSENSE_SETTINGS, open_source=self._open
        )
        self.said: list[str] = []
        self.widget.failed.connect(self.said.append)
        self.widget.add_cameras([0, 1])

    @property
    def levels(self) -> list[int]:
        return [int(image[0, 0, 0]) for image in self.widget.images or ()]

    def choose(self, place: int, text: str) -> None:
        source = self.widget.findChildren(QComboBox, "source")[place]
        source.setCurrentIndex(source.findText(text))

    def _open(self, source: str, *how: Any) -> ViewpointCamera:
        how[2](None, CameraIdentity("Intel RealSense D415", f"serial {source}"))
        assert how[:2] == (REALSENSE_SETTINGS, PlaybackSettings(real_time=True, loop=True))
        camera: ViewpointCamera = self.cameras[source]
        return camera


@pytest.fixture
def pair(qtbot: QtBot, still_camera: Any) -> Iterator[Pair]:
    pair = Pair(still_camera)
    qtbot.addWidget(pair.widget)
    pair.widget.show()
    yield pair
    pair.widget.stop()


def test_cameras_of_the_last_time_are_chosen_once_they_are_found(qtbot: QtBot) -> None:
    widget = LiveCameras(("Left camera", "Right camera"))
    qtbot.addWidget(widget)
    widget.choose({"Left camera": "1", "Right camera": "0", "Another": "2"})
    widget.add_cameras([0, 1])
    assert widget.chosen == {"Left camera": "1", "Right camera": "0"}
    widget.choose({"Left camera": "7"})
    assert widget.chosen["Left camera"] == "1", "the other is no longer there"


def test_what_both_see_is_shown_until_it_is_stopped(qtbot: QtBot, pair: Pair) -> None:
    pair.widget.start()
    qtbot.waitUntil(lambda: pair.levels == [50, 90])
    captions = [view.caption for view in pair.widget.findChildren(ImageView)]
    assert captions == [f"Intel RealSense D415, serial {n}" for n in (0, 1)], "which of several"
    pair.widget.stop()
    assert pair.levels == []
    assert [view.message for view in pair.widget.findChildren(ImageView)] == 2 * ["No image"]
    assert not any(camera.is_open for camera in pair.cameras.values())
    pair.choose(0, "Camera 1")
    pair.choose(1, "Camera 0")
    pair.widget.start()
    qtbot.waitUntil(lambda: pair.levels == [90, 50])
    assert not pair.said


def test_a_camera_that_is_late_is_waited_for(qtbot: QtBot, pair: Pair) -> None:
    pair.cameras["0"].failure = CameraTimeoutError("late")
    pair.widget.start()
    qtbot.waitUntil(lambda: pair.levels == [50, 90])


def test_a_camera_that_fails_stops_both(qtbot: QtBot, pair: Pair) -> None:
    pair.cameras["1"].failure = CameraError("it was unplugged")
    pair.widget.start()
    qtbot.waitUntil(lambda: pair.said == ["it was unplugged"])
    assert not any(camera.is_open for camera in pair.cameras.values())
    assert pair.levels == []


def test_one_camera_cannot_be_both(pair: Pair) -> None:
    for place in range(2):
        pair.choose(place, "RealSense, colour")
    pair.widget.start()
    assert pair.said == ["both are the same camera: choose another for one of them"]


def test_a_recording_is_shown_as_a_camera_is(qtbot: QtBot, pair: Pair) -> None:
    fields = pair.widget.findChildren(PathField)
    assert not any(field.isEnabled() for field in fields)
    pair.choose(1, "Recording or video")
    assert [field.isEnabled() for field in fields] == [False, True]
    pair.widget.start()
    assert pair.said == ["choose the recording or video of the right camera"] == [pair.widget.need]
    pair.cameras["film.mp4"] = pair.cameras["1"]
    with qtbot.waitSignal(pair.widget.chosen_changed):
        fields[1].set_path("film.mp4")
    assert not pair.widget.need
    pair.widget.start()
    qtbot.waitUntil(lambda: pair.levels == [50, 90])
