"""The interface of all cameras."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Protocol, runtime_checkable

from handcal.core.types import CameraIdentity, Float32, Frame, Intrinsics


class Camera(AbstractContextManager["Camera"], Protocol):
    """A source of frames. Opened by its constructor, closed by `close` or by leaving ``with``.

    Only one thread may use a camera at a time.
    """

    name: str
    identity: CameraIdentity
    """Device that delivers the frames, or delivered them to a recording; empty if unknown."""
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


@runtime_checkable
class ExposesForHand(Protocol):
    """A camera that can measure its exposure on the hand."""

    def expose_for(self, points_m: Float32 | None) -> None:
        """Take note of the hand in the newest frame.

        Parameters
        ----------
        points_m : (N, 3) float32, optional
            Its points in the depth camera's frame; None if none is seen.
        """
        ...
