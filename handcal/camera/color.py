"""The colour images of a camera with depth, such as a RealSense seeing a calibration board."""

from __future__ import annotations

from collections.abc import Callable

from handcal.camera.camera import Camera
from handcal.camera.viewpoint import ViewpointCamera
from handcal.errors import CameraError
from handcal.types import Frame, UInt8

_MOST_WITHOUT = 30
"""Frames without colour in a row; cameras pair their first images badly."""


class ColorCamera(ViewpointCamera):
    """Gives the colour of a camera with depth, and closes that.

    Parameters
    ----------
    camera : Camera
        Open; its images' times are the camera's own.
    tell : callable
        Given the first frame with colour, which says where the depth imager is.
    """

    def __init__(
        self, camera: Camera, tell: Callable[[Frame], object] = lambda _frame: None
    ) -> None:
        self.name = camera.name
        self._camera = camera
        self._tell: Callable[[Frame], object] | None = tell

    def read(self) -> tuple[UInt8, int]:
        """Return the next colour image and its time; CameraTimeoutError if none came soon."""
        for _ in range(_MOST_WITHOUT):
            frame = self._camera.read()
            if frame.color is not None:
                if self._tell is not None:
                    self._tell(frame)
                    self._tell = None
                return frame.color, frame.t_camera_ns
        raise CameraError(f"{self.name} gives no colour, which boards are seen by")

    def close(self) -> None:
        """Close the camera."""
        self._camera.close()
