"""The live camera on a software device, through librealsense's own sensors and filters."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from handcal.camera.realsense import HandExposure, RealSenseCamera, apply_options
from handcal.camera.sdk_frames import opencv_distortion
from handcal.camera.settings import RealSenseSettings
from handcal.core.errors import CameraError, CameraTimeoutError
from handcal.core.geometry import image_points, rigid, transform
from handcal.core.types import Float64, Frame, Intrinsics

rs = pytest.importorskip("pyrealsense2")

# As a D455's colour, a wide lens, and a D415's, a long one.
WIDE = (-0.055, 0.066, -0.0005, 0.0005, -0.021)
LONG = (0.15, -0.5, 0.0008, -0.0004, 0.45)


def sdk_camera(model: Any, coefficients: tuple[float, ...], focal_px: float = 640.0) -> Any:
    camera = rs.intrinsics()
    camera.width, camera.height, camera.ppx, camera.ppy = 1280, 720, 642.0, 362.0
    camera.fx = camera.fy = focal_px
    camera.model, camera.coeffs = model, list(coefficients)
    return camera


@pytest.mark.parametrize(("coefficients", "focal_px"), [(WIDE, 640.0), (LONG, 925.0)])
def test_inverse_brown_conrady_projects_as_librealsense_does(
    coefficients: tuple[float, ...], focal_px: float
) -> None:
    camera = sdk_camera(rs.distortion.inverse_brown_conrady, coefficients, focal_px)
    opencv = Intrinsics(1280, 720, focal_px, focal_px, 642.0, 362.0, opencv_distortion(camera))
    pixels = [[u, v] for u in range(0, 1280, 127) for v in range(0, 720, 71)]
    points = [rs.rs2_deproject_pixel_to_point(camera, pixel, 0.5) for pixel in pixels]
    off_px = np.abs(image_points(points, opencv) - pixels).max()
    assert off_px < 0.02
    undistorted = Intrinsics(1280, 720, focal_px, focal_px, 642.0, 362.0)
    assert np.abs(image_points(points, undistorted) - pixels).max() > 1.0  # what leaving it out is


def test_brown_conrady_is_opencvs_own_and_nothing_is_nothing() -> None:
    camera = sdk_camera(rs.distortion.brown_conrady, WIDE)
    assert opencv_distortion(camera) == pytest.approx(WIDE, rel=1e-6)
    assert opencv_distortion(sdk_camera(rs.distortion.inverse_brown_conrady, (0.0,) * 5)) == ()


def test_a_lens_that_opencv_cannot_describe_is_refused() -> None:
    fisheye = sdk_camera(rs.distortion.ftheta, (0.9, 0.0, 0.0, 0.0, 0.0), 300.0)
    with pytest.raises(CameraError, match=r"ftheta, is unknown to OpenCV: .* px off"):
        opencv_distortion(fisheye)


OPTIONS = {
    "enable_auto_exposure": (0.0, 1.0),
    "exposure": (1.0, 165_000.0),
    "laser_power": (0.0, 360.0),
    "visual_preset": (0.0, 6.0),
    "global_time_enabled": (0.0, 1.0),
}


def values(camera: Any) -> dict[str, float]:
    return {name: camera.depth.get_option(getattr(rs.option, name)) for name in OPTIONS}


def test_what_is_set_reaches_the_device(plug_in: Callable[..., Any]) -> None:
    camera = plug_in(options=OPTIONS)
    settings = RealSenseSettings(preset="hand", exposure_us=8000.0, laser_power_mw=300.0)
    apply_options(camera.device, settings)
    assert values(camera) == {
        "enable_auto_exposure": 0.0,
        "exposure": 8000.0,
        "laser_power": 300.0,
        "visual_preset": float(rs.rs400_visual_preset.hand),
        "global_time_enabled": 1.0,
    }
    # What is not set stays, but exposure is automatic again.
    apply_options(camera.device, RealSenseSettings())
    assert values(camera)["enable_auto_exposure"] == 1.0
    assert values(camera)["laser_power"] == 300.0


def test_what_the_device_cannot_is_named(plug_in: Callable[..., Any]) -> None:
    with pytest.raises(CameraError, match="this camera has no laser power to set"):
        apply_options(plug_in().device, RealSenseSettings(laser_power_mw=10.0))
    apply_options(plug_in().device, RealSenseSettings())
    with pytest.raises(
        CameraError, match="laser power cannot be set to 500; it ranges from 0 to 360 mW"
    ):
        apply_options(plug_in(options=OPTIONS).device, RealSenseSettings(laser_power_mw=500.0))


class RoiSensor:
    """Stands for a sensor that measures its exposure on a region."""

    def __init__(self) -> None:
        self.own = region(0, 0, 639, 479)
        self.regions: list[tuple[int, int, int, int]] = []
        self.refuses = False

    def get_region_of_interest(self) -> Any:
        return self.own

    def set_region_of_interest(self, new: Any) -> None:
        if self.refuses:
            raise RuntimeError("hwmon command 0x80 failed")
        self.regions.append((new.min_x, new.min_y, new.max_x, new.max_y))


def region(*sides: int) -> Any:
    made = rs.region_of_interest()
    made.min_x, made.min_y, made.max_x, made.max_y = sides
    return made


WHOLE = (0, 0, 639, 479)


def aimed(sensor: RoiSensor) -> tuple[HandExposure, Callable[..., None]]:
    """Return the exposure of a sensor, and a function that shows it a hand at a time."""
    now_s = [0.0]
    exposure = HandExposure(sensor, (640, 480), lambda: now_s[0])

    def show(time_s: float, *corners: tuple[float, float]) -> None:
        now_s[0] = time_s
        exposure.aim((lambda: np.array(corners)) if corners else None)

    return exposure, show


HAND = ((100.4, 50.0), (200.0, 149.2))


def test_exposure_follows_the_hand_once_a_second() -> None:
    sensor = RoiSensor()
    _, show = aimed(sensor)
    for time_s in (0.0, 0.4, 0.9):
        show(time_s, *HAND)
    assert sensor.regions == [(100, 50, 200, 150)]
    show(1.0, (-20.0, 400.0), (90.0, 700.0))
    assert sensor.regions[1:] == [(0, 400, 90, 479)]


def test_the_sensors_own_region_returns_at_close_and_without_a_hand() -> None:
    sensor = RoiSensor()
    exposure, show = aimed(sensor)
    exposure.restore()
    assert sensor.regions == []
    show(0.0, *HAND)
    show(2.9)
    assert len(sensor.regions) == 1
    show(3.0)
    assert sensor.regions[1:] == [WHOLE]
    show(3.1, *HAND)
    exposure.restore()
    exposure.restore()
    assert sensor.regions[3:] == [WHOLE]


def test_a_hand_outside_the_image_and_a_refusal_change_nothing() -> None:
    sensor = RoiSensor()
    _, show = aimed(sensor)
    show(0.0, (700.0, 10.0), (800.0, 90.0))
    sensor.refuses = True
    show(1.0, *HAND)
    assert sensor.regions == []
    sensor.refuses = False
    show(2.0, *HAND)
    assert len(sensor.regions) == 1


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
