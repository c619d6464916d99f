"""The state of a station at one frame, for display: complete and immutable."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from handcal.camera.feed import CameraStatus
from handcal.hand.settings import SegmentSettings
from handcal.link.statistics import LinkStatistics
from handcal.register.results import Results
from handcal.register.verdict import VerdictSettings
from handcal.session.comparison import Place
from handcal.session.session import SessionRecord
from handcal.station.hands import PlacedHand
from handcal.station.plan import NextStep
from handcal.station.procedure import Calibration
from handcal.station.states import CalibrationSettings, Observation, State
from handcal.station.verifying import VerifyingView
from handcal.station.wearer_view import EyeView
from handcal.types import Alignment, Eye, Float64, Frame, PlanName, Verification


@dataclass(frozen=True, slots=True, eq=False)
class Procedure:
    """State of the calibration."""

    state: State
    eyes: tuple[Eye, ...]
    """Eyes that the present cursor is for."""
    cursor: PlacedHand | None
    """The frozen hand while it is shown, else None."""
    refusal: str
    """Reason why the last confirmation of the present cursor was refused; empty if none was."""
    guard_limit_rad: float
    alignments: Mapping[int, Alignment]
    """By number, without deleted ones, including those that could not be written yet."""
    results: Results | None
    """Results of all alignments; None if there are none or the alignments have changed since."""
    applied_shift_m: Mapping[Eye, Float64]
    """each (3,); φ that the headset renders with."""
    is_applied: bool
    """True if the headset has acknowledged it."""
    segment: SegmentSettings = field(default_factory=SegmentSettings)
    """Settings with which the hand is looked for."""
    plan: PlanName = "paper"
    next_step: NextStep | None = None
    """The plan's next step; None before the first frame."""
    verifying: VerifyingView | None = None
    """The verification in progress, in the state `verify`."""
    verifications: Mapping[Eye, Verification] = field(default_factory=dict)
    """The newest verification of each eye."""
    former_shift_m: Mapping[Eye, Float64] = field(default_factory=dict)
    """each (3,); φ to which `Calibration.go_back` returns."""
    target_arcmin: float = VerdictSettings().target_arcmin
    """The lab's target for the error."""
    refused_for: str = ""
    """`refusal` in the past tense, if the live hand shows whether its cause lasts; else empty."""


def read_procedure(
    calibration: Calibration,
    settings: CalibrationSettings,
    plan: PlanName,
    next_step: NextStep | None,
) -> Procedure:
    """Return the present state of a calibration; the other arguments are as in `Procedure`."""
    return Procedure(
        state=calibration.state,
        eyes=calibration.eyes,
        cursor=calibration.cursor,
        refusal=calibration.refusal,
        guard_limit_rad=settings.guard.limit_rad,
        alignments=calibration.alignments,
        results=calibration.results,
        applied_shift_m=calibration.applied_shift_m,
        is_applied=calibration.is_applied,
        segment=settings.segment,
        plan=plan,
        next_step=next_step,
        verifying=None if calibration.verifying is None else calibration.verifying.view(),
        verifications=dict(calibration.verifications),
        former_shift_m=calibration.former_shift_m,
        target_arcmin=settings.solve.verdict.target_arcmin,
        refused_for=calibration.refused_for,
    )


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
    problem: str
    """Problem of the procedure, such as a full disk; empty if there is none."""
    procedure: Procedure
    record: SessionRecord
    """The session as stored on disk; the same object until it changes."""
    not_stored: str = ""
    """Reason why the newest data are not in the session yet; empty if they are."""
    contradiction: str = ""
    """Evidence against the calibration or this frame, with advice; empty if there is none."""
    views: Mapping[Eye, EyeView] = field(default_factory=dict)
    """The wearer's views, if requested by `Station.watch_views`; none during a comparison."""
    comparing: Place | None = None
    """The drawing shown in a blinded comparison; None while there is none."""
    has_compared_both: bool = False
    """True once both drawings of the comparison have been shown."""

    @property
    def session_path(self) -> Path:
        """Folder of the session."""
        return self.record.path
