"""Settings put into effect on a software device."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from handcal.camera.sdk_options import apply_options
from handcal.camera.settings import RealSenseSettings
from handcal.errors import CameraError

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
