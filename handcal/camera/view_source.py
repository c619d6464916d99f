"""Whatever can show a calibration board, opened by what a person calls it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from handcal.camera.color import ColorCamera
from handcal.camera.folder import DESCRIPTION
from handcal.camera.playback import PlaybackSettings
from handcal.camera.realsense import RealSenseCamera
from handcal.camera.recordings import RECORDING_SUFFIXES, open_recording
from handcal.camera.settings import RealSenseSettings
from handcal.camera.viewpoint import ViewpointCamera, open_viewpoint
from handcal.types import Frame

REALSENSE = "realsense"


def open_view_source(
    source: str,
    realsense: RealSenseSettings | None = None,
    playback: PlaybackSettings | None = None,
    tell: Callable[[Frame], object] = lambda _frame: None,
) -> ViewpointCamera:
    """Open what shows a board.

    Parameters
    ----------
    source : str
        ``realsense``, whose colour is taken; the number of a camera of this computer; or the path
        of a recording, a video or a folder of images.
    realsense : RealSenseSettings, optional
    playback : PlaybackSettings, optional
        How a recording or video is played.
    tell : callable
        Given the first frame of what has depth, too: it says where the depth imager is.

    Raises
    ------
    CameraError
        If there is nothing of the kind, or it cannot be opened.
    """
    if source == REALSENSE:
        return ColorCamera(RealSenseCamera(realsense), tell)
    if source.isdecimal():
        return open_viewpoint(int(source))
    path = Path(source).expanduser()
    if path.suffix.lower() in RECORDING_SUFFIXES or (path / DESCRIPTION).is_file():
        return ColorCamera(open_recording(path, playback), tell)
    return open_viewpoint(path, playback=playback)
