"""Pace, seeking and starting over of recordings, and frames of one camera only."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.camera.playback import PlaybackSettings, of_one_camera
from handcal.camera.recordings import open_recording, record_frames
from handcal.core.errors import CameraEndError, CameraTimeoutError
from handcal.core.types import Frame

MakeFrames = Callable[..., Iterator[Frame]]


def test_frames_of_one_camera_pass_in_order_even_without_colour(make_frames: MakeFrames) -> None:
    pairs = list(make_frames(3))
    pairs[1] = replace(pairs[1], color=None, color_intrinsics=None, T_C_D=np.eye(4))
    first, frames = of_one_camera(iter(pairs))
    assert first is pairs[0]
    assert list(frames) == pairs


@pytest.mark.parametrize("change", ["scale", "depth", "color", "pose"])
def test_another_camera_is_noticed(make_frames: MakeFrames, change: str) -> None:
    one, other = make_frames(2)
    assert one.color_intrinsics is not None
    changed = {
        "scale": replace(other, depth_scale_m=0.001),
        "depth": replace(other, depth_intrinsics=replace(one.depth_intrinsics, fx=1.0)),
        "color": replace(other, color_intrinsics=replace(one.color_intrinsics, fx=1.0)),
        "pose": replace(other, T_C_D=np.eye(4)),
    }[change]
    _, frames = of_one_camera([one, changed])
    assert next(frames) is one
    with pytest.raises(ValueError, match="frame 2 is not from the camera of the first frame"):
        next(frames)


def test_nothing_cannot_be_recorded() -> None:
    with pytest.raises(ValueError, match="no frame to record"):
        of_one_camera([])


COUNT = 20
PERIOD_S = 0.033


@pytest.fixture(params=["recording", "recording.db3"])
def path(
    request: pytest.FixtureRequest, tmp_path: Path, make_frames: Callable[..., Iterator[Frame]]
) -> Path:
    if request.param.endswith(".db3"):
        pytest.importorskip("pyrealsense2")
    made: Path = tmp_path / request.param
    assert record_frames(made, make_frames(COUNT)) == COUNT
    return made


def test_every_frame_comes_as_fast_as_it_is_read(path: Path) -> None:
    with open_recording(path) as camera:
        time.sleep(0.1)  # which loses none
        assert [camera.read().index for _ in range(COUNT)] == list(range(1, COUNT + 1))
        for _ in range(2):
            with pytest.raises(CameraEndError, match="has ended"):
                camera.read()


def test_in_real_time_no_frame_comes_before_it_is_due(path: Path) -> None:
    frames: list[Frame] = []
    with (
        open_recording(path, PlaybackSettings(real_time=True)) as camera,
        suppress(CameraEndError),
    ):
        while True:
            frames.append(camera.read())
    assert len(frames) > 1
    for frame in frames[1:]:
        due_s = (frame.index - frames[0].index) * PERIOD_S
        assert (frame.t_host_ns - frames[0].t_host_ns) * 1e-9 > due_s - PERIOD_S


def test_in_real_time_what_is_read_too_late_is_dropped(path: Path) -> None:
    with open_recording(path, PlaybackSettings(real_time=True)) as camera:
        assert camera.read().index == 1
        time.sleep(8 * PERIOD_S)
        assert camera.read(5.0).index > 6


def test_in_real_time_a_frame_not_yet_due_is_waited_for(path: Path) -> None:
    with open_recording(path, PlaybackSettings(real_time=True)) as camera:
        camera.read()
        camera.seek(0.0)
        assert camera.read().index == 1
        with pytest.raises(CameraTimeoutError, match="not due yet"):
            deque(iter(lambda: camera.read(0.001), None))
        assert camera.read().index in range(2, COUNT)


def test_seeking_goes_to_the_first_frame_from_there_on(path: Path) -> None:
    with open_recording(path) as camera:
        camera.seek(10 * PERIOD_S)
        frames = [camera.read(), camera.read()]
        assert [frame.index for frame in frames] == [11, 12]
        assert all(frame.color is not None for frame in frames)
        camera.seek(4.5 * PERIOD_S)
        assert camera.read().index == 6
        camera.seek(0.0)
        assert camera.read().index == 1
        camera.seek(COUNT * PERIOD_S)
        with pytest.raises(CameraEndError):
            camera.read()
        camera.seek(0.0)
        assert camera.read().index == 1


def test_a_loop_begins_again(path: Path) -> None:
    with open_recording(path, PlaybackSettings(loop=True)) as camera:
        frames = [camera.read() for _ in range(2 * COUNT + 1)]
    assert [frame.index for frame in frames] == [*range(1, COUNT + 1)] * 2 + [1]
    assert all(frame.color is not None for frame in frames)
