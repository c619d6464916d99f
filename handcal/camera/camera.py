"""The interface of all cameras."""

from __future__ import annotations

from types import TracebackType
from typing import Protocol, Self

from handcal.types import CameraIdentity, Frame, Intrinsics


class Camera(Protocol):
    """A source of frames. Opened by its constructor, closed by `close` or by leaving ``with``.

    Only one thread may use a camera at a time.
    """

    name: str
    identity: CameraIdentity
    """Device that gives the frames, or gave them to a recording; empty where it is not known."""
    depth_intrinsics: Intrinsics

    def read(self, timeout_s: float = 1.0) -> Frame:
        """Return the next frame.

        Raises
        ------
        CameraTimeoutError
            If none arrived within `timeout_s`; `read` may be called again.
        CameraEndError
            If a recording has ended.
        CameraError
            If the camera failed or was unplugged.
        """
        ...

    def close(self) -> None:
        """Release the device; safe to call twice."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...
