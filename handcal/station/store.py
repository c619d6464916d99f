"""Storing of a calibration in its session; what cannot be written waits."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from handcal.session.facts import CameraUsed
from handcal.session.session import Session
from handcal.types import CameraIdentity, Frame


class Store:
    """Writes to a session, in order; data that could not be written are kept and written first.

    Parameters
    ----------
    session : Session or None
        None stores nothing.
    camera : CameraUsed or None
        The camera recorded last.
    """

    def __init__(self, session: Session | None, camera: CameraUsed | None) -> None:
        self._session = session
        self._camera = camera
        self._unstored: deque[Callable[[Session], object]] = deque()

    def write(self, write: Callable[[Session], object]) -> None:
        """Write after data that could not be written before; FileError if it cannot be."""
        if self._session is not None:
            self._unstored.append(write)
            self.write_waiting()

    def write_later(self, write: Callable[[Session], object]) -> None:
        """Write before the next data, or by `write_waiting`."""
        if self._session is not None:
            self._unstored.append(write)

    def write_waiting(self) -> None:
        """Write data that could not be written before; FileError if they still cannot be."""
        while self._session is not None and self._unstored:
            self._unstored[0](self._session)
            self._unstored.popleft()

    def event(self, name: str, **data: Any) -> None:
        """Append an event to the journal; FileError if it cannot be written."""
        self.write(lambda session: session.record(name, **data))

    def camera(self, identity: CameraIdentity, frame: Frame) -> None:
        """Record the camera of a frame if it is not the one recorded."""
        camera = CameraUsed(identity, frame.depth_intrinsics, frame.depth_scale_m)
        if camera != self._camera:
            self._camera = camera
            self.write(lambda session: session.save_facts(camera=camera))
