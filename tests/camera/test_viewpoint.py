"""The viewpoint camera on folders and videos; the kind that is plugged in by a stand-in."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from handcal.camera import viewpoint
from handcal.camera.playback import PlaybackSettings
from handcal.camera.viewpoint import list_viewpoints, open_viewpoint
from handcal.core.errors import CameraEndError, CameraError

RGB = (200, 120, 30)


def flat(level: int = 0) -> np.ndarray[Any, Any]:
    return np.full((48, 64, 3), np.add(RGB, level), np.uint8)


def test_images_of_a_folder_come_by_name(tmp_path: Path) -> None:
    for level, name in ((1, "b.png"), (2, "c.PNG"), (0, "a.png")):
        cv2.imwrite(str(tmp_path / name), flat(level)[..., ::-1])
    (tmp_path / "notes.txt").write_text("no image")
    before_ns = time.monotonic_ns()
    with open_viewpoint(tmp_path) as camera:
        for level in range(3):
            image, t_ns = camera.read()
            np.testing.assert_array_equal(image, flat(level))
            assert before_ns <= t_ns <= time.monotonic_ns()
        with pytest.raises(CameraEndError, match="that was the last"):
            camera.read()
    with pytest.raises(CameraError, match="is closed"):
        camera.read()


def test_a_folder_is_played_in_a_loop_each_image_for_a_while(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(viewpoint, "_IMAGE_S", 0.2)
    monkeypatch.setattr(viewpoint, "_PERIOD_S", 0.001)
    for level in range(2):
        cv2.imwrite(str(tmp_path / f"{level}.png"), flat(level)[..., ::-1])
    playback = PlaybackSettings(real_time=True, loop=True)
    times: list[tuple[int, int]] = []  # level, and how often in a row
    with open_viewpoint(tmp_path, playback=playback) as camera:
        while len(times) < 4:
            level = int(camera.read()[0][0, 0, 0]) - RGB[0]
            count = times.pop()[1] if times and times[-1][0] == level else 0
            times.append((level, count + 1))
    assert [level for level, _ in times] == [0, 1, 0, 1]
    assert all(count > 1 for _, count in times[:3])


def test_a_folder_without_images_and_a_damaged_image_are_named(tmp_path: Path) -> None:
    with pytest.raises(CameraError, match="holds no PNG, JPEG, TIFF, BMP or PGM image"):
        open_viewpoint(tmp_path)
    (tmp_path / "a.png").write_bytes(b"no image")
    with (
        open_viewpoint(tmp_path) as camera,
        pytest.raises(CameraError, match=r"a\.png is not a PNG"),
    ):
        camera.read()


def test_a_video_gives_its_images_with_their_times(tmp_path: Path) -> None:
    path = tmp_path / "view.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 20.0, (64, 48))
    for _ in range(4):
        writer.write(flat()[..., ::-1])
    writer.release()
    with open_viewpoint(path) as camera:
        assert camera.name == "Video view.avi"
        read = [camera.read() for _ in range(4)]
        with pytest.raises(CameraEndError, match="that was the last"):
            camera.read()
    for image, _ in read:
        np.testing.assert_allclose(image, flat(), atol=6)
    np.testing.assert_allclose(np.diff([t_ns for _, t_ns in read]), 50e6)
    with pytest.raises(CameraError, match="is closed"):
        camera.read()


def test_what_is_no_video_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CameraError, match="there is no video"):
        open_viewpoint(tmp_path / "absent.mp4")
    (tmp_path / "bad.mp4").write_bytes(bytes(1000))
    with pytest.raises(CameraError, match="is not a video that OpenCV can play"):
        open_viewpoint(tmp_path / "bad.mp4")


class StandIn:
    """A camera as OpenCV captures it, for number 3 only."""

    def __init__(self, number: int, backend: int) -> None:
        self.is_open = number == 3
        self.asked: dict[int, float] = {}
        self.left = 2

    def isOpened(self) -> bool:
        return self.is_open

    def set(self, what: int, value: float) -> bool:
        self.asked[what] = value
        return True

    def read(self) -> tuple[bool, Any]:
        self.left -= 1
        return self.left >= 0, flat()[..., ::-1] if self.left >= 0 else None

    def release(self) -> None:
        self.is_open = False


@pytest.fixture
def plugged_in(monkeypatch: pytest.MonkeyPatch) -> list[StandIn]:
    opened: list[StandIn] = []

    def capture(number: int, backend: int) -> StandIn:
        opened.append(StandIn(number, backend))
        return opened[-1]

    monkeypatch.setattr(viewpoint, "_is_listed", lambda _: True)
    monkeypatch.setattr(cv2, "VideoCapture", capture)
    return opened


def test_a_camera_gives_images_until_it_is_unplugged(plugged_in: list[StandIn]) -> None:
    with open_viewpoint(3, (1920, 1080)) as camera:
        for _ in range(2):
            image, t_ns = camera.read()
            np.testing.assert_array_equal(image, flat())
            assert abs(t_ns - time.monotonic_ns()) < 1e9
        with pytest.raises(CameraError, match="Camera 3 delivers no image; plug it in again"):
            camera.read()
    assert plugged_in[0].asked[cv2.CAP_PROP_FRAME_WIDTH] == 1920
    assert plugged_in[0].asked[cv2.CAP_PROP_FRAME_HEIGHT] == 1080
    assert not plugged_in[0].is_open


def test_cameras_that_can_be_opened_are_listed(plugged_in: list[StandIn]) -> None:
    assert list_viewpoints() == [3]
    assert not any(one.is_open for one in plugged_in)
    with pytest.raises(CameraError, match="camera 2 cannot be opened; close other programs"):
        open_viewpoint(2)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux lists cameras as files")
def test_an_absent_camera_is_named() -> None:
    with pytest.raises(CameraError, match="there is no camera 99; plug it in"):
        open_viewpoint(99)
