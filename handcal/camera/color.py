"""Colour images of a depth camera, such as a RealSense in front of a calibration board."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from handcal.camera.camera import Camera
from handcal.camera.viewpoint import ViewpointCamera
from handcal.core.errors import CameraError
from handcal.core.types import CameraIdentity, Frame, UInt8

Tell: TypeAlias = Callable[[Frame, CameraIdentity], object]
"""Called with the first frame with colour, and the identity of its camera."""

_MOST_WITHOUT = 30
"""Most consecutive frames without colour; cameras pair their first images badly."""


class ColorCamera(ViewpointCamera):
    """Reads the colour images of a depth camera; closing it closes the camera.

    Parameters
    ----------
    camera : Camera
        An open camera, on whose clock the images' times are.
    tell : callable
        Called with the first frame with colour, which gives the pose of the depth imager, and with
        the camera's identity.
    """

    def __init__(self, camera: Camera, tell: Tell = lambda _frame, _identity: None) -> None:
        self.name = camera.name
        self._camera = camera
        self._tell: Tell | None = tell

    def read(self) -> tuple[UInt8, int]:
        """Return the next colour image and its time; CameraTimeoutError if none arrives in time."""
        for _ in range(_MOST_WITHOUT):
            frame = self._camera.read()
            if frame.color is not None:
                if self._tell is not None:
                    self._tell(frame, self._camera.identity)
                    self._tell = None
                return frame.color, frame.t_camera_ns
        raise CameraError(f"{self.name} delivers no colour images, in which boards are found")

    def close(self) -> None:
        """Close the camera."""
        self._camera.close()
