"""ROS 2 recordings, written by rosbags and played as a camera."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handcal.camera.recordings import open_recording
from handcal.camera.ros import RosCamera, ros_recording
from handcal.core.errors import CameraEndError, CameraError
from handcal.core.geometry import rigid
from handcal.core.types import Frame, Intrinsics
from tests.camera.rosbag import (
    COLOR,
    DEPTH,
    TYPES,
    compressed,
    frame_messages,
    image,
    info,
    transforms,
    write_messages,
    write_ros1,
    write_rosbag,
)

CAMERA = Intrinsics(4, 3, 5.0, 5.0, 1.5, 1.0)
INFO = ("/camera/depth/camera_info", 1, info(CAMERA, "depth"))
GRAY = np.arange(12, dtype=np.uint16).reshape(3, 4)
MakeFrames = Callable[..., Iterator[Frame]]


@pytest.mark.parametrize("is_mcap", [True, False])
def test_every_pixel_and_number_comes_back(
    tmp_path: Path, make_frames: MakeFrames, is_mcap: bool
) -> None:
    write_rosbag(tmp_path / "bag", make_frames(5), is_mcap)
    (file,) = (path for path in (tmp_path / "bag").iterdir() if path.suffix in (".mcap", ".db3"))
    with open_recording(file) as camera:
        assert isinstance(camera, RosCamera)
        for wanted in make_frames(5):
            frame = camera.read()
            assert frame.color is not None
            assert wanted.color is not None
            assert np.array_equal(frame.depth, wanted.depth)
            assert np.array_equal(frame.color, wanted.color)
            assert frame.t_camera_ns == wanted.t_camera_ns
            assert frame.depth_scale_m == 1e-3
            assert frame.depth_intrinsics == wanted.depth_intrinsics
            assert frame.color_intrinsics == wanted.color_intrinsics
            np.testing.assert_allclose(frame.T_C_D, wanted.T_C_D, atol=1e-12)
        with pytest.raises(CameraEndError):
            camera.read()
        camera.seek(0.0)
        assert camera.read().index == 1


def play(folder: Path, messages: list[tuple[str, int, Any]]) -> Frame:
    write_messages(folder / "bag", messages)
    with RosCamera(folder / "bag") as camera:
        return camera.read()


@pytest.mark.parametrize("is_ros1", [False, True])
@pytest.mark.parametrize("is_compressed", [("color",), ("color", "depth"), ()])
def test_compressed_images_and_ros_1_are_played_alike(
    tmp_path: Path, make_frames: MakeFrames, is_compressed: tuple[str, ...], is_ros1: bool
) -> None:
    ways = {DEPTH: "compressedDepth", COLOR: "compressed"}
    plain = np.full((60, 80, 3), [200, 100, 0], np.uint8)  # JPEG loses little of it
    frames = [replace(frame, color=plain) for frame in make_frames(3)]
    messages = [
        (f"{topic}/{ways[topic]}", t_ns, compressed(message))
        if topic in ways and topic.split("/")[2] in is_compressed
        else (topic, t_ns, message)
        for topic, t_ns, message in frame_messages(frames)
    ]
    path = tmp_path / ("some.bag" if is_ros1 else "folder")
    (write_ros1 if is_ros1 else write_messages)(path, messages)
    with open_recording(path) as camera:
        assert isinstance(camera, RosCamera)
        for wanted in frames:
            frame = camera.read()
            assert frame.color is not None
            assert np.array_equal(frame.depth, wanted.depth)
            assert np.abs(frame.color - plain.astype(int)).max() <= 3
            np.testing.assert_allclose(frame.T_C_D, wanted.T_C_D, atol=1e-12)
            assert frame.t_camera_ns == wanted.t_camera_ns
        assert camera.notes == ()


def test_compressed_metres_are_a_over_value_minus_b(tmp_path: Path) -> None:
    metres = np.array([[np.nan, 0.4, 0.5, 0.6], [0.7, 0.8, 1, 2], [0.3, 0.5, 0.5, 3]], "<f4")
    message = compressed(image(2, "depth", "32FC1", metres), 2_000.0, 9.0)
    frame = play(tmp_path, [INFO, (f"{DEPTH}/compressedDepth", 2, message)])
    wanted = np.nan_to_num(metres)
    assert np.abs(frame.depth * frame.depth_scale_m - wanted).max() < 5e-3
    assert frame.depth[0, 0] == 0


def test_what_is_not_played_is_said(tmp_path: Path) -> None:
    grey = np.zeros((3, 4), np.uint8)
    packed = compressed(image(2, "color", "rgb8", np.zeros((3, 4, 3), np.uint8)))
    messages = [
        INFO,
        (DEPTH, 2, image(2, "depth", "16UC1", GRAY)),
        ("/camera/infra1/image_rect_raw", 2, image(2, "depth", "mono8", grey)),
        (f"{COLOR}/compressed", 2, packed),
        ("/odom", 2, TYPES["std_msgs/msg/String"]("here")),
    ]
    write_messages(tmp_path / "bag", messages)
    with RosCamera(tmp_path / "bag") as camera:
        assert camera.read().color is None
    assert camera.notes == (
        f"not played: {COLOR}/compressed (no camera_info for it)",
        "not played: /camera/infra1/image_rect_raw ('mono8' is not read)",
        "not played: /odom (std_msgs/msg/String is not read)",
    )


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("part", ["translation", "rotation"])
def test_a_transform_that_is_not_finite_is_refused(tmp_path: Path, value: float, part: str) -> None:
    message = transforms(("depth", "color", np.eye(4)))
    getattr(message.transforms[0].transform, part).x = value
    messages = [
        INFO,
        ("/camera/color/camera_info", 1, info(CAMERA, "color")),
        ("/tf_static", 1, message),
        (COLOR, 1, image(1, "color", "rgb8", np.zeros((3, 4, 3), np.uint8))),
        (DEPTH, 2, image(2, "depth", "16UC1", GRAY)),
    ]
    with pytest.raises(CameraError, match="'depth' and 'color' is not made of finite numbers"):
        play(tmp_path, messages)


def test_a_bag_of_librealsense_is_not_one_of_ros_1(tmp_path: Path, shared_data: Path) -> None:
    write_ros1(tmp_path / "ros.bag", [INFO])
    assert ros_recording(tmp_path / "ros.bag") == tmp_path / "ros.bag"
    for path in (shared_data / "recordings").glob("*.bag"):
        assert ros_recording(path) is None


def test_metres_become_tenths_of_a_millimetre(tmp_path: Path) -> None:
    metres = np.array([[0.0, np.nan, np.inf, -1.0], [0.5, 6.5, 6.6, 0.00004], [1, 2, 3, 4]], "<f4")
    frame = play(tmp_path, [INFO, (DEPTH, 2, image(2, "depth", "32FC1", metres))])
    assert frame.depth_scale_m == 1e-4
    wanted = [[0, 0, 0, 0], [5000, 65000, 0, 0], [10000, 20000, 30000, 40000]]
    assert frame.depth.tolist() == wanted


def test_blue_first_colours_are_turned_and_the_nearest_in_time_taken(tmp_path: Path) -> None:
    T_D_C = rigid([0.0, 0.1, 0.0], [0.015, 0.0, 0.0])
    color = np.zeros((3, 4, 4), np.uint8)
    color[..., 0], color[..., 2] = 10, 30
    messages = [
        INFO,
        ("/camera/color/camera_info", 1, info(CAMERA, "color")),
        ("/tf_static", 1, transforms(("depth", "color", T_D_C))),
        (COLOR, 1, image(970_000_000, "color", "bgra8", color + 1)),
        (DEPTH, 2, image(1_000_000_000, "depth", "16UC1", GRAY)),
        (COLOR, 3, image(1_010_000_000, "color", "bgra8", color)),
    ]
    frame = play(tmp_path, messages)
    assert frame.color is not None
    assert frame.color[0, 0].tolist() == [30, 0, 10]
    np.testing.assert_allclose(frame.T_C_D, np.linalg.inv(T_D_C), atol=1e-12)


@pytest.mark.parametrize(
    ("messages", "problem"),
    [
        ([INFO], "no depth images"),
        ([(DEPTH, 2, image(2, "depth", "16UC1", GRAY))], "no camera_info for /camera/depth"),
        (
            [
                ("/camera/depth/camera_info", 1, info(CAMERA, "depth", "equidistant")),
                (DEPTH, 2, image(2, "depth", "16UC1", GRAY)),
            ],
            "lens model 'equidistant'",
        ),
        (
            [
                ("/camera/depth/camera_info", 1, info(replace(CAMERA, fx=np.nan), "depth")),
                (DEPTH, 2, image(2, "depth", "16UC1", GRAY)),
            ],
            "not those of a camera",
        ),
        ([INFO, (DEPTH, 2, image(2, "depth", "16UC1", GRAY[:2]))], "not of its camera's size"),
    ],
)
def test_what_cannot_be_played_is_one_line(
    tmp_path: Path, messages: list[tuple[str, int, Any]], problem: str
) -> None:
    with pytest.raises(CameraError, match=problem) as caught:
        play(tmp_path, messages)
    assert "\n" not in str(caught.value)


def test_colour_without_a_transform_is_refused(tmp_path: Path, make_frames: MakeFrames) -> None:
    messages = [one for one in frame_messages(make_frames(2)) if one[0] != "/tf_static"]
    with pytest.raises(CameraError, match="no transform between 'depth' and 'color'"):
        play(tmp_path, messages)


@pytest.mark.parametrize("is_mcap", [True, False])
def test_a_damaged_recording_is_one_error(
    tmp_path: Path, make_frames: MakeFrames, is_mcap: bool
) -> None:
    write_rosbag(tmp_path / "bag", make_frames(3), is_mcap)
    (file,) = (path for path in (tmp_path / "bag").iterdir() if path.suffix in (".mcap", ".db3"))
    whole = file.read_bytes()
    for size in (0, 100, len(whole) // 2):
        file.write_bytes(whole[:size])
        with pytest.raises(CameraError) as caught, open_recording(tmp_path / "bag") as camera:
            assert [camera.read() for _ in range(3)] == []
        assert "\n" not in str(caught.value)
    (tmp_path / "bag/metadata.yaml").write_text("rosbag2_bagfile_information: []")
    with pytest.raises(CameraError, match="cannot be read as a recording of ROS"):
        open_recording(tmp_path / "bag")
