"""Settings of live cameras."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

Profile: TypeAlias = Literal["auto", "1280x720", "848x480"]
Preset: TypeAlias = Literal["default", "hand", "high_accuracy", "high_density", "medium_density"]


@dataclass(frozen=True, slots=True)
class RealSenseSettings:
    """Settings of a RealSense camera; None leaves an option as set on the device.

    Depth is never decimated, as its pixels would no longer match the rig's calibration.
    """

    serial: str = ""
    """Serial number of the device; empty selects the first."""
    profile: Profile = "auto"
    """Size of depth and colour, at 30 Hz; "auto" selects the largest that the device offers."""
    preset: Preset | None = None
    """The SDK's visual preset of the depth sensor."""
    exposure_us: float | None = None
    """Exposure of the depth sensor in microseconds; None for automatic exposure."""
    laser_power_mw: float | None = None
    """Power of the projector."""
    expose_whole_image: bool = False
    """Measure the automatic exposure of colour on the whole image, not on the hand once found."""
    spatial_filter: bool = False
    temporal_filter: bool = False
    hole_filling: bool = False
    """The SDK's filters of the depth image; off, as they smooth and fill in depth."""


@dataclass(frozen=True, slots=True)
class HoloLens2Settings:
    """Settings of a depth camera of a HoloLens 2, streamed by hl2ss."""

    host: str = ""
    """Address of the headset."""
    stream: Literal["ahat", "longthrow"] = "ahat"
    """The depth camera for hands, or that for rooms."""
    port: int | None = None
    """Port of the stream; None for hl2ss's own."""
    divisor: int = 3
    """One of this many images of the headset's own camera is sent: AHAT makes 45 per second, too
    many for Wi-Fi."""
    has_color: bool = False
    """Send the pictures of the front colour camera, too, in place of the depth camera's grey."""
    color_port: int | None = None
    """Port of these, and of the list of connected cameras; None for hl2ss's own."""
    realsense_rig: str | None = None
    """Rig file with the lens of a RealSense on the headset's USB port, which is then streamed; None
    for the headset's own depth cameras."""
    keeps_wrapped: bool = False
    """Keep distances that may be of a surface one alias farther away. A depth check needs it: the
    ink of its board is as dark as a far wall."""

    def __post_init__(self) -> None:
        if not 1 <= self.divisor <= 255:
            raise ValueError(f"divisor is {self.divisor}; set 1 to 255")
