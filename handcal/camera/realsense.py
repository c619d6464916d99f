"""Frames from an Intel RealSense camera."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, TypeAlias

from handcal.camera.sdk_devices import (
    Device,
    choose_device,
    connected_devices,
    describe_device,
    librealsense,
    sdk_devices,
)
from handcal.camera.sdk_frames import (
    apart_ms,
    extrinsics_between,
    frame_of,
    intrinsics_of,
    with_color,
)
from handcal.camera.sdk_options import HandExposure, apply_options, depth_filter
from handcal.camera.settings import Profile, RealSenseSettings
from handcal.core.errors import CameraError, CameraTimeoutError
from handcal.core.geometry import image_points, transform
from handcal.core.types import Float32, Frame
from handcal.io.closable import Closable

_SIZES = ("1280x720", "848x480")
_RATE_HZ = 30
_QUEUE_FRAMES = 2
_Stream: TypeAlias = tuple[Any, Any]
"""A sensor of the SDK, and the profile to run."""


class RealSenseCamera(Closable):
    """Live depth with colour of the same size, at 30 Hz; implements `Camera`.

    Depth is delivered as measured, not aligned to colour. Written from the SDK's documentation and
    tested with its software device; not yet run on a camera.

    Parameters
    ----------
    settings : RealSenseSettings

    Raises
    ------
    CameraError
        If the SDK or the device is missing, in use, or does not support the settings.
    """

    def __init__(self, settings: RealSenseSettings | None = None) -> None:
        settings = settings or RealSenseSettings()
        handles = sdk_devices()
        devices = [describe_device(handle) for handle in handles]
        self._device = choose_device(devices, settings.serial)
        self.identity = self._device.identity
        handle = handles[devices.index(self._device)]
        self._sensors: list[Any] = []
        self._exposure: HandExposure | None = None
        self._syncer = librealsense().syncer(_QUEUE_FRAMES)
        self._filter = depth_filter(settings)
        try:
            streams = _choose_streams(handle, self._device, settings.profile)
            (_, depth), (color_sensor, color) = streams
            self.depth_intrinsics = intrinsics_of(depth)
            self._color_intrinsics = intrinsics_of(color)
            self._T_C_D = extrinsics_between(depth, color)
            apply_options(handle, settings)
            self._start(streams)
            if color_sensor.is_roi_sensor() and not settings.expose_whole_image:
                size_px = self._color_intrinsics.width, self._color_intrinsics.height
                self._exposure = HandExposure(color_sensor.as_roi_sensor(), size_px)
        except RuntimeError as error:
            self.close()
            raise CameraError(
                f"{self._device.name} does not start: {error}",
                "close other programs that use it, or plug it in again",
            ) from error
        size = f"{self.depth_intrinsics.width}x{self.depth_intrinsics.height}"
        slow = f", only USB {self._device.usb}" if self._device.is_slow else ""
        self.name = f"{self._device.name} ({size}{slow})"

    def read(self, timeout_s: float = 1.0) -> Frame:
        """Return the next frame with depth; see `Camera.read`."""
        if not self._sensors:
            raise CameraError(f"{self.name} is closed", "open it again")
        depth, color = self._wait(timeout_s)
        frame = frame_of(self._filter(depth), self.depth_intrinsics)
        if not color or apart_ms(color, depth) > 1e3 / _RATE_HZ:
            return frame
        return with_color(frame, color, self._T_C_D)

    def expose_for(self, points_m: Float32 | None) -> None:
        """Measure the exposure of colour on the hand; see `ExposesForHand`."""
        if self._exposure is None:
            return
        if points_m is None:
            self._exposure.aim(None)
            return
        in_color = self._T_C_D, self._color_intrinsics
        self._exposure.aim(lambda: image_points(transform(in_color[0], points_m), in_color[1]))

    def close(self) -> None:
        """Stop the device; safe to call twice."""
        if self._exposure is not None:
            self._exposure.restore()
            self._exposure = None
        for sensor in self._sensors:
            with suppress(RuntimeError):  # it may have been unplugged
                sensor.stop()
            with suppress(RuntimeError):
                sensor.close()
        self._sensors = []

    def _start(self, streams: Sequence[_Stream]) -> None:
        for sensor in {id(sensor): sensor for sensor, _ in streams}.values():
            self._sensors.append(sensor)
            sensor.open([profile for owner, profile in streams if owner is sensor])
            sensor.start(self._syncer)

    def _wait(self, timeout_s: float) -> tuple[Any, Any]:
        """Return the next depth frame and the colour frame paired with it, if any."""
        deadline_s = time.monotonic() + timeout_s
        while (left_s := deadline_s - time.monotonic()) > 0:
            try:
                arrived, frames = self._syncer.try_wait_for_frames(max(1, round(1e3 * left_s)))
            except RuntimeError as error:
                raise CameraError(f"{self.name} failed: {error}", "plug it in again") from error
            if arrived and (depth := frames.get_depth_frame()):
                return depth, frames.get_color_frame()
        if self._device.serial not in [device.serial for device in connected_devices()]:
            raise CameraError(f"{self.name} was unplugged", "plug it in again")
        raise CameraTimeoutError(f"{self.name}: no frame for {timeout_s:g} s")


def _choose_streams(handle: Any, device: Device, wanted: Profile) -> tuple[_Stream, _Stream]:
    """Return depth and colour of the largest requested size that the device offers for both."""
    rs = librealsense()
    offered = {
        (profile.stream_type(), profile.format(), f"{profile.width()}x{profile.height()}"): (
            sensor,
            profile,
        )
        for sensor in handle.query_sensors()
        for profile in map(_video, sensor.get_stream_profiles())
        if profile and profile.fps() == _RATE_HZ
    }
    sizes = _SIZES if wanted == "auto" else (wanted,)
    for size in sizes:
        depth = offered.get((rs.stream.depth, rs.format.z16, size))
        color = offered.get((rs.stream.color, rs.format.rgb8, size))
        if depth and color:
            return depth, color
    advice = "choose another profile or camera"
    if device.is_slow:
        advice = f"it is on USB {device.usb}: use a USB 3 port and cable"
    raise CameraError(
        f"{device.name} offers no depth with colour of {' or '.join(sizes)} at {_RATE_HZ} Hz",
        f"{advice}",
    )


def _video(profile: Any) -> Any:
    """Return a profile as a video profile; None for motion or pose streams."""
    return profile.as_video_stream_profile() if profile.is_video_stream_profile() else None
