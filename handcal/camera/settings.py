"""How a RealSense camera is run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

Profile: TypeAlias = Literal["auto", "1280x720", "848x480"]
Preset: TypeAlias = Literal["default", "hand", "high_accuracy", "high_density", "medium_density"]


@dataclass(frozen=True, slots=True)
class RealSenseSettings:
    """How a RealSense camera is run; what is None stays as the device has it.

    Depth is never decimated, since its pixels would no longer be those of the rig's calibration.
    """

    serial: str = ""
    """Of the device; empty takes the first."""
    profile: Profile = "auto"
    """Size of depth and colour, at 30 Hz; auto takes the largest that the device offers."""
    preset: Preset | None = None
    """The SDK's visual preset for the depth."""
    exposure_us: float | None = None
    """Of the depth, in microseconds; None lets the device choose it from frame to frame."""
    laser_power_mw: float | None = None
    """Of the projector."""
    spatial_filter: bool = False
    temporal_filter: bool = False
    hole_filling: bool = False
    """The SDK's filters of the depth image. They smooth and invent, so they are off."""
