"""Intel RealSense devices: the SDK itself, and what is plugged in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from handcal.errors import CameraError


@dataclass(frozen=True, slots=True)
class Device:
    """A RealSense device as the SDK lists it.

    Attributes
    ----------
    name, serial, firmware : str
    usb : str
        As in "3.2"; empty if not told.
    """

    name: str
    serial: str
    firmware: str
    usb: str


def librealsense() -> Any:
    """Return the module pyrealsense2.

    Raises
    ------
    CameraError
        If it is not installed.
    """
    try:
        import pyrealsense2  # imported late: absent on macOS
    except ImportError as error:
        raise CameraError(
            "RealSense cameras and recordings need librealsense: pip install pyrealsense2 "
            "(no package exists for macOS)"
        ) from error
    return pyrealsense2


def connected_devices() -> list[Device]:
    """Return the devices plugged in, without opening any.

    Raises
    ------
    CameraError
        If the SDK is missing or cannot look.
    """
    rs = librealsense()
    try:
        return [
            Device(
                *(
                    device.get_info(info) if device.supports(info) else ""
                    for info in (
                        rs.camera_info.name,
                        rs.camera_info.serial_number,
                        rs.camera_info.firmware_version,
                        rs.camera_info.usb_type_descriptor,
                    )
                )
            )
            for device in rs.context().query_devices()
        ]
    except RuntimeError as error:
        raise CameraError(f"the RealSense SDK cannot list devices: {error}") from error
