"""Data that librealsense cannot record; the rest is tested by playback."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.camera.recording import RecordingCamera, record_db3
from handcal.core.types import Frame

pytest.importorskip("pyrealsense2")

MakeFrames = Callable[..., Iterator[Frame]]


def test_what_cannot_be_recorded_leaves_nothing_behind(
    tmp_path: Path, make_frames: MakeFrames
) -> None:
    with pytest.raises(ValueError, match=r"only \.db3"):
        record_db3(tmp_path / "hand.bag", make_frames(1))
    (frame,) = make_frames(1, with_color=False)
    rational = replace(frame.depth_intrinsics, distortion=(0.1,) * 8)
    with pytest.raises(ValueError, match="5 distortion coefficients, not 8; record into a folder"):
        record_db3(tmp_path / "hand.db3", [replace(frame, depth_intrinsics=rational)])
    with pytest.raises(ValueError, match="holds no poses; record this camera into a folder"):
        record_db3(tmp_path / "hand.db3", [replace(frame, T_W_D=np.eye(4))])
    with pytest.raises(ValueError, match="not from the camera"):
        record_db3(tmp_path / "hand.db3", [frame, *make_frames(1)])
    assert list(tmp_path.iterdir()) == []


def test_a_frame_may_lack_colour(tmp_path: Path, make_frames: MakeFrames) -> None:
    frames = list(make_frames(5))
    frames[2] = replace(frames[2], color=None, color_intrinsics=None, T_C_D=np.eye(4))
    record_db3(tmp_path / "hand.db3", frames)
    with RecordingCamera(tmp_path / "hand.db3") as camera:
        played = [camera.read() for _ in frames]
    assert [frame.index for frame in played] == [1, 2, 3, 4, 5]
    for got, want in zip(played, frames, strict=True):
        np.testing.assert_array_equal(got.depth, want.depth)
        if want.color is not None:
            np.testing.assert_array_equal(got.color, want.color)


def test_a_failure_leaves_an_older_recording_alone(tmp_path: Path, make_frames: MakeFrames) -> None:
    path = tmp_path / "hand.db3"
    record_db3(path, make_frames(2))
    before = path.read_bytes()

    def failing() -> Iterator[Frame]:
        yield from make_frames(2)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record_db3(path, failing())
    assert [path.name for path in tmp_path.iterdir()] == ["hand.db3"]
    assert path.read_bytes() == before
