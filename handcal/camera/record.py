"""Record any camera until a limit is reached or the recording is stopped."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from handcal.camera.camera import Camera
from handcal.camera.recordings import record_frames
from handcal.core.errors import CameraEndError, CameraError, CameraTimeoutError
from handcal.core.progress import Progress
from handcal.core.types import Frame
from handcal.io.files import make_folder

_POLL_S = 0.2
_SILENT_S = 5.0  # a camera that sends no frame for this time has ended
_FREE_BYTES = 2**30  # disk space to leave free
_LEAD_FRAMES = 30
"""Most frames skipped at the beginning, until one has colour: cameras pair their first images
badly."""


@dataclass(frozen=True, slots=True)
class RecordSettings:
    """Limits of a recording."""

    duration_s: float = 60.0
    """In camera time; a raw pair of 1280x720 images takes 4.6 MB, 8 GB per minute."""
    frames: int = 100_000
    gate_m: tuple[float, float] | None = None
    """Depth gate to keep in the recording, for `replay`."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """Summary of a recording."""

    frames: int
    dropped: int
    """Missing frames, by the camera's frame numbers."""
    duration_s: float
    """From the first to the last frame, in camera time."""
    stop_reason: str


def record(
    camera: Camera,
    path: Path,
    settings: RecordSettings,
    progress: Progress = Progress(),
) -> Recorded:
    """Record a camera until it ends or fails, a limit is reached, or it is stopped.

    The frames recorded so far are kept in all cases.

    Parameters
    ----------
    camera : Camera
        Stays open.
    path : Path
        A ``.db3`` file, which replaces an existing one when complete, or a new folder.
    settings : RecordSettings
    progress : Progress
        Reported to for every frame; cancelling it ends the recording and keeps it.

    Raises
    ------
    CameraError
        If the camera sends no frame, or librealsense cannot write the file.
    FileError
        If the folder is not empty or cannot be written.
    ValueError
        If `path` has a suffix other than ``.db3``, or the camera changes.
    """
    take = _Take(camera, make_folder(path.absolute().parent), settings, progress)
    first = next(take.frames, None)
    if first is None:
        raise CameraError(f"nothing was recorded: {take.stop_reason}")
    count = record_frames(path, chain([first], take.frames), camera.identity, settings.gate_m)
    return Recorded(count, take.dropped, take.duration_s, take.stop_reason)


class _Take:
    """The frames of one recording, with counts and the reason for its end."""

    def __init__(
        self, camera: Camera, disk: Path, settings: RecordSettings, progress: Progress
    ) -> None:
        self.stop_reason = ""
        self.dropped = 0
        self.duration_s = 0.0
        self.frames = self._until_limit(self._from_first_color(self._live(camera)))
        self._disk = disk
        self._settings = settings
        self._progress = progress

    def _live(self, camera: Camera) -> Iterator[Frame]:
        """Yield frames until the camera ends or the recording is stopped."""
        heard_s = time.monotonic()
        while not self._progress.is_cancelled():
            try:
                frame = camera.read(_POLL_S)
            except CameraTimeoutError as error:
                if time.monotonic() - heard_s > _SILENT_S:
                    self.stop_reason = str(error)
                    return
            except CameraEndError:
                self.stop_reason = "the recording played has ended"
                return
            except CameraError as error:
                self.stop_reason = str(error)
                return
            else:
                yield frame
                # After it was stored: a slow disk is no silent camera.
                heard_s = time.monotonic()
        self.stop_reason = "stopped"

    def _from_first_color(self, frames: Iterator[Frame]) -> Iterator[Frame]:
        """Begin with the first frame that has colour, or the first of all if none has."""
        lead: list[Frame] = []
        for frame in frames:
            lead = [frame] if frame.color is not None else [*lead, frame]
            if frame.color is not None or len(lead) > _LEAD_FRAMES:
                break
        yield from lead
        yield from frames

    def _until_limit(self, frames: Iterator[Frame]) -> Iterator[Frame]:
        settings = self._settings
        first = last = None
        for count, frame in enumerate(frames, start=1):
            first, previous, last = first or frame, last or frame, frame
            self.dropped += max(0, frame.index - previous.index - 1)
            self.duration_s = (frame.t_camera_ns - first.t_camera_ns) * 1e-9
            share = max(self.duration_s / settings.duration_s, count / settings.frames)
            self._progress.show(min(1.0, share), "recording")
            yield frame
            if share >= 1.0:
                self.stop_reason = "as long as asked for"
            elif shutil.disk_usage(self._disk).free < _FREE_BYTES:
                self.stop_reason = "the disk is nearly full"
            else:
                continue
            return
