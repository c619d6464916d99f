"""Descriptions of devices, read from a software device; no camera is attached."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from handcal.camera import sdk_devices
from handcal.camera.sdk_devices import (
    Device,
    choose_device,
    connected_devices,
    devices_by_child,
    explain_absence,
    librealsense,
)
from handcal.core.errors import CameraError, CancelledError
from handcal.core.progress import Progress
from handcal.core.types import CameraIdentity

D415 = Device("Intel RealSense D415", "123", "5.16.0.1", "3.2", temperature_c=41.0)


def test_devices_are_described_by_what_they_tell(plug_in: Callable[..., Any]) -> None:
    assert connected_devices() == []
    plug_in()
    plug_in(about={"serial_number": "4", "recommended_firmware_version": "5.17.0.10"})
    assert connected_devices() == [
        D415,
        replace(D415, serial="4", recommended_firmware="5.17.0.10"),
    ]


def test_an_identity_is_of_printable_lines() -> None:
    assert D415.identity == CameraIdentity("Intel RealSense D415", "123", "5.16.0.1")
    odd = replace(D415, name="D415\x00\n\t", serial="9" * 1000, firmware="")
    assert odd.identity == CameraIdentity("D415", "9" * 100, "")


def test_a_failing_sdk_is_one_clear_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> list[Any]:
        raise RuntimeError("failed to set power state")

    monkeypatch.setattr(sdk_devices, "_query", fail)
    with pytest.raises(CameraError, match="cannot list devices: failed to set power state; plug"):
        connected_devices()


def test_a_missing_sdk_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyrealsense2", None)
    with pytest.raises(CameraError, match="pip install pyrealsense2"):
        librealsense()
    with pytest.raises(CameraError, match="pip install pyrealsense2"):
        connected_devices()


@pytest.mark.process
def test_another_process_lists_the_same_devices(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pyrealsense2")
    monkeypatch.setattr(sdk_devices, "_LONGEST_LISTING_S", 600.0)
    assert devices_by_child() == connected_devices()


@pytest.mark.process
@pytest.mark.parametrize(
    ("module", "reason"),
    [
        ("import os; os.abort()", r"librealsense crashed \(status [-1-9]\S*\); unplug"),
        ("import os; context = os.abort", r"librealsense crashed \(status [-1-9]\S*\); unplug"),
        ("raise OSError('no entry point')", r"\(status 1, OSError: no entry point\); unplug"),
        ("import time; time.sleep(600)", "lists no devices within 0.5 s; unplug"),
        ("raise ImportError", "pip install pyrealsense2"),
    ],
)
def test_an_sdk_that_crashes_or_hangs_is_one_clear_line(
    module: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pyrealsense2.py").write_text(f"print('loading'); {module}\n")
    path = [str(tmp_path), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, path)))
    limit_s = 0.5 if "sleep" in module else 600.0
    monkeypatch.setattr(sdk_devices, "_LONGEST_LISTING_S", limit_s)
    with pytest.raises(CameraError, match=reason):
        devices_by_child()


@pytest.mark.process
@pytest.mark.parametrize("error", [CancelledError("cancelled"), KeyboardInterrupt()])
def test_a_listing_that_hangs_ends_when_it_is_cancelled(
    error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pyrealsense2.py").write_text("import time; time.sleep(600)\n")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    children: list[subprocess.Popen[str]] = []

    def begin(*args: Any, **settings: Any) -> subprocess.Popen[str]:
        children.append(popen(*args, **settings))
        return children[0]

    def is_cancelled() -> bool:
        raise error

    popen = subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", begin)
    with pytest.raises(type(error)):
        devices_by_child(Progress(is_cancelled=is_cancelled))
    children[0].wait(20.0)


@pytest.mark.parametrize(
    ("firmware", "recommended", "is_old"),
    [
        ("5.9.15.1", "5.16.0.1", True),
        ("5.16.0.1", "5.16.0.1", False),
        ("5.17.0.10", "5.17.0.9", False),
        ("5.16.0.1", "", False),
        ("", "5.16.0.1", False),
        ("unknown", "5.16.0.1", False),
    ],
)
def test_old_firmware_is_known_by_its_number(firmware: str, recommended: str, is_old: bool) -> None:
    device = replace(D415, firmware=firmware, recommended_firmware=recommended)
    assert device.has_old_firmware is is_old


def test_the_first_device_or_the_one_asked_for_is_chosen() -> None:
    other = replace(D415, serial="999")
    assert choose_device([D415, other]) == D415
    assert choose_device([D415, other], "999") == other
    with pytest.raises(CameraError, match=r"serial 7 is not connected, only .*D415 123, "):
        choose_device([D415, other], "7")
    with pytest.raises(CameraError, match="RealSense"):
        choose_device([])


@pytest.mark.parametrize(
    ("vendor", "product_id", "product", "told"),
    [
        ("8086", "0b64", "Intel(R) RealSense(TM) 515", "a RealSense L515 is connected, which"),
        ("8086", "0b64", "", "a RealSense L515 is connected, which"),
        ("8086", "0ad3", "Intel(R) RealSense(TM) Depth Camera 415", "install Intel's udev rules"),
        ("8086", "0b3c", "Intel AX200 Bluetooth", "no RealSense camera is connected; plug"),
        ("046d", "0b64", "Webcam", "no RealSense camera is connected; plug"),
    ],
)
def test_the_reason_is_given(
    tmp_path: Path, vendor: str, product_id: str, product: str, told: str
) -> None:
    (tmp_path / "usb1").mkdir()  # without any description
    device = tmp_path / "2-1"
    device.mkdir()
    (device / "idVendor").write_text(f"{vendor}\n")
    (device / "idProduct").write_text(f"{product_id}\n")
    if product:
        (device / "product").write_text(f"{product}\n")
    assert told in str(explain_absence(tmp_path))
    assert "no RealSense camera is connected" in explain_absence(tmp_path / "absent").what
