"""What a station knows at one frame, for whoever watches: frozen, and complete in itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from handcal.camera.feed import CameraStatus
from handcal.link.server import LinkStatistics
from handcal.register.results import Results
from handcal.session.session import SessionRecord
from handcal.station.hands import PlacedHand
from handcal.station.procedure import Observation, State
from handcal.station.wearer_view import EyeView
from handcal.types import Alignment, Eye, Float64, Frame


@dataclass(frozen=True, slots=True, eq=False)
class Procedure:
    """Where the calibration stands."""

    state: State
    eyes: tuple[Eye, ...]
    """Those that the present cursor is for."""
    cursor: PlacedHand | None
    """The frozen hand while one is shown."""
    refusal: str
    """Why the last confirmation of the present cursor was refused; empty if none was."""
    refused: int
    """Confirmations refused so far."""
    guard_limit_rad: float
    alignments: Mapping[int, Alignment]
    """Those not deleted, by number, even while the session cannot take them."""
    results: Results | None
    """Of all alignments; None while there are none, or alignments have changed since."""
    applied_shift_m: Mapping[Eye, Float64]
    """each (3,); what the headset renders with."""
    is_applied: bool
    """Whether it has acknowledged that."""


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """Everything at one frame."""

    number: int
    """Running number, from 1."""
    t_host_ns: int
    """Host's monotonic time when it was taken."""
    frame: Frame | None
    """The newest; None before the first."""
    observation: Observation | None
    """What the procedure saw in it; None if no frame came since the last snapshot."""
    camera: CameraStatus
    link: LinkStatistics
    link_problem: str
    """What is wrong with the headset, and what to do; empty if nothing is."""
    problem: str
    """What went wrong in the procedure itself, such as a full disk; empty if nothing did."""
    procedure: Procedure
    record: SessionRecord
    """The session as it is on the disk; the same object until it changes."""
    views: Mapping[Eye, EyeView] = field(default_factory=dict)
    """What the wearer sees, if asked for (`Station.watch_views`)."""

    @property
    def session_path(self) -> Path:
        """Folder of the session."""
        return self.record.path
