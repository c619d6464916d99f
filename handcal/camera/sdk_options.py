"""Application of `RealSenseSettings`: options of the device and filters of its depth."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from handcal.camera.sdk_devices import librealsense
from handcal.camera.settings import RealSenseSettings
from handcal.core.errors import CameraError
from handcal.core.types import Float64

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
        for one in filters:
            depth = one.process(depth).as_depth_frame()
        return depth

    return apply


def _set(sensor: Any, option: Any, value: float, what: str, unit: str = "") -> None:
    if not sensor.supports(option):
        raise CameraError(f"this camera has no {what} to set", "leave it as it is")
    limits = sensor.get_option_range(option)
    if not limits.min <= value <= limits.max:
        raise CameraError(
            f"{what} ranges from {limits.min:g} to {limits.max:g} {unit}".rstrip()
            + f", so {value:g} cannot be set"
        )
    sensor.set_option(option, value)
