"""Application of `RealSenseSettings`: options of the device and filters of its depth."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from handcal.camera.sdk_devices import librealsense
from handcal.camera.settings import RealSenseSettings
from handcal.errors import CameraError


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
        raise CameraError(f"this camera has no {what} to set; leave it as it is")
    limits = sensor.get_option_range(option)
    if not limits.min <= value <= limits.max:
        raise CameraError(
            f"{what} ranges from {limits.min:g} to {limits.max:g} {unit}".rstrip()
            + f", so {value:g} cannot be set"
        )
    sensor.set_option(option, value)
