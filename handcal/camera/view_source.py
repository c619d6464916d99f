"""Image sources for calibration boards, opened by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from handcal.camera.camera import Camera
from handcal.camera.folder import DESCRIPTION
from handcal.camera.live import is_live, open_live
from handcal.camera.playback import PlaybackSettings
from handcal.camera.realsense import RealSenseCamera
from handcal.camera.recordings import RECORDING_SUFFIXES, open_recording
from handcal.camera.ros import ros_recording
from handcal.camera.settings import RealSenseSettings
from handcal.camera.viewpoint import ViewpointCamera, open_viewpoint
from handcal.core.errors import CameraError
from handcal.core.types import CameraIdentity, Frame, UInt8
from handcal.io.files import user_path

Tell: TypeAlias = Callable[[Frame, CameraIdentity], object]
"""Called with the first frame with colour, and the identity of its camera."""

_MOST_WITHOUT = 30
"""Most consecutive frames without colour; cameras pair their first images badly."""


class ColorCamera(ViewpointCamera):
    """Reads the colour images of a depth camera; closing it closes the camera.

    Parameters
    ----------
    camera : Camera
        An open camera, on whose clock the images' times are.
    tell : callable
        Called with the first frame with colour, which gives the pose of the depth imager, and with
        the camera's identity.
    """

    def __init__(self, camera: Camera, tell: Tell = lambda _frame, _identity: None) -> None:
        self.name = camera.name
        self._camera = camera
        self._tell: Tell | None = tell

    def read(self) -> tuple[UInt8, int]:
        """Return the next colour image and its time; CameraTimeoutError if none arrives in time."""
        for _ in range(_MOST_WITHOUT):
            frame = self._camera.read()
            if frame.color is not None:
                if self._tell is not None:
                    self._tell(frame, self._camera.identity)
                    self._tell = None
                return frame.color, frame.t_camera_ns
        raise CameraError(f"{self.name} delivers no colour images, in which boards are found")

    def close(self) -> None:
        """Close the camera."""
        self._camera.close()


REALSENSE = "realsense"


def open_view_source(
    source: str,
    realsense: RealSenseSettings | None = None,
    playback: PlaybackSettings | None = None,
    tell: Tell = lambda _frame, _identity: None,
) -> ViewpointCamera:
    """Open an image source.

    Parameters
    ----------
    source : str
        ``realsense``, ``oak`` or ``orbbec`` for its colour images; ``hololens2:HOST`` for the grey
        ones of its depth camera; the number of a camera of this computer; or the path of a
        recording, a video or a folder of images.
    realsense : RealSenseSettings, optional
    playback : PlaybackSettings, optional
        Playback of a recording or video.
    tell : callable
        Called with the first frame of a source with depth, which gives the depth imager's pose, and
        with the camera's identity.

    Raises
    ------
    CameraError
        If the source does not exist or cannot be opened.
    """
    if source == REALSENSE:
        return ColorCamera(RealSenseCamera(realsense), tell)
    if is_live(source):
        return ColorCamera(open_live(source), tell)
    if source.isdecimal():
        return open_viewpoint(int(source))
    path = user_path(source)
    is_folder = (path / DESCRIPTION).is_file() or ros_recording(path) is not None
    if is_folder or path.suffix.lower() in RECORDING_SUFFIXES:
        return ColorCamera(open_recording(path, playback), tell)
    return open_viewpoint(path, playback=playback)
