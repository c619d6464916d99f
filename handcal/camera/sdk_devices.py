"""The RealSense SDK, the devices that it lists, and why it lists none.

``python -m handcal.camera.sdk_devices`` lists them as JSON, in a process that the SDK may crash.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from handcal.core.errors import CameraError
from handcal.core.progress import Progress
from handcal.core.types import CameraIdentity

_LISTED_BY_LINUX = Path("/sys/bus/usb/devices")
_INTEL = "8086"
# Product numbers of the L500 family, as in librealsense's udev rules up to 2.54.
_L500 = ("0b0d", "0b3d", "0b64", "0b68")


def explain_absence(devices: Path = _LISTED_BY_LINUX) -> CameraError:
    """Return the reason why librealsense lists no camera, and what to do.

    Only Linux lists USB devices; elsewhere the camera is assumed to be unplugged.

    Parameters
    ----------
    devices : Path
        The folder in which Linux describes USB devices.
    """
    product_ids = [
        _read(device, "idProduct")
        for device in sorted(devices.glob("*"))
        if _read(device, "idVendor") == _INTEL
        and (_read(device, "idProduct") in _L500 or "realsense" in _read(device, "product").lower())
    ]
    if any(product_id in _L500 for product_id in product_ids):
        return CameraError(
            "a RealSense L515 is connected, which librealsense supports only up to version 2.54",
            "use a camera of the D400 family",
        )
    if product_ids:
        return CameraError(
            "a RealSense camera is connected, but librealsense may not open it",
            "install Intel's udev rules (99-realsense-libusb.rules) and plug it in again",
        )
    return CameraError("no RealSense camera is connected", "plug one into a USB 3 port")


def _read(device: Path, attribute: str) -> str:
    try:
        return (device / attribute).read_text(errors="replace").strip()
    except OSError:
        return ""


_MOST_CHARACTERS = 100
_LONGEST_LISTING_S, _POLL_S = 30.0, 0.1


@dataclass(frozen=True, slots=True)
class Device:
    """A RealSense device as listed by the SDK; unknown fields are empty."""

    name: str
    serial: str
    firmware: str
    usb: str
    """USB version, such as "3.2"."""
    recommended_firmware: str = ""
    """Firmware recommended by this version of the SDK."""
    temperature_c: float | None = None
    """Temperature of its processor; None if unknown."""

    @property
    def identity(self) -> CameraIdentity:
        """Model, serial number and firmware."""
        return CameraIdentity(*map(_line, (self.name, self.serial, self.firmware)))

    @property
    def is_slow(self) -> bool:
        """True if it is connected by USB 2, which is too slow for 1280x720 at 30 Hz."""
        return self.usb.startswith("2")

    @property
    def has_old_firmware(self) -> bool:
        """True if its firmware is older than the SDK recommends."""
        installed, recommended = map(_numbers, (self.firmware, self.recommended_firmware))
        return bool(installed) and installed < recommended


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


def sdk_devices() -> list[Any]:
    """Return the SDK's handles of the connected devices, without opening any.

    Raises
    ------
    CameraError
        If the SDK is missing or cannot list devices.
    """
    try:
        return _query()
    except RuntimeError as error:
        raise CameraError(
            f"the RealSense SDK cannot list devices: {error}",
            "plug the camera into a USB 3 port "
            "of the computer itself, as hubs may give too little power",
        ) from error


def _query() -> list[Any]:
    return list(librealsense().context().query_devices())


def connected_devices() -> list[Device]:
    """Return the connected devices, without opening any.

    Raises
    ------
    CameraError
        If the SDK is missing or cannot list devices.
    """
    return [describe_device(device) for device in sdk_devices()]


def devices_by_child(progress: Progress = Progress()) -> list[Device]:
    """Return the connected devices as listed by another process, which the SDK may crash.

    Raises
    ------
    CameraError
        If the SDK is missing, cannot list devices, crashes, or does not answer.
    CancelledError
        If it was cancelled.
    """
    advice = (
        "unplug the camera and plug it in again, and if it still fails, reinstall pyrealsense2 "
        "(the simulator, recordings and other cameras work without)"
    )
    command = [sys.executable, "-m", "handcal.camera.sdk_devices"]
    end_s = time.monotonic() + _LONGEST_LISTING_S
    with subprocess.Popen(  # noqa: S603
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        # On Windows a console would appear each time that the start page looks.
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
    ) as child:
        try:
            while True:
                try:
                    printed, complaint = child.communicate(timeout=_POLL_S)
                    break
                except subprocess.TimeoutExpired as error:
                    progress.check()
                    if time.monotonic() > end_s:
                        raise CameraError(
                            f"librealsense lists no devices within {_LONGEST_LISTING_S:g} s", advice
                        ) from error
        finally:
            child.kill()  # if it has not ended; a hung SDK outlives Ctrl+C
    answer = printed.rpartition("\n")[2]  # a library may print before
    try:
        listed = json.loads(answer)
    except ValueError as error:
        last = complaint.strip().rpartition("\n")[2][:_MOST_CHARACTERS]
        why = ", ".join(filter(None, (f"status {child.returncode}", last)))
        raise CameraError(f"librealsense crashed ({why})", advice) from error
    if "error" in listed:
        raise CameraError(*listed["error"])
    return [Device(**device) for device in listed["devices"]]


def describe_device(device: Any) -> Device:
    """Return the description of a device; empty texts for what it does not answer."""
    rs = librealsense()
    info = rs.camera_info

    def ask(what: Any) -> str:
        with suppress(RuntimeError):  # it may have just been unplugged
            return str(device.get_info(what)) if device.supports(what) else ""
        return ""

    return Device(
        ask(info.name),
        ask(info.serial_number),
        ask(info.firmware_version),
        ask(info.usb_type_descriptor),
        ask(info.recommended_firmware_version),
        _temperature_c(rs, device),
    )


def choose_device(devices: Sequence[Device], serial: str = "") -> Device:
    """Return the device with a serial number, or the first one.

    Raises
    ------
    CameraError
        If it is not connected.
    """
    if not devices:
        raise explain_absence()
    for device in devices:
        if serial in ("", device.serial):
            return device
    there = ", ".join(f"{device.name} {device.serial}" for device in devices)
    raise CameraError(f"the RealSense with serial {serial} is not connected, only {there}")


def _line(text: str) -> str:
    """Return what a device or a recording says as a printable line of limited length."""
    return "".join(filter(str.isprintable, text))[:_MOST_CHARACTERS]


def _numbers(version: str) -> tuple[int, ...]:
    """Return "5.16.0.1" as (5, 16, 0, 1); empty if it is not of that form."""
    parts = version.split(".")
    return tuple(map(int, parts)) if all(part.isdecimal() for part in parts) else ()


def _temperature_c(rs: Any, device: Any) -> float | None:
    with suppress(RuntimeError):  # some report it only while streaming
        for sensor in device.query_sensors():
            if sensor.supports(rs.option.asic_temperature):
                return float(sensor.get_option(rs.option.asic_temperature))
    return None


def _main() -> None:
    """Print the connected devices, or the reason why there is no list, as one line of JSON."""
    try:
        answer: object = {"devices": [asdict(device) for device in connected_devices()]}
    except CameraError as error:
        answer = {"error": error.args}
    sys.stdout.write(f"\n{json.dumps(answer)}")


if __name__ == "__main__":
    _main()
