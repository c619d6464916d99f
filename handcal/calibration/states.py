"""States, settings and observations of the calibration procedure."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from handcal.calibration.evidence import Contradiction
from handcal.calibration.hands import PlacedHand
from handcal.core.errors import HandcalError
from handcal.core.types import Float64, HandCloud
from handcal.hand.settings import SegmentSettings
from handcal.register.guard import GuardSettings
from handcal.register.results import SolveSettings

MAX_HAND_SET_SHIFT_M = 0.030
"""Limit of each component of a φ set by hand, beyond the eye box."""


class State(StrEnum):
    """State of the procedure."""

    SHOW_HAND = "show_hand"
    ALIGN = "align"
    ALIGNED = "aligned"
    SOLVED = "solved"
    APPLYING = "applying"
    APPLIED = "applied"
    VERIFY = "verify"


class ProcedureError(HandcalError):
    """A call in the wrong state; the text says what must be done first."""


@dataclass(frozen=True, slots=True)
class CalibrationSettings:
    """Settings of a calibration."""

    segment: SegmentSettings = field(default_factory=SegmentSettings)
    guard: GuardSettings = field(default_factory=GuardSettings)
    solve: SolveSettings = field(default_factory=SolveSettings)


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """The result of one procedure step: state, hand, rotation, timings."""

    state: State
    """After the step."""
    hand: PlacedHand | None
    """The newest hand placed in this step, possibly from an earlier frame; None if none was."""
    problem: str
    """Reason why there is no hand; empty if there is one."""
    is_steady: bool
    """True if a cursor can be made now."""
    cloud: HandCloud | None = None
    """The hand in this step's own frame, placed or not."""
    rotation_rad: Float64 | None = None
    """(3,); rotation from the cursor to the live hand, about D's axes, while aligning."""
    shape_change_m: float | None = None
    """Change of the hand's shape since the cursor, rms, while aligning; measured a few times a
    second."""
    shape_text: str = ""
    """The part that changed most, in words."""
    has_changed: bool = False
    """True if that change exceeds the guard's limit."""
    is_over_limit: bool = False
    """True if the rotation or the change of shape exceeds the guard's limit."""
    segment_ms: float | None = None
    guard_ms: float | None = None
    """Durations of these stages; None if one did not run in this step."""
    contradiction: Contradiction | None = None
    """Evidence that forbids using this frame."""
    needs_delay: bool = False
    """True if no cursor can be made before the wearer has looked around (`DelayMeter`)."""
