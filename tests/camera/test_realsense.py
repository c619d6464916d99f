"""The live camera on a software device, through librealsense's own sensors, syncer and filters."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from handcal.camera.feed import CameraFeed, FeedSettings
from handcal.camera.realsense import RealSenseCamera
from handcal.camera.settings import RealSenseSettings
from handcal.core.errors import CameraError, CameraTimeoutError
from handcal.core.geometry import image_points, rigid, transform
from handcal.core.types import Float64, Frame

PlugIn = Callable[..., Any]


def read_pair(camera: RealSenseCamera) -> Frame:
    """Return a frame with colour; the SDK pairs none at the very beginning."""
    return next(frame for _ in range(20) if (frame := camera.read(5.0)).color is not None)


def test_frames_come_with_their_colour_and_geometry(plug_in: PlugIn) -> None:
    plug_in()
    with RealSenseCamera() as camera:
        assert camera.name == "Intel RealSense D415 (1280x720)"
        frame = read_pair(camera)
        assert camera.depth_intrinsics == frame.depth_intrinsics
    assert frame.depth.shape == (720, 1280)
    assert (frame.depth == 4000 + 10 * frame.index).all()
    assert frame.color is not None
    assert (frame.color == frame.index).all()
    assert frame.depth_scale_m == pytest.approx(0.000125)
    assert frame.t_camera_ns == pytest.approx(frame.index * 33_000_000, abs=1000)
    assert frame.depth_intrinsics.distortion == ()
    assert frame.color_intrinsics is not None
    assert frame.color_intrinsics.distortion[0] == pytest.approx(-0.055, abs=1e-3)
    np.testing.assert_allclose(
        frame.T_C_D, rigid([0.01, -0.02, 0.03], [0.015, 0.001, -0.002]), atol=1e-6
    )


def test_the_largest_size_on_offer_is_taken_or_the_one_asked_for(plug_in: PlugIn) -> None:
    small = plug_in(sizes=((848, 480),))
    with RealSenseCamera() as camera:
        assert camera.read(5.0).depth.shape == (480, 848)
    with pytest.raises(CameraError, match=r"offers no depth with colour of 1280x720 at 30 Hz"):
        RealSenseCamera(RealSenseSettings(profile="1280x720"))
    small.unplug()
    plug_in()
    with RealSenseCamera(RealSenseSettings(profile="848x480")) as camera:
        assert camera.read(5.0).depth.shape == (480, 848)


def test_usb_2_is_named(plug_in: PlugIn) -> None:
    slow = plug_in(sizes=((848, 480),), about={"usb_type_descriptor": "2.1"})
    with RealSenseCamera() as camera:
        assert camera.name == "Intel RealSense D415 (848x480, only USB 2.1)"
    slow.unplug()
    plug_in(sizes=((640, 480),), about={"usb_type_descriptor": "2.1"})
    with pytest.raises(CameraError, match=r"it is on USB 2\.1: use a USB 3 port"):
        RealSenseCamera()


def test_the_device_with_the_serial_is_opened(plug_in: PlugIn) -> None:
    plug_in()
    plug_in(about={"name": "Intel RealSense D455", "serial_number": "456"})
    with RealSenseCamera(RealSenseSettings(serial="456")) as camera:
        assert camera.name.startswith("Intel RealSense D455")
        assert camera.read(5.0).depth.any()


def test_a_device_in_use_says_what_to_do(plug_in: PlugIn) -> None:
    plug_in()
    with RealSenseCamera(), pytest.raises(CameraError, match=r"does not start: .*; close other"):
        RealSenseCamera()


def test_filters_keep_the_frame_and_smooth_its_depth(plug_in: PlugIn) -> None:
    plug_in(sizes=((848, 480),))
    settings = RealSenseSettings(spatial_filter=True, temporal_filter=True, hole_filling=True)
    with RealSenseCamera(settings) as camera:
        frames = [read_pair(camera) for _ in range(6)]
    indices = [frame.index for frame in frames]
    assert indices == sorted(set(indices))
    for frame in frames:
        assert frame.depth_scale_m == pytest.approx(0.000125)
        behind = 4000 + 10 * frame.index - int(frame.depth[240, 424])
        assert 0 <= behind < 100  # the temporal filter follows a depth that grows
    assert any(frame.depth[240, 424] != 4000 + 10 * frame.index for frame in frames)


def test_silence_is_a_timeout_unless_the_device_is_gone(plug_in: PlugIn) -> None:
    device = plug_in(sizes=((848, 480),))
    with RealSenseCamera() as camera:
        camera.read(5.0)
        device.fall_silent()
        with pytest.raises(CameraTimeoutError, match=r"no frame for 0\.2 s"):
            deque(iter(lambda: camera.read(0.2), None))  # to the end of the queue
        device.unplug()
        with pytest.raises(CameraError, match="was unplugged; plug it in again"):
            camera.read(0.1)


def test_a_device_plugged_in_again_goes_on(plug_in: PlugIn) -> None:
    device = plug_in(sizes=((848, 480),))
    settings = FeedSettings(read_s=0.1, silent_s=0.2, reopen_s=0.1)

    def read_until(is_so: Callable[[Frame | None], bool]) -> None:
        deadline_s = time.monotonic() + 20.0
        while not is_so(feed.read()):
            assert time.monotonic() < deadline_s

    with CameraFeed(RealSenseCamera, settings) as feed:
        read_until(lambda frame: frame is not None)
        device.unplug()
        read_until(lambda _: "was unplugged" in feed.status.problem)
        read_until(
            lambda _: "RealSense" in feed.status.problem and "was" not in feed.status.problem
        )
        plug_in(sizes=((848, 480),))
        read_until(lambda frame: frame is not None)
        assert feed.status.problem == ""


def test_the_hand_is_exposed_where_the_colour_camera_sees_it(plug_in: PlugIn) -> None:
    class Exposure:
        aimed: list[Float64] = []  # noqa: RUF012
        restored = 0

        def aim(self, find_px: Callable[[], Float64]) -> None:
            self.aimed.append(find_px())

        def restore(self) -> None:
            self.restored += 1

    plug_in()
    stand_in = Exposure()
    with RealSenseCamera() as camera:
        camera.expose_for(None)  # the software device has no such region: nothing happens
        camera._exposure = stand_in  # type: ignore[assignment]
        frame = read_pair(camera)
        point_m = np.array([[0.02, -0.01, 0.5]], np.float32)
        camera.expose_for(point_m)
        assert frame.color_intrinsics is not None
        expected = image_points(transform(frame.T_C_D, point_m), frame.color_intrinsics)
        assert stand_in.aimed[0] == pytest.approx(expected)
    assert stand_in.restored == 1
