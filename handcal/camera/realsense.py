"""Intel RealSense devices: the SDK itself, what is plugged in, and frames from it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from handcal.camera.sdk_frames import (
    apart_ms,
    extrinsics_between,
    frame_of,
    intrinsics_of,
    with_color,
)
from handcal.closable import Closable
from handcal.errors import CameraEndError, CameraError, CameraTimeoutError
from handcal.types import Frame

_SIZES_PX = ((1280, 720), (848, 480))
_RATE_HZ = 30


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

    @property
    def is_slow(self) -> bool:
        """Whether it is connected by USB 2, too slow for 1280x720 at 30 Hz."""
        return self.usb.startswith("2")


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


class RealSenseCamera(Closable):
    """Live depth with colour, both 1280x720 at 30 Hz or else 848x480; implements `Camera`.

    Depth is given as measured, not aligned to colour. Written after the SDK's documentation and
    tested on played recordings: it has not been run on a device.

    Parameters
    ----------
    serial : str
        Of the device; empty takes the first.

    Raises
    ------
    CameraError
        If the SDK or the device is missing, in use, or refuses both sizes.
    """

    def __init__(self, serial: str = "") -> None:
        rs = librealsense()
        self._device = choose_device(connected_devices(), serial)
        self._pipeline = rs.pipeline()
        profile = _start(rs, self._pipeline, self._device)
        depth, color = profile.get_stream(rs.stream.depth), profile.get_stream(rs.stream.color)
        self.depth_intrinsics = intrinsics_of(depth)
        self._T_C_D = extrinsics_between(depth, color)
        self._is_open = True
        size = f"{self.depth_intrinsics.width}x{self.depth_intrinsics.height}"
        slow = f", only USB {self._device.usb}" if self._device.is_slow else ""
        self.name = f"{self._device.name} ({size}{slow})"

    def read(self, timeout_s: float = 1.0) -> Frame:
        """Return the next frame with depth; see `Camera.read`."""
        if not self._is_open:
            raise CameraEndError(f"{self.name} is closed")
        depth, color = self._wait(timeout_s)
        frame = frame_of(depth, self.depth_intrinsics)
        if not color or apart_ms(color, depth) > 1e3 / _RATE_HZ:
            return frame
        return with_color(frame, color, self._T_C_D)

    def close(self) -> None:
        """Stop the device; safe to call twice."""
        if self._is_open:
            self._is_open = False
            with suppress(RuntimeError):  # it may have been unplugged
                self._pipeline.stop()

    def _wait(self, timeout_s: float) -> tuple[Any, Any]:
        """Return the next depth frame, and the colour frame that the SDK paired with it, if any."""
        deadline_s = time.monotonic() + timeout_s
        while (left_s := deadline_s - time.monotonic()) > 0:
            try:
                arrived, frames = self._pipeline.try_wait_for_frames(max(1, round(1e3 * left_s)))
            except RuntimeError as error:
                raise CameraError(f"{self.name} failed: {error}; plug it in again") from error
            if arrived and (depth := frames.get_depth_frame()):
                return depth, frames.get_color_frame()
        if self._device.serial not in [device.serial for device in connected_devices()]:
            raise CameraError(f"{self.name} was unplugged; plug it in again")
        raise CameraTimeoutError(f"{self.name}: no frame for {timeout_s:g} s")


def choose_device(devices: Sequence[Device], serial: str = "") -> Device:
    """Return the device with a serial number, or the first.

    Raises
    ------
    CameraError
        If it is not among them.
    """
    if not devices:
        raise CameraError("no RealSense camera is connected; plug one into a USB 3 port")
    for device in devices:
        if serial in ("", device.serial):
            return device
    there = ", ".join(f"{device.name} {device.serial}" for device in devices)
    raise CameraError(f"the RealSense with serial {serial} is not connected; there is {there}")


def _start(rs: Any, pipeline: Any, device: Device) -> Any:
    """Start the largest size that the device grants, and return the profile of its streams."""
    problem = ""
    for width, height in _SIZES_PX:
        config = rs.config()
        config.enable_device(device.serial)
        config.enable_stream(rs.stream.depth, width, height, rs.format.z16, _RATE_HZ)
        config.enable_stream(rs.stream.color, width, height, rs.format.rgb8, _RATE_HZ)
        try:
            _put_streams_on_one_clock(rs, config.resolve(rs.pipeline_wrapper(pipeline)))
            return pipeline.start(config)
        except RuntimeError as error:
            problem = str(error)
    advice = (
        f"it is on USB {device.usb}: use a USB 3 port and cable"
        if device.is_slow
        else "close other programs that use it, or plug it in again"
    )
    raise CameraError(f"{device.name} does not start: {problem}; {advice}")


def _put_streams_on_one_clock(rs: Any, profile: Any) -> None:
    """Have the SDK map the times of all sensors to the host's clock, where it can."""
    for sensor in profile.get_device().query_sensors():
        if sensor.supports(rs.option.global_time_enabled):
            sensor.set_option(rs.option.global_time_enabled, 1.0)
