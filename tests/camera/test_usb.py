"""Devices on the USB, listed from folders laid out like those of Linux."""

from __future__ import annotations

from pathlib import Path

import pytest

from handcal.camera.sdk_devices import explain_absence


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
    assert told in explain_absence(tmp_path)


def test_without_usb_information_no_camera_is_listed(tmp_path: Path) -> None:
    assert "no RealSense camera is connected" in explain_absence(tmp_path / "absent")
