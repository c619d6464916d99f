"""The viewpoint camera, placed at the wearer's eye position for the offline calibration."""

from __future__ import annotations

import sys
import time
from abc import abstractmethod
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np

from handcal.camera.playback import PlaybackSettings
from handcal.core.errors import CameraEndError, CameraError, FileError
from handcal.core.types import UInt8
from handcal.io.closable import Closable
from handcal.io.images import IMAGE_KINDS, IMAGE_SUFFIXES, MAX_SIDE_PX, read_image

_BACKENDS = {"linux": cv2.CAP_V4L2, "win32": cv2.CAP_DSHOW, "darwin": cv2.CAP_AVFOUNDATION}
_MOST_CAMERAS = 10
_IMAGE_S, _PERIOD_S = 1.0, 1.0 / 30.0


class ViewpointCamera(Closable):
    """A sequence of colour images; opened by `open_viewpoint`.

    Attributes
    ----------
    name : str
    """

    name: str

    @abstractmethod
    def read(self) -> tuple[UInt8, int]:
        """Return the next image and its time.

        Returns
        -------
        image : (H, W, 3) uint8
            RGB.
        t_ns : int
            The host's monotonic time for a camera and for images from a folder, both when read;
            for a video the time from its beginning.

        Raises
        ------
        CameraEndError
            After the last image of a folder or video.
        CameraError
            If the camera was closed or unplugged, or an image cannot be read.
        """


def open_viewpoint(
    source: int | Path,
    size_px: tuple[int, int] | None = None,
    playback: PlaybackSettings | None = None,
) -> ViewpointCamera:
    """Return the viewpoint camera that `source` names.

    Parameters
    ----------
    source : int or Path
        A camera's number in the operating system (V4L2, DirectShow, AVFoundation), a folder of
        images, in order of their names, or a video file.
    size_px : (int, int), optional
        Width and height requested from a camera, which may deliver others.
    playback : PlaybackSettings, optional
        Playback of a folder or video; in real time, each image of a folder is shown for a second.

    Raises
    ------
    CameraError
        If the source does not exist or is in use.
    """
    if isinstance(source, int):
        return _Device(source, size_px)
    kind = _Images if source.is_dir() else _Video
    return kind(source, playback or PlaybackSettings())


def list_viewpoints() -> list[int]:
    """Return the numbers of the cameras that can be opened; each is opened briefly."""
    found = []
    for number in range(_MOST_CAMERAS):
        with suppress(CameraError), open_viewpoint(number):
            found.append(number)
    return found


class _Images(ViewpointCamera):
    def __init__(self, folder: Path, playback: PlaybackSettings) -> None:
        self.name = f"Images in {folder.name}"
        try:
            paths = [path for path in folder.iterdir() if path.suffix.lower() in IMAGE_SUFFIXES]
        except OSError as error:
            raise CameraError(f"cannot read {folder}: {error.strerror or error}") from error
        if not paths:
            raise CameraError(f"{folder} holds no {IMAGE_KINDS} image")
        self._paths = sorted(paths, reverse=True)
        self._remaining: list[Path] | None = [*self._paths]
        self._playback = playback
        self._shown, self._until_s = np.empty((0, 0, 3), np.uint8), 0.0

    def read(self) -> tuple[UInt8, int]:
        if self._remaining is None:
            raise CameraError(f"{self.name}: this camera is closed", "open it again")
        if time.monotonic() < self._until_s:  # again, in the pace of a camera
            time.sleep(_PERIOD_S)
            return self._shown, time.monotonic_ns()
        if not self._remaining and self._playback.loop:
            self._remaining = [*self._paths]
        if not self._remaining:
            raise CameraEndError(f"{self.name}: that was the last image")
        path = self._remaining.pop()
        try:
            image = read_image(path, cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION)
        except FileError as error:
            raise CameraError(*error.args) from error
        if self._playback.real_time:
            self._shown, self._until_s = image, time.monotonic() + _IMAGE_S
        return image, time.monotonic_ns()

    def close(self) -> None:
        self._remaining = None


class _Capture(ViewpointCamera):
    """An image source that OpenCV captures."""

    def __init__(self, name: str, capture: cv2.VideoCapture) -> None:
        self.name = name
        self._capture = capture

    def close(self) -> None:
        self._capture.release()

    def _read(self) -> UInt8 | None:
        if not self._capture.isOpened():
            raise CameraError(f"{self.name}: this camera is closed", "open it again")
        is_read, image = self._capture.read()
        return np.ascontiguousarray(image[..., ::-1], np.uint8) if is_read else None


class _Device(_Capture):
    def __init__(self, number: int, size_px: tuple[int, int] | None) -> None:
        if not _is_listed(number):
            raise CameraError(
                f"there is no camera {number}",
                "plug it in or choose another number",
            )
        capture = cv2.VideoCapture(number, _BACKENDS.get(sys.platform, cv2.CAP_ANY))
        super().__init__(f"Camera {number}", capture)
        if not capture.isOpened():
            raise CameraError(
                f"camera {number} cannot be opened",
                "close other programs that use it",
            )
        if size_px is not None:
            capture.set(cv2.CAP_PROP_FRAME_WIDTH, size_px[0])
            capture.set(cv2.CAP_PROP_FRAME_HEIGHT, size_px[1])
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)  # the newest image, not a queued one

    def read(self) -> tuple[UInt8, int]:
        image = self._read()
        if image is None:
            raise CameraError(f"{self.name} delivers no image", "plug it in again")
        return image, time.monotonic_ns()


class _Video(_Capture):
    def __init__(self, path: Path, playback: PlaybackSettings) -> None:
        if not path.is_file():
            raise CameraError(f"there is no video {path}")
        capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
        super().__init__(f"Video {path.name}", capture)
        if not capture.isOpened():
            raise CameraError(f"{path} is not a video that OpenCV can play")
        sides = (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
        if max(capture.get(side) for side in sides) > MAX_SIDE_PX:
            self.close()
            raise CameraError(f"{path} has images larger than {MAX_SIDE_PX} px")
        self._playback = playback
        self._begin_ns = time.monotonic_ns()

    def read(self) -> tuple[UInt8, int]:
        image = self._read()
        if image is None and self._playback.loop:
            self._capture.set(cv2.CAP_PROP_POS_FRAMES, 0)
            self._begin_ns = time.monotonic_ns()
            image = self._read()
        if image is None:
            raise CameraEndError(f"{self.name}: that was the last image")
        t_ns = round(1e6 * self._capture.get(cv2.CAP_PROP_POS_MSEC))
        if self._playback.real_time:
            time.sleep(max(0.0, 1e-9 * (self._begin_ns + t_ns - time.monotonic_ns())))
        return image, t_ns


def _is_listed(number: int) -> bool:
    """Return whether Linux lists a camera; OpenCV prints warnings when asked for an absent one."""
    return sys.platform != "linux" or Path(f"/dev/video{number}").exists()
