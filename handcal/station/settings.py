"""Settings of a calibration station."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from handcal.calibration.plan import PlanSettings
from handcal.calibration.states import CalibrationSettings
from handcal.camera.hololens2 import hololens2_settings, identity_of
from handcal.camera.playback import PlaybackSettings
from handcal.camera.settings import HoloLens2Settings, RealSenseSettings
from handcal.hand.settings import usual_gate_m
from handcal.io.files import user_path
from handcal.io.resources import resource_path
from handcal.sim.hand import Side
from handcal.sim.sensor import SensorName
from handcal.station.faults import Fault

Source = Literal["simulator", "recording", "realsense", "hololens2", "oak", "orbbec"]
HeadsetKind = Literal["virtual", "network"]
DEFAULT_PORT = 47800


@dataclass(frozen=True, slots=True)
class StationSettings:
    """Settings of a station."""

    source: Source = "simulator"
    recording: str = ""
    """Path of the recording to play, if `source` is one: a file or a folder."""
    playback: PlaybackSettings = field(
        default_factory=lambda: PlaybackSettings(real_time=True, loop=True)
    )
    """Default: in real time and in a loop."""
    realsense: RealSenseSettings = field(default_factory=RealSenseSettings)
    hololens2: HoloLens2Settings = field(default_factory=HoloLens2Settings)
    serial: str = ""
    """Serial number of an OAK-D or Orbbec camera; empty: the first."""
    headset: HeadsetKind = "virtual"
    """The virtual headset runs as a separate process on this machine and includes the simulated
    wearer."""
    host: str = "0.0.0.0"  # noqa: S104 (a headset is another device; the datagrams are signed)
    port: int = DEFAULT_PORT
    """Address that a network headset connects to."""
    rig: str = ""
    """Path of the rig file; if empty, the example, which fits the virtual headset."""
    worn_rig: str = ""
    """Path of the true rig of the simulated wearer; if empty, `rig`."""
    seed: int = 1
    """Seed of the simulated wearer, hand and room."""
    loss: float = 0.0
    reorder: float = 0.0
    """Share of the virtual headset's datagrams lost, and reordered, in each direction."""
    fault: Fault = ""
    """Fault of the simulated camera or the virtual headset; empty: none."""
    sensor: SensorName = "d415"
    """The kind of simulated camera."""
    fatten_px: float | None = None
    """By how much the edges in the images of a simulated stereo camera grow, px; None: as usual."""
    side: Side | None = None
    """The hand that the simulated wearer raises; None: drawn from the seed."""
    slip_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Movement of the simulated wearer's headset since the seed's eyes were drawn, E axes."""
    eye_distance_m: float | None = None
    """Eye distance that the virtual headset reports; None: it measures none."""
    sessions: str = "sessions"
    """Folder in which sessions are created."""
    learn_prior: bool = True
    """Learn where wearers' eyes are from the finished sessions in this folder with the same rig,
    once there are enough."""
    use_far_prior: bool = False
    """Use what was learned although its mean is far from the rig's viewpoint."""
    learn_wearers: bool = False
    """Learn from them what wearers see wrongly in a whole sitting, too."""
    plan: PlanSettings = field(default_factory=PlanSettings)
    calibration: CalibrationSettings = field(default_factory=CalibrationSettings)

    @property
    def rig_path(self) -> Path:
        """Path of the rig file to read."""
        return user_path(self.rig) if self.rig else resource_path("example_rig.yaml")

    @property
    def sessions_path(self) -> Path:
        """Path of the folder for sessions."""
        return user_path(self.sessions)


def with_gate(settings: StationSettings, gate_m: tuple[float, float]) -> StationSettings:
    """Return settings with another depth gate."""
    near_m, far_m = gate_m
    segment = replace(settings.calibration.segment, depth_min_m=near_m, depth_max_m=far_m)
    return replace(settings, calibration=replace(settings.calibration, segment=segment))


def with_usual_gate(settings: StationSettings, former: StationSettings) -> StationSettings:
    """Return settings with the depth gate usual for the camera, if it was so in `former`."""
    segment = settings.calibration.segment
    if (segment.depth_min_m, segment.depth_max_m) != gate_of_camera_m(former):
        return settings
    return with_gate(settings, gate_of_camera_m(settings))


def gate_of_camera_m(settings: StationSettings) -> tuple[float, float]:
    """Return the depth gate usual for a station's camera."""
    is_own = settings.source == "hololens2"
    return usual_gate_m(identity_of(settings.hololens2).model if is_own else "")


def with_source(settings: StationSettings, source: str) -> StationSettings:
    """Return settings with the camera of this name, and the depth gate usual for it.

    A gate that was not the usual one of the former camera is kept.

    Parameters
    ----------
    settings : StationSettings
    source : str
        ``realsense``, ``simulator``, a name of `open_live`, or the path of a recording.
    """
    kind, _, serial = source.partition(":")
    former = settings
    match source, kind:
        case ("realsense" | "simulator") as plain, _:
            settings = replace(settings, source=plain)
        case _, ("oak" | "orbbec") as named:
            settings = replace(settings, source=named, serial=serial)
        case _ if (hololens2 := hololens2_settings(source)) is not None:
            settings = replace(settings, source="hololens2", hololens2=hololens2)
        case _:
            settings = replace(settings, source="recording", recording=source)
    return with_usual_gate(settings, former)
