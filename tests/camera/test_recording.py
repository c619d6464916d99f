"""Recordings made and played back through librealsense, with no camera attached."""

from __future__ import annotations

import sqlite3
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.camera.recording import RecordingCamera, record_db3
from handcal.core.errors import CameraEndError, CameraError
from handcal.core.types import Frame, Intrinsics

if sys.platform == "darwin":
    pytest.skip("pyrealsense2 has no package for macOS", allow_module_level=True)

MakeFrames = Callable[..., Iterator[Frame]]
SQLITE = b"SQLite format 3\0"


def read_all(camera: RecordingCamera) -> Iterator[Frame]:
    while True:
        try:
            yield camera.read()
        except CameraEndError:
            return


def assert_same_camera(got: Intrinsics | None, want: Intrinsics | None) -> None:
    assert got is not None
    assert want is not None
    assert (got.width, got.height) == (want.width, want.height)
    np.testing.assert_allclose(
        [got.fx, got.fy, got.cx, got.cy, *got.distortion],
        [want.fx, want.fy, want.cx, want.cy, *want.distortion],
        rtol=1e-6,
    )


@pytest.mark.parametrize("with_color", [True, False])
def test_recording_plays_back_what_was_recorded(
    tmp_path: Path, make_frames: MakeFrames, with_color: bool
) -> None:
    path = tmp_path / "hand.db3"
    assert record_db3(path, make_frames(12, with_color)) == 12
    assert [file.name for file in tmp_path.iterdir()] == ["hand.db3"]
    with RecordingCamera(path) as camera:
        frames = list(read_all(camera))
    for got, want in zip(frames, make_frames(12, with_color), strict=True):
        assert got.index == want.index
        assert got.t_camera_ns == pytest.approx(want.t_camera_ns, abs=1000)
        assert got.depth_scale_m == pytest.approx(want.depth_scale_m)
        assert_same_camera(got.depth_intrinsics, want.depth_intrinsics)
        np.testing.assert_array_equal(got.depth, want.depth)
        np.testing.assert_allclose(got.T_C_D, want.T_C_D, atol=1e-6)
        if want.color is None:
            assert got.color is None
        else:
            assert got.color is not None
            np.testing.assert_array_equal(got.color, want.color)
            assert_same_camera(got.color_intrinsics, want.color_intrinsics)


def test_missing_and_damaged_recordings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CameraError, match="there is no recording"):
        RecordingCamera(tmp_path / "absent.db3")
    damaged = tmp_path / "damaged.db3"
    damaged.write_bytes(b"not a data base" * 100)
    with pytest.raises(CameraError, match="is not a recording; choose"):
        RecordingCamera(damaged)
    damaged.write_bytes(SQLITE + b"not a data base" * 100)
    with pytest.raises(CameraError, match="cannot be played"):
        RecordingCamera(damaged)


def test_an_option_that_librealsense_does_not_know_is_refused(
    tmp_path: Path, make_frames: MakeFrames
) -> None:
    path = tmp_path / "newer.db3"
    record_db3(path, make_frames(2, False))
    with closing(sqlite3.connect(path)) as file, file:
        changed = file.execute("UPDATE topics SET name = replace(name, 'Depth_Units', 'Newest')")
        assert changed.rowcount > 0
    with pytest.raises(CameraError, match="option 'Newest', which this pyrealsense2 does not know"):
        RecordingCamera(path)  # librealsense would never end


def test_real_recordings_with_larger_color_play(shared_data: Path) -> None:
    paths = sorted((shared_data / "recordings").glob("*.bag"))
    assert paths
    for path in paths:
        with RecordingCamera(path) as camera:
            frame = camera.read(5.0)
            assert frame.depth.shape == (720, 1280)
            assert frame.color is not None
            assert frame.color.shape == (1080, 1920, 3)
            assert 0.0 < np.linalg.norm(frame.T_C_D[:3, 3]) < 0.1
            assert frame.depth_scale_m == pytest.approx(0.001)
            with pytest.raises(CameraEndError):
                camera.read()


def test_what_cannot_be_recorded_leaves_nothing_behind(
    tmp_path: Path, make_frames: MakeFrames
) -> None:
    with pytest.raises(ValueError, match=r"only \.db3"):
        record_db3(tmp_path / "hand.bag", make_frames(1))
    (frame,) = make_frames(1, with_color=False)
    rational = replace(frame.depth_intrinsics, distortion=(0.1,) * 8)
    with pytest.raises(ValueError, match="5 distortion coefficients, not 8; record into a folder"):
        record_db3(tmp_path / "hand.db3", [replace(frame, depth_intrinsics=rational)])
    with pytest.raises(ValueError, match="holds no poses: record this camera into a folder"):
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
