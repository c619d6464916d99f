"""The colour of cameras with depth, and of whatever else shows a board."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.camera.playback import PlaybackSettings
from handcal.camera.recordings import open_recording, record_frames
from handcal.camera.view_source import ColorCamera, open_view_source
from handcal.core.errors import CameraEndError, CameraError
from handcal.core.types import CameraIdentity, Frame

D415 = CameraIdentity("Intel RealSense D415", "123", "5.16.0.1")
MakeFrames = Callable[..., Iterator[Frame]]


@pytest.fixture
def recording(tmp_path: Path, make_frames: MakeFrames) -> Path:
    record_frames(tmp_path / "take", make_frames(3), D415)
    return tmp_path / "take"


def test_a_recording_gives_its_colour_and_tells_its_imager_once(
    recording: Path, make_frames: MakeFrames
) -> None:
    told: list[tuple[Frame, CameraIdentity]] = []
    with open_view_source(str(recording), tell=lambda *both: told.append(both)) as camera:
        for wanted in make_frames(3):
            image, t_ns = camera.read()
            assert wanted.color is not None
            np.testing.assert_array_equal(image, wanted.color)
            assert t_ns == wanted.t_camera_ns
        with pytest.raises(CameraEndError):
            camera.read()
    assert [frame.T_C_D.tolist() for frame, _ in told] == [wanted.T_C_D.tolist()]
    assert [identity for _, identity in told] == [D415]
    with pytest.raises(CameraError, match="is closed"):
        camera.read()


def test_a_camera_without_colour_is_named(tmp_path: Path, make_frames: MakeFrames) -> None:
    record_frames(tmp_path / "gray", make_frames(2, with_color=False))
    playback = PlaybackSettings(loop=True)
    with (
        ColorCamera(open_recording(tmp_path / "gray", playback)) as camera,
        pytest.raises(CameraError, match="Recording gray delivers no colour"),
    ):
        camera.read()


def test_first_frames_without_colour_are_passed_over(
    tmp_path: Path, make_frames: MakeFrames
) -> None:
    first, second = make_frames(2)
    bare = replace(first, color=None, color_intrinsics=None)
    record_frames(tmp_path / "late", iter([second, replace(bare, t_camera_ns=10**9)]))
    with open_view_source(str(tmp_path / "late"), playback=PlaybackSettings(loop=True)) as camera:
        times = [camera.read()[1] for _ in range(2)]
    assert times == [second.t_camera_ns] * 2  # the second, without colour, between them


def test_images_and_cameras_are_opened_by_what_they_are_called(tmp_path: Path) -> None:
    assert cv2.imwrite(str(tmp_path / "a.png"), np.zeros((48, 64, 3), np.uint8))
    with open_view_source(str(tmp_path)) as camera:
        assert camera.read()[0].shape == (48, 64, 3)
    with pytest.raises(CameraError, match="camera 9"):
        open_view_source("9")
