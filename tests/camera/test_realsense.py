"""Devices by a stand-in for the SDK, their frames from a recording: no camera is attached."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handcal.camera import realsense
from handcal.camera.realsense import Device, RealSenseCamera, connected_devices, librealsense
from handcal.camera.recording import record_db3
from handcal.errors import CameraEndError, CameraError, CameraTimeoutError
from handcal.geometry import rigid
from handcal.types import Frame, Intrinsics

INFO = SimpleNamespace(
    name="name", serial_number="serial", firmware_version="firmware", usb_type_descriptor="usb"
)


class ListedDevice:
    """A device that knows some things about itself."""

    def __init__(self, **known: str) -> None:
        self._known = known

    def supports(self, info: str) -> bool:
        return info in self._known

    def get_info(self, info: str) -> str:
        return self._known[info]


def pretend(monkeypatch: pytest.MonkeyPatch, query: Any) -> None:
    sdk = SimpleNamespace(camera_info=INFO, context=lambda: SimpleNamespace(query_devices=query))
    monkeypatch.setattr(realsense, "librealsense", lambda: sdk)


def test_devices_are_described_by_what_they_tell(monkeypatch: pytest.MonkeyPatch) -> None:
    d415 = ListedDevice(name="D415", serial="123", firmware="5.16", usb="3.2")
    pretend(monkeypatch, lambda: [d415, ListedDevice(name="D405", serial="4")])
    assert connected_devices() == [
        Device("D415", "123", "5.16", "3.2"),
        Device("D405", "4", "", ""),
    ]


def test_a_failing_sdk_is_one_clear_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> list[Any]:
        raise RuntimeError("failed to set power state")

    pretend(monkeypatch, fail)
    with pytest.raises(CameraError, match="cannot list devices: failed to set power state"):
        connected_devices()


def test_a_missing_sdk_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyrealsense2", None)
    with pytest.raises(CameraError, match="pip install pyrealsense2"):
        librealsense()
    with pytest.raises(CameraError, match="pip install pyrealsense2"):
        connected_devices()


def test_the_installed_sdk_can_look() -> None:
    pytest.importorskip("pyrealsense2")
    assert all(isinstance(device, Device) for device in connected_devices())


D415 = Device("Intel RealSense D415", "123", "5.16", "3.2")
CAMERA = Intrinsics(64, 48, 60.0, 61.0, 31.5, 23.5)
T_C_D = rigid([0.01, -0.02, 0.03], [0.015, 0.001, -0.002])


def frame(index: int) -> Frame:
    return Frame(
        index=index,
        t_camera_ns=index * 33_000_000,
        t_host_ns=0,
        depth=np.full((48, 64), 100 * index, np.uint16),
        depth_scale_m=0.000125,
        depth_intrinsics=CAMERA,
        color=np.full((48, 64, 3), index, np.uint8),
        color_intrinsics=CAMERA,
        T_C_D=T_C_D,
    )


@pytest.fixture
def plugged_in(monkeypatch: pytest.MonkeyPatch) -> list[Device]:
    """Return the devices that the SDK lists; a test may change it."""
    devices = [D415]
    monkeypatch.setattr(realsense, "connected_devices", lambda: devices)
    return devices


@pytest.fixture
def play(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., None]:
    """Have the SDK play a recording for every device, refusing some widths."""
    rs = pytest.importorskip("pyrealsense2")
    path = tmp_path / "hand.db3"
    record_db3(path, map(frame, range(1, 61)))

    def play(refused_px: tuple[int, ...] = ()) -> None:
        class Config(rs.config):  # type: ignore[misc, name-defined]
            def enable_device(self, serial: str) -> None:
                assert serial == D415.serial
                self.enable_device_from_file(str(path), repeat_playback=False)

            def enable_stream(self, stream: Any, width: int, *_: Any) -> None:
                if width in refused_px:
                    stream = rs.stream.pose  # which the recording has not
                super().enable_stream(stream)

        monkeypatch.setattr(rs, "config", Config)

    return play


def test_frames_come_with_their_colour_and_geometry(
    plugged_in: list[Device], play: Callable[..., None]
) -> None:
    play()
    with RealSenseCamera() as camera:
        assert camera.name == "Intel RealSense D415 (64x48)"
        frames = iter(lambda: camera.read(5.0), None)
        got = next(frame for frame in frames if frame.color is not None)
        assert camera.depth_intrinsics == got.depth_intrinsics
    assert (got.depth == 100 * got.index).all()
    assert got.depth_scale_m == pytest.approx(0.000125)
    assert got.t_camera_ns == pytest.approx(got.index * 33_000_000, abs=1000)
    assert got.depth_intrinsics.fy == pytest.approx(CAMERA.fy)
    np.testing.assert_allclose(got.T_C_D, T_C_D, atol=1e-6)
    assert got.color is not None
    assert abs(int(got.color[0, 0, 0]) - got.index) <= 1
    with pytest.raises(CameraEndError, match="is closed"):
        camera.read()


def test_a_smaller_size_is_taken_where_the_larger_is_refused(
    plugged_in: list[Device], play: Callable[..., None]
) -> None:
    play(refused_px=(1280,))
    with RealSenseCamera("123") as camera:
        assert camera.read(5.0).depth.any()


def test_where_both_sizes_are_refused_usb_2_is_named(
    plugged_in: list[Device], play: Callable[..., None]
) -> None:
    play(refused_px=(1280, 848))
    with pytest.raises(CameraError, match=r"does not start: .+; close other programs"):
        RealSenseCamera()
    plugged_in[:] = [replace(D415, usb="2.1")]
    with pytest.raises(CameraError, match=r"on USB 2\.1: use a USB 3 port"):
        RealSenseCamera()


def test_an_absent_device_is_named(plugged_in: list[Device]) -> None:
    pytest.importorskip("pyrealsense2")
    with pytest.raises(CameraError, match=r"serial 999 is not connected; .*D415 123"):
        RealSenseCamera("999")
    plugged_in.clear()
    with pytest.raises(CameraError, match="plug one into a USB 3 port"):
        RealSenseCamera()


def test_silence_is_a_timeout_unless_the_device_is_gone(
    plugged_in: list[Device], play: Callable[..., None]
) -> None:
    play()
    with RealSenseCamera() as camera:
        frames = iter(lambda: camera.read(0.3), None)
        with pytest.raises(CameraTimeoutError, match=r"no frame for 0\.3 s"):
            deque(frames)  # to the recording's end
        plugged_in.clear()
        with pytest.raises(CameraError, match="was unplugged"):
            camera.read(0.1)
