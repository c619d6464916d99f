"""Settings put into effect on a software device."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from handcal.camera.realsense import HandExposure, apply_options
from handcal.camera.settings import RealSenseSettings
from handcal.core.errors import CameraError

rs = pytest.importorskip("pyrealsense2")

OPTIONS = {
    "enable_auto_exposure": (0.0, 1.0),
    "exposure": (1.0, 165_000.0),
    "laser_power": (0.0, 360.0),
    "visual_preset": (0.0, 6.0),
    "global_time_enabled": (0.0, 1.0),
}


def values(camera: Any) -> dict[str, float]:
    return {name: camera.depth.get_option(getattr(rs.option, name)) for name in OPTIONS}


def test_what_is_set_reaches_the_device(plug_in: Callable[..., Any]) -> None:
    camera = plug_in(options=OPTIONS)
    settings = RealSenseSettings(preset="hand", exposure_us=8000.0, laser_power_mw=300.0)
    apply_options(camera.device, settings)
    assert values(camera) == {
        "enable_auto_exposure": 0.0,
        "exposure": 8000.0,
        "laser_power": 300.0,
        "visual_preset": float(rs.rs400_visual_preset.hand),
        "global_time_enabled": 1.0,
    }


def test_what_is_not_set_stays_but_exposure_is_automatic_again(
    plug_in: Callable[..., Any],
) -> None:
    camera = plug_in(options=OPTIONS)
    apply_options(camera.device, RealSenseSettings(exposure_us=8000.0, laser_power_mw=300.0))
    apply_options(camera.device, RealSenseSettings())
    assert values(camera)["enable_auto_exposure"] == 1.0
    assert values(camera)["laser_power"] == 300.0


def test_what_the_device_cannot_is_named(plug_in: Callable[..., Any]) -> None:
    with pytest.raises(CameraError, match="this camera has no laser power to set"):
        apply_options(plug_in().device, RealSenseSettings(laser_power_mw=10.0))
    apply_options(plug_in().device, RealSenseSettings())
    with pytest.raises(CameraError, match=r"laser power ranges from 0 to 360 mW, so 500 cannot"):
        apply_options(plug_in(options=OPTIONS).device, RealSenseSettings(laser_power_mw=500.0))


class RoiSensor:
    """Stands for a sensor that measures its exposure on a region."""

    def __init__(self) -> None:
        self.own = region(0, 0, 639, 479)
        self.regions: list[tuple[int, int, int, int]] = []
        self.refuses = False

    def get_region_of_interest(self) -> Any:
        return self.own

    def set_region_of_interest(self, new: Any) -> None:
        if self.refuses:
            raise RuntimeError("hwmon command 0x80 failed")
        self.regions.append((new.min_x, new.min_y, new.max_x, new.max_y))


def region(*sides: int) -> Any:
    made = rs.region_of_interest()
    made.min_x, made.min_y, made.max_x, made.max_y = sides
    return made


WHOLE = (0, 0, 639, 479)


def aimed(sensor: RoiSensor) -> tuple[HandExposure, Callable[..., None]]:
    """Return the exposure of a sensor, and a function that shows it a hand at a time."""
    now_s = [0.0]
    exposure = HandExposure(sensor, (640, 480), lambda: now_s[0])

    def show(time_s: float, *corners: tuple[float, float]) -> None:
        now_s[0] = time_s
        exposure.aim((lambda: np.array(corners)) if corners else None)

    return exposure, show


HAND = ((100.4, 50.0), (200.0, 149.2))


def test_exposure_follows_the_hand_once_a_second() -> None:
    sensor = RoiSensor()
    _, show = aimed(sensor)
    for time_s in (0.0, 0.4, 0.9):
        show(time_s, *HAND)
    assert sensor.regions == [(100, 50, 200, 150)]
    show(1.0, (-20.0, 400.0), (90.0, 700.0))
    assert sensor.regions[1:] == [(0, 400, 90, 479)]


def test_the_sensors_own_region_returns_at_close_and_without_a_hand() -> None:
    sensor = RoiSensor()
    exposure, show = aimed(sensor)
    exposure.restore()
    assert sensor.regions == []
    show(0.0, *HAND)
    show(2.9)
    assert len(sensor.regions) == 1
    show(3.0)
    assert sensor.regions[1:] == [WHOLE]
    show(3.1, *HAND)
    exposure.restore()
    exposure.restore()
    assert sensor.regions[3:] == [WHOLE]


def test_a_hand_outside_the_image_and_a_refusal_change_nothing() -> None:
    sensor = RoiSensor()
    _, show = aimed(sensor)
    show(0.0, (700.0, 10.0), (800.0, 90.0))
    sensor.refuses = True
    show(1.0, *HAND)
    assert sensor.regions == []
    sensor.refuses = False
    show(2.0, *HAND)
    assert len(sensor.regions) == 1
