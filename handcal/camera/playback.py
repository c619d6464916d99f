"""Common part of all recordings: pace, seeking and looping, and frames of one camera only."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from handcal.core.errors import CameraEndError, CameraError, CameraTimeoutError
from handcal.core.types import CameraIdentity, Frame, Intrinsics
from handcal.io.closable import Closable

_LATE_S = 0.05


@dataclass(frozen=True, slots=True)
class PlaybackSettings:
    """Settings of playback."""

    real_time: bool = False
    """Play at the recorded pace and drop frames that are read too late; otherwise deliver every
    frame as fast as it is read."""
    loop: bool = False
    """Restart at the end; index and time of the frames then jump back."""


class PlayedCamera(Closable):
    """Base class of cameras that play a recording; implements `Camera.read`.

    A subclass reads successive frames and seeks to a time.
    """

    name: str
    identity: CameraIdentity
    depth_intrinsics: Intrinsics

    notes: tuple[str, ...] = ()
    """Lines about the recording: topics that are not played, with the reason, and what it lacks."""
    gate_m: tuple[float, float] | None = None
    """The depth gate that the recording was made for, if it says so."""

    def __init__(self, settings: PlaybackSettings | None) -> None:
        self._settings = settings or PlaybackSettings()
        self._waiting: Frame | None = None
        self._begin_ns: int | None = None
        self._host_less_camera_ns: int | None = None
        self._is_open = True

    def read(self, timeout_s: float = 1.0) -> Frame:
        """Return the next frame; see `Camera.read`."""
        if not self._is_open:
            raise CameraError(f"{self.name} is closed", "open it again")
        deadline_s = time.monotonic() + timeout_s
        frame = self._take(timeout_s)
        if self._settings.real_time:
            while self._early_s(frame) < -_LATE_S and time.monotonic() < deadline_s:
                frame = self._take(timeout_s)
            early_s, left_s = self._early_s(frame), max(0.0, deadline_s - time.monotonic())
            if early_s > left_s:
                self._waiting = frame
                time.sleep(left_s)
                raise CameraTimeoutError(f"{self.name}: the next frame is not due yet")
            time.sleep(max(0.0, early_s))
        return replace(frame, t_host_ns=time.monotonic_ns())

    def seek(self, position_s: float) -> None:
        """Seek to the first frame at or after a time since the recording's first frame.

        Beyond the end there is no next frame.
        """
        if not self._is_open:
            raise CameraError(f"{self.name} is closed", "open it again")
        if self._begin_ns is None:
            self._take(1.0)
        assert self._begin_ns is not None
        self._waiting = None
        self._host_less_camera_ns = None
        self._go_to(self._begin_ns + round(1e9 * position_s))

    def close(self) -> None:
        """Stop playing; safe to call twice."""
        self._is_open = False

    @abstractmethod
    def _next(self, timeout_s: float) -> Frame:
        """Return the next frame of the recording, or raise CameraEndError after the last."""

    @abstractmethod
    def _go_to(self, t_camera_ns: int) -> None:
        """Seek to the first frame at or after a time."""

    def _take(self, timeout_s: float) -> Frame:
        """Return the waiting frame or the next, which may be the first again."""
        frame, self._waiting = self._waiting, None
        try:
            frame = frame or self._next(timeout_s)
        except CameraEndError:
            if not self._settings.loop or self._begin_ns is None:
                raise
            self._host_less_camera_ns = None
            self._go_to(self._begin_ns)
            frame = self._next(timeout_s)
        if self._begin_ns is None:
            self._begin_ns = frame.t_camera_ns
        return frame

    def _early_s(self, frame: Frame) -> float:
        """Return the time until a frame is due, counted from the first one read at this pace."""
        now_ns = time.monotonic_ns()
        if self._host_less_camera_ns is None:
            self._host_less_camera_ns = now_ns - frame.t_camera_ns
        return (frame.t_camera_ns + self._host_less_camera_ns - now_ns) * 1e-9


def of_one_camera(frames: Iterable[Frame]) -> tuple[Frame, Iterator[Frame]]:
    """Return the first frame, and an iterator over all frames that checks each.

    Later frames may lack colour or the pose.

    Raises
    ------
    ValueError
        If there is no frame; from the iterator, if a frame is from another camera.
    """
    remaining = iter(frames)
    first = next(remaining, None)
    if first is None:
        raise ValueError("there is no frame to record")
    return first, chain([first], (_checked(frame, first) for frame in remaining))


def _checked(frame: Frame, first: Frame) -> Frame:
    has_same_depth = (
        frame.depth_intrinsics == first.depth_intrinsics
        and frame.depth_scale_m == first.depth_scale_m
    )
    has_same_color = frame.color is None or (
        frame.color_intrinsics == first.color_intrinsics
        and np.array_equal(frame.T_C_D, first.T_C_D)
    )
    gains_pose = frame.T_W_D is not None and first.T_W_D is None
    if not has_same_depth or not has_same_color or gains_pose:
        raise ValueError(f"frame {frame.index} is not from the camera of the first frame")
    return frame
