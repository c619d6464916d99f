"""RealSense devices on the USB that librealsense does not list, with the reason."""

from __future__ import annotations

from pathlib import Path

_LISTED_BY_LINUX = Path("/sys/bus/usb/devices")
_INTEL = "8086"
# Product numbers of the L500 family, as in librealsense's udev rules up to 2.54.
_L500 = ("0b0d", "0b3d", "0b64", "0b68")


def explain_absence(devices: Path = _LISTED_BY_LINUX) -> str:
    """Return one line: the reason why librealsense lists no camera, and what to do.

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
        return (
            "a RealSense L515 is connected, which librealsense supports only up to version 2.54; "
            "use a camera of the D400 family"
        )
    if product_ids:
        return (
            "a RealSense camera is connected, but librealsense may not open it; install Intel's "
            "udev rules (99-realsense-libusb.rules) and plug it in again"
        )
    return "no RealSense camera is connected; plug one into a USB 3 port"


def _read(device: Path, attribute: str) -> str:
    try:
        return (device / attribute).read_text(errors="replace").strip()
    except OSError:
        return ""
