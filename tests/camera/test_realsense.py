"""Devices as the SDK lists them, by a stand-in for the SDK: no camera is attached."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import pytest

from handcal.camera import realsense
from handcal.camera.realsense import Device, connected_devices, librealsense
from handcal.errors import CameraError

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
