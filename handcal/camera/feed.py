"""Frames from a camera that may be unplugged and plugged in again."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from handcal.camera.camera import Camera, ExposesForHand
from handcal.core.errors import CameraEndError, CameraError, CameraTimeoutError
from handcal.core.types import CameraIdentity, Float32, Frame
from handcal.io.closable import Closable

_RATE_WINDOW_S = 1.0
_READ_S = 0.2
"""Longest duration of `CameraFeed.read`."""
_SILENT_S = 1.0
"""Time without a frame after which a problem is reported."""
_REOPEN_S = 1.0
"""Time between attempts to open a camera that failed."""


@dataclass(frozen=True, slots=True)
class CameraStatus:
    """The state of a camera feed."""

    name: str
    problem: str = ""
    """Reason for missing frames, and what to do; empty while frames arrive."""
    rate_hz: float = 0.0
    """Number of frames in the last second."""
    dropped: int = 0
    """Frames missing from the camera's own count since it was opened."""
    identity: CameraIdentity = CameraIdentity()
    """The camera opened last; empty before, and if it is not known."""


class CameraFeed(Closable):
    """Reads a camera and reopens it when it fails, until a recording ends.

    Parameters
    ----------
    open_camera : callable
        Returns an open camera; raises CameraError if there is none.
    """

    def __init__(self, open_camera: Callable[[], Camera]) -> None:
        self._open_camera = open_camera
        self._camera: Camera | None = None
        self._name = "Camera"
        self._identity = CameraIdentity()
        self._error: CameraError | None = None
        self._dropped = 0
        self._last_index: int | None = None
        self._arrived_s: deque[float] = deque()
        self._heard_s = time.monotonic()
        self._next_open_s = 0.0

    @property
    def status(self) -> CameraStatus:
        """The present state of the feed."""
        oldest_s = time.monotonic() - _RATE_WINDOW_S
        while self._arrived_s and self._arrived_s[0] < oldest_s:
            self._arrived_s.popleft()
        rate_hz = len(self._arrived_s) / _RATE_WINDOW_S
        problem = str(self._error or "")
        return CameraStatus(self._name, problem, rate_hz, self._dropped, self._identity)

    def read(self) -> Frame | None:
        """Return the next frame, or None if none arrives in time; `status` says why."""
        try:
            if self._camera is None:
                self._open()
            assert self._camera is not None
            frame = self._camera.read(_READ_S)
        except CameraTimeoutError as error:
            if time.monotonic() - self._heard_s > _SILENT_S:
                self._error = error
            return None
        except CameraEndError as error:
            is_empty = self._last_index is None
            self._error = CameraEndError(f"{error.what} without a frame") if is_empty else error
            self._next_open_s = math.inf
            self.close()
            return None
        except CameraError as error:
            self.close()
            self._error = error
            return None
        self._note(frame)
        return frame

    def expose_for(self, points_m: Float32 | None) -> None:
        """Tell a camera that can measure its exposure on the hand; see `ExposesForHand`."""
        if isinstance(self._camera, ExposesForHand):
            self._camera.expose_for(points_m)

    def close(self) -> None:
        """Close the camera; `read` opens it again, unless a recording has ended."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None
        self._last_index = None

    def _open(self) -> None:
        now_s = time.monotonic()
        if now_s < self._next_open_s:
            time.sleep(min(_READ_S, self._next_open_s - now_s))
            # Nothing was tried, so the reason is that of the last attempt.
            assert self._error is not None
            raise CameraError(*self._error.args)
        self._next_open_s = now_s + _REOPEN_S
        self._camera = self._open_camera()
        self._name, self._identity = self._camera.name, self._camera.identity
        self._heard_s = time.monotonic()

    def _note(self, frame: Frame) -> None:
        self._error = None
        self._heard_s = time.monotonic()
        self._arrived_s.append(self._heard_s)
        if self._last_index is not None:
            self._dropped += max(0, frame.index - self._last_index - 1)
        self._last_index = frame.index
