"""What a calibration station is made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from handcal.camera.playback import PlaybackSettings
from handcal.camera.settings import RealSenseSettings
from handcal.io.resources import resource_path
from handcal.station.procedure import CalibrationSettings

Source = Literal["simulator", "recording", "realsense"]
HeadsetKind = Literal["virtual", "network"]
DEFAULT_PORT = 47800


@dataclass(frozen=True, slots=True)
class StationSettings:
    """What a station is made of."""

    source: Source = "simulator"
    recording: str = ""
    """Path of the recording that `source` plays: a file or a folder."""
    playback: PlaybackSettings = field(
        default_factory=lambda: PlaybackSettings(real_time=True, loop=True)
    )
    """How: at its own pace and over and over, unless told otherwise."""
    realsense: RealSenseSettings = field(default_factory=RealSenseSettings)
    headset: HeadsetKind = "virtual"
    """The virtual headset is a process of its own on this machine; it brings the simulated
    wearer."""
    host: str = "0.0.0.0"  # noqa: S104 (a headset is another device; the datagrams are signed)
    port: int = DEFAULT_PORT
    """Where a network headset connects to."""
    rig: str = ""
    """Path of the rig file; empty takes the example, which is the virtual headset's own."""
    worn_rig: str = ""
    """Path of the rig that the simulated wearer really looks through; empty takes `rig`."""
    seed: int = 1
    """Of the simulated wearer, hand and room."""
    loss: float = 0.0
    reorder: float = 0.0
    """Share of the virtual headset's datagrams lost, and reordered, in each direction."""
    sessions: str = "sessions"
    """Folder in which sessions are created."""
    calibration: CalibrationSettings = field(default_factory=CalibrationSettings)

    @property
    def rig_path(self) -> Path:
        """Path of the rig file to read."""
        return Path(self.rig) if self.rig else resource_path("example_rig.yaml")
