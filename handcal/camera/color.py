"""Colour images of a depth camera, such as a RealSense in front of a calibration board."""

from __future__ import annotations

from collections.abc import Callable

from handcal.camera.camera import Camera
from handcal.camera.viewpoint import ViewpointCamera
from handcal.errors import CameraError
from handcal.types import Frame, UInt8

_MOST_WITHOUT = 30
"""Most consecutive frames without colour; cameras pair their first images badly."""


class ColorCamera(ViewpointCamera):
    """Reads the colour images of a depth camera; closing it closes the camera.

    Parameters
    ----------
    camera : Camera
        An open camera, on whose clock the images' times are.
    tell : callable
        Called with the first frame with colour, which gives the pose of the depth imager.
    """

    def __init__(
        self, camera: Camera, tell: Callable[[Frame], object] = lambda _frame: None
    ) -> None:
        self.name = camera.name
        self._camera = camera
        self._tell: Callable[[Frame], object] | None = tell

    def read(self) -> tuple[UInt8, int]:
        """Return the next colour image and its time; CameraTimeoutError if none arrives in time."""
        for _ in range(_MOST_WITHOUT):
            frame = self._camera.read()
            if frame.color is not None:
                if self._tell is not None:
                    self._tell(frame)
                    self._tell = None
                return frame.color, frame.t_camera_ns
        raise CameraError(f"{self.name} delivers no colour images, in which boards are found")

    def close(self) -> None:
        """Close the camera."""
        self._camera.close()
