"""Image sources for calibration boards, opened by name."""

from __future__ import annotations

from handcal.camera.color import ColorCamera, Tell
from handcal.camera.folder import DESCRIPTION
from handcal.camera.live import is_live, open_live
from handcal.camera.playback import PlaybackSettings
from handcal.camera.realsense import RealSenseCamera
from handcal.camera.recordings import RECORDING_SUFFIXES, open_recording
from handcal.camera.ros import ros_recording
from handcal.camera.settings import RealSenseSettings
from handcal.camera.viewpoint import ViewpointCamera, open_viewpoint
from handcal.io.files import user_path

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
