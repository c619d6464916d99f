"""Frames from an Intel RealSense camera."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, TypeAlias

import numpy as np

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
from handcal.camera.settings import Profile, RealSenseSettings
from handcal.core.errors import CameraError, CameraTimeoutError
from handcal.core.geometry import image_points, transform
from handcal.core.types import Float32, Float64, Frame
from handcal.io.closable import Closable

_AIM_S = 1.0
_LOST_S = 3.0
_SIDE_MIN_PX = 16


def apply_options(device: Any, settings: RealSenseSettings) -> None:
    """Apply the settings to a device of the SDK that is not streaming yet.

    Raises
    ------
    CameraError
        If the device has no such option, or the value is out of its range.
    """
    rs = librealsense()
    option = rs.option
    for sensor in device.query_sensors():
        if sensor.supports(option.global_time_enabled):  # all streams on the host's clock
            sensor.set_option(option.global_time_enabled, 1.0)
    depth = device.first_depth_sensor()
    if settings.preset is not None:  # first, as it sets the others too
        preset = getattr(rs.rs400_visual_preset, settings.preset)
        _set(depth, option.visual_preset, float(preset), "visual preset")
    if settings.exposure_us is not None:
        _set(depth, option.enable_auto_exposure, 0.0, "automatic exposure")
        _set(depth, option.exposure, settings.exposure_us, "exposure", "µs")
    elif depth.supports(option.enable_auto_exposure):
        depth.set_option(option.enable_auto_exposure, 1.0)
    if settings.laser_power_mw is not None:
        _set(depth, option.laser_power, settings.laser_power_mw, "laser power", "mW")


class HandExposure:
    """Makes a sensor measure its automatic exposure on the hand.

    The region follows the hand once a second. `restore` sets the sensor's own region again; so does
    the absence of a hand for three seconds. A refusal by the sensor is ignored until the next time.

    Parameters
    ----------
    sensor : object
        With `get_region_of_interest` and `set_region_of_interest`, as the SDK's roi_sensor.
    size_px : tuple of int
        Width and height of its image.
    clock_s : callable, optional
        Returns the time in seconds.
    """

    def __init__(
        self,
        sensor: Any,
        size_px: tuple[int, int],
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._sensor = sensor
        self._size_px = size_px
        self._clock_s = clock_s
        self._own: Any = None
        self._aimed_s = -np.inf
        self._seen_s = -np.inf

    def aim(self, find_px: Callable[[], Float64] | None) -> None:
        """Follow the hand.

        Parameters
        ----------
        find_px : callable, optional
            Returns the hand's points in the image, (N, 2) px; called once a second. None without a
            hand.
        """
        now_s = self._clock_s()
        if find_px is None:
            if now_s - self._seen_s >= _LOST_S:
                self.restore()
            return
        self._seen_s = now_s
        if now_s - self._aimed_s < _AIM_S:
            return
        self._aimed_s = now_s
        points_px = find_px()
        last = np.array(self._size_px) - 1
        low = np.floor(points_px.min(axis=0)).clip(0, last)
        high = np.ceil(points_px.max(axis=0)).clip(0, last)
        if (high - low < _SIDE_MIN_PX).any():
            return
        with suppress(RuntimeError):  # some firmware refuses it at times
            if self._own is None:
                self._own = self._sensor.get_region_of_interest()
            region = librealsense().region_of_interest()
            region.min_x, region.min_y = low.astype(int).tolist()
            region.max_x, region.max_y = high.astype(int).tolist()
            self._sensor.set_region_of_interest(region)

    def restore(self) -> None:
        """Set the sensor's own region, if another was set."""
        if self._own is not None:
            with suppress(RuntimeError):  # it may have been unplugged
                self._sensor.set_region_of_interest(self._own)
            self._own, self._aimed_s = None, -np.inf


def depth_filter(settings: RealSenseSettings) -> Callable[[Any], Any]:
    """Return a function that filters a depth frame of the SDK by the settings.

    Spatial and temporal filters work on the disparity, as the SDK recommends.
    """
    rs = librealsense()
    filters = []
    if settings.spatial_filter:
        filters.append(rs.spatial_filter())
    if settings.temporal_filter:
        filters.append(rs.temporal_filter())
    if filters:
        filters = [rs.disparity_transform(True), *filters, rs.disparity_transform(False)]
    if settings.hole_filling:
        filters.append(rs.hole_filling_filter())

    def apply(depth: Any) -> Any:
        for step in filters:
            depth = step.process(depth).as_depth_frame()
        return depth

    return apply


def _set(sensor: Any, option: Any, value: float, name: str, unit: str = "") -> None:
    if not sensor.supports(option):
        raise CameraError(f"this camera has no {name} to set", "leave it as it is")
    limits = sensor.get_option_range(option)
    if not limits.min <= value <= limits.max:
        raise CameraError(
            f"{name} cannot be set to {value:g}",
            f"it ranges from {limits.min:g} to {limits.max:g} {unit}".rstrip(),
        )
    sensor.set_option(option, value)


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
        advice,
    )


def _video(profile: Any) -> Any:
    """Return a profile as a video profile; None for motion or pose streams."""
    return profile.as_video_stream_profile() if profile.is_video_stream_profile() else None
