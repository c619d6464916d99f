"""Frames of a known camera, and a RealSense made of software."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pytest

from handcal.camera import sdk_devices
from handcal.core.geometry import rigid
from handcal.core.types import Float64, Frame, Intrinsics
from handcal.io.closable import Closable

_SCALE_M = 0.000125
_T_C_D: Float64 = rigid([0.01, -0.02, 0.03], [0.015, 0.001, -0.002])
_DEPTH = Intrinsics(64, 48, 60.0, 61.0, 31.5, 23.5)
_COLOR = Intrinsics(80, 60, 75.0, 75.0, 40.0, 30.0, (0.1, -0.05, 0.001, 0.002, 0.01))
_PERIOD_NS = 33_000_000


@pytest.fixture(scope="session")
def make_frames() -> Callable[..., Iterator[Frame]]:
    """Return a maker of noisy frames of one camera, the same frames at each call."""

    def make(count: int, with_color: bool = True) -> Iterator[Frame]:
        rng = np.random.default_rng(1)
        for index in range(1, count + 1):
            yield Frame(
                index=index,
                t_camera_ns=index * _PERIOD_NS,
                t_host_ns=0,
                depth=rng.integers(0, 65535, (48, 64), np.uint16),
                depth_scale_m=_SCALE_M,
                depth_intrinsics=_DEPTH,
                color=rng.integers(0, 255, (60, 80, 3), np.uint8) if with_color else None,
                color_intrinsics=_COLOR if with_color else None,
                T_C_D=_T_C_D if with_color else np.eye(4),
            )

    return make


_INVERSE = (-0.055, 0.066, -0.0005, 0.0005, -0.021)


class SoftwareRealSense(Closable):
    """A software device of librealsense that sends a frame pair every few milliseconds.

    Each depth pixel is 4,000 plus ten times the frame's number, each colour value the number.

    Parameters
    ----------
    plugged : list of SoftwareRealSense
        The connected devices, as listed by the SDK.
    sizes : sequence of (width, height)
        The supported profiles.
    about : mapping of str to str
        The device's description, by the names of the SDK's camera_info.
    options : mapping of str to (low, high)
        Writable options of the depth sensor, by the SDK's names.
    """

    def __init__(
        self,
        plugged: list[SoftwareRealSense],
        sizes: tuple[tuple[int, int], ...] = ((1280, 720), (848, 480)),
        about: Mapping[str, str] | None = None,
        options: Mapping[str, tuple[float, float]] | None = None,
    ) -> None:
        import pyrealsense2 as rs

        self._rs = rs
        self._plugged = plugged
        self.device = rs.software_device()
        known = {
            "name": "Intel RealSense D415",
            "serial_number": "123",
            "firmware_version": "5.16.0.1",
            "usb_type_descriptor": "3.2",
        } | dict(about or {})
        for what, told in known.items():
            self.device.register_info(getattr(rs.camera_info, what), told)
        self.depth = self.device.add_sensor("Stereo Module")
        self.color = self.device.add_sensor("RGB Camera")
        self.depth.add_read_only_option(rs.option.depth_units, _SCALE_M)
        self.depth.add_read_only_option(rs.option.asic_temperature, 41.0)
        for name, (low, high) in (options or {}).items():
            limits = rs.option_range()
            limits.min, limits.max, limits.step, limits.default = low, high, 1.0, low
            self.depth.add_option(getattr(rs.option, name), limits, True)
        for number, size in enumerate(sizes):
            depth = self._add_stream(self.depth, rs.stream.depth, 2 * number, size)
            color = self._add_stream(self.color, rs.stream.color, 2 * number + 1, size)
            depth.register_extrinsics_to(color, _extrinsics(rs))
        self._number = 0
        self._may_run = threading.Event()
        self._may_run.set()
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def fall_silent(self) -> None:
        """Stop sending frames."""
        self._may_run.clear()

    def unplug(self) -> None:
        """Stop sending frames and leave the list of devices."""
        self.fall_silent()
        self._plugged.remove(self)

    def close(self) -> None:
        self._is_over.set()
        self._thread.join()

    def _add_stream(self, sensor: Any, stream: Any, uid: int, size: tuple[int, int]) -> Any:
        rs = self._rs
        is_depth = stream == rs.stream.depth
        video = rs.video_stream()
        video.type, video.index, video.uid, video.fps = stream, 0, uid, 30
        video.width, video.height = size
        video.bpp, video.fmt = (2, rs.format.z16) if is_depth else (3, rs.format.rgb8)
        intrinsics = rs.intrinsics()
        intrinsics.width, intrinsics.height = size
        intrinsics.fx = intrinsics.fy = 0.8 * size[0]
        intrinsics.ppx, intrinsics.ppy = size[0] / 2, size[1] / 2
        intrinsics.model = rs.distortion.inverse_brown_conrady
        intrinsics.coeffs = [0.0] * 5 if is_depth else list(_INVERSE)
        video.intrinsics = intrinsics
        return sensor.add_video_stream(video)

    def _run(self) -> None:
        while not self._is_over.wait(0.01):
            active = [(s, p) for s in (self.depth, self.color) for p in s.get_active_streams()]
            if active and self._may_run.is_set():
                self._number += 1
                for sensor, profile in active:
                    self._push(sensor, profile.as_video_stream_profile())

    def _push(self, sensor: Any, profile: Any) -> None:
        rs, number = self._rs, self._number
        is_depth = profile.stream_type() == rs.stream.depth
        shape = profile.height(), profile.width()
        image = (
            np.full(shape, 4000 + 10 * number, np.uint16)
            if is_depth
            else np.full((*shape, 3), number % 256, np.uint8)
        )
        sensor.set_metadata(rs.frame_metadata_value.actual_fps, 30_000)
        frame = rs.software_video_frame()
        frame.pixels, frame.bpp, frame.profile = image, image.strides[1], profile
        frame.stride = image.strides[0]
        frame.timestamp, frame.frame_number = number * 33.0, number
        frame.domain = rs.timestamp_domain.hardware_clock
        if is_depth:
            frame.depth_units = _SCALE_M
        sensor.on_video_frame(frame)


def _extrinsics(rs: Any) -> Any:
    extrinsics = rs.extrinsics()
    extrinsics.rotation = _T_C_D[:3, :3].T.ravel().tolist()
    extrinsics.translation = _T_C_D[:3, 3].tolist()
    return extrinsics


@pytest.fixture
def plug_in(
    monkeypatch: pytest.MonkeyPatch,
) -> Iterator[Callable[..., SoftwareRealSense]]:
    """Return a function that connects a software RealSense made with the arguments given."""
    pytest.importorskip("pyrealsense2")
    plugged: list[SoftwareRealSense] = []
    made: list[SoftwareRealSense] = []
    monkeypatch.setattr(sdk_devices, "_query", lambda: [one.device for one in plugged])

    def plug_in(**how: Any) -> SoftwareRealSense:
        made.append(SoftwareRealSense(plugged, **how))
        plugged.append(made[-1])
        return made[-1]

    yield plug_in
    for one in made:
        one.close()
