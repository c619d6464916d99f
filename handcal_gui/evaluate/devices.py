"""The paired headset and the depth camera of dialogs that draw in the room."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

from handcal.camera.camera import Camera
from handcal.camera.realsense import RealSenseCamera
from handcal.core.errors import HandcalError
from handcal.link.pairing import Pairings, pairing_file
from handcal.link.server import HeadsetServer
from handcal_gui.app.translation import tr

_PATIENCE_S = 120.0


def pairing_problem() -> str:
    """Return why no headset can connect; empty if one is paired."""
    try:
        is_paired = bool(Pairings.read(pairing_file()).all)
    except HandcalError as error:
        return str(error)
    how = tr("no headset is paired; pair one with Connect a headset in the File menu")
    return "" if is_paired else how


@contextmanager
def paired_headset() -> Iterator[HeadsetServer]:
    """Yield the link once a paired headset has connected; HandcalError if none is paired."""
    if problem := pairing_problem():
        raise HandcalError(problem)
    pairings = Pairings.read(pairing_file())
    with HeadsetServer(pairings, ("0.0.0.0", 47800)) as server:  # noqa: S104
        server.wait_connected(_PATIENCE_S)
        yield server


def depth_camera() -> AbstractContextManager[Camera]:
    """Open the RealSense."""
    return RealSenseCamera()
