"""A calibration station: camera, headset, procedure and session, opened, run and closed together.

One thread owns a station: it calls `step` for ever, and whatever else is wanted in between.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from handcal.calibrate import Calibration, CalibrationSettings, Observation, PlacedHand, State
from handcal.camera.camera import Camera
from handcal.camera.realsense import RealSenseCamera
from handcal.camera.recording import RecordingCamera
from handcal.camera.synthetic import SyntheticCamera
from handcal.closable import Closable
from handcal.config import settings_json
from handcal.display import view_of_eye
from handcal.errors import (
    CameraEndError,
    CameraError,
    CameraTimeoutError,
    FileError,
    HandcalError,
    LinkError,
)
from handcal.geometry import invert, transform
from handcal.link.pairing import new_pairing_key
from handcal.link.server import LOOPBACK, HeadsetServer
from handcal.resources import resource_path
from handcal.rig.rig_file import read_rig
from handcal.session import Session, SessionRecord
from handcal.sim.eyes import TrueEyes
from handcal.sim.hand import make_hand
from handcal.sim.process import VirtualHeadset
from handcal.sim.render import World
from handcal.sim.room import make_room
from handcal.sim.scene import SceneReceiver
from handcal.snapshot import CameraStatus, Procedure, Snapshot
from handcal.types import EYES, Eye, Float64, Frame, Rig
from handcal.wearer_view import EyeView, see

Source = Literal["simulator", "recording", "realsense"]
HeadsetKind = Literal["virtual", "network"]
DEFAULT_PORT = 47800


@dataclass(frozen=True, slots=True)
class StationSettings:
    """What a station is made of.

    Attributes
    ----------
    source : {"simulator", "recording", "realsense"}
    recording : str
        Path of the recording that `source` plays, over and over.
    serial : str
        Of the RealSense; empty takes the first.
    headset : {"virtual", "network"}
        The virtual headset is a process of its own on this machine; it brings the simulated wearer.
    host, port : str, int
        Where a network headset connects to.
    rig : str
        Path of the rig file; empty takes the example, which is the virtual headset's own.
    seed : int
        Of the simulated wearer, hand and room.
    loss, reorder : float
        Share of the virtual headset's datagrams lost, and reordered, in each direction.
    sessions : str
        Folder in which sessions are created.
    calibration : CalibrationSettings
    """

    source: Source = "simulator"
    recording: str = ""
    serial: str = ""
    headset: HeadsetKind = "virtual"
    host: str = "0.0.0.0"  # noqa: S104 (a headset is another device; the datagrams are signed)
    port: int = DEFAULT_PORT
    rig: str = ""
    seed: int = 1
    loss: float = 0.0
    reorder: float = 0.0
    sessions: str = "sessions"
    calibration: CalibrationSettings = field(default_factory=CalibrationSettings)

    @property
    def rig_path(self) -> Path:
        """Path of the rig file to read."""
        return Path(self.rig) if self.rig else resource_path("example_rig.yaml")
