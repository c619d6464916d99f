"""The state of a station at one frame, for display: complete and immutable."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from handcal.calibration.plan import NextStep, PlanSettings
from handcal.calibration.procedure import Procedure
from handcal.calibration.states import CalibrationSettings, Observation
from handcal.camera.feed import CameraStatus
from handcal.core.types import Eye, Frame
from handcal.link.statistics import LinkStatistics
from handcal.session.comparison import Place
from handcal.session.session import SessionRecord
from handcal.station.wearer_view import EyeView


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """A station at one frame."""

    number: int
    """Running number, from 1."""
    t_host_ns: int
    """Time on the host's monotonic clock."""
    frame: Frame | None
    """The newest frame; None before the first."""
    observation: Observation | None
    """The procedure's result for this frame; None without a new frame."""
    camera: CameraStatus
    link: LinkStatistics
    link_problem: str
    """Problem of the headset and what to do about it; empty if there is none."""
    procedure: Procedure
    record: SessionRecord
    """The session; the same object until it changes."""
    settings: CalibrationSettings = field(default_factory=CalibrationSettings)
    plan: PlanSettings = field(default_factory=PlanSettings)
    next_step: NextStep | None = None
    """The plan's next step; None before the first frame."""
    not_applied: str = ""
    """Reason why the headset does not draw the result; empty if it does."""
    not_stored: str = ""
    """Reason why the newest data are not on disk yet; empty if they are."""
    contradiction: str = ""
    """Evidence against the calibration or this frame, with advice; empty if there is none."""
    views: Mapping[Eye, EyeView] = field(default_factory=dict)
    """The wearer's views, if requested by `Station.watch_views`; none during a comparison."""
    comparing: Place | None = None
    """The drawing shown in a blinded comparison; None while there is none."""
    has_compared_both: bool = False
    """True once both drawings of the comparison have been shown."""
    trial_eye: Eye | None = None
    """The eye to which the target of a trial is shown, and whose φ is moved only for the trial."""

    @property
    def problem(self) -> str:
        """Problem of the procedure, such as a full disk; empty if there is none."""
        return self.not_stored or self.not_applied

    @property
    def session_path(self) -> Path:
        """Folder of the session."""
        return self.record.path
