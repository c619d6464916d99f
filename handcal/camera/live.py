"""Live cameras other than a RealSense, opened by name."""

from __future__ import annotations

from handcal.camera.camera import Camera
from handcal.camera.hololens2 import HoloLens2Camera, HoloLens2RealSense, hololens2_settings
from handcal.camera.oak import OakCamera
from handcal.camera.orbbec import OrbbecCamera
from handcal.camera.settings import HoloLens2Settings


def is_live(source: str) -> bool:
    """Return whether a name is that of a camera that `open_live` opens."""
    return hololens2_settings(source) is not None or source.partition(":")[0] in ("oak", "orbbec")


def open_live(source: str) -> Camera:
    """Open the camera of a name.

    Parameters
    ----------
    source : str
        ``oak``, ``orbbec``, or either with its serial number, as ``oak:18443010``; or
        ``hololens2:HOST`` (`hololens2_settings`).

    Raises
    ------
    CameraError
        If it is not connected, or its package is not installed.
    """
    if (hololens2 := hololens2_settings(source)) is not None:
        return open_hololens2(hololens2)
    kind, _, serial = source.partition(":")
    return OakCamera(serial) if kind == "oak" else OrbbecCamera(serial)


def open_hololens2(settings: HoloLens2Settings) -> Camera:
    """Open a depth camera of a HoloLens 2, or a RealSense on its USB port; raises `CameraError`."""
    own = settings.realsense_rig is None
    return HoloLens2Camera(settings) if own else HoloLens2RealSense(settings)
