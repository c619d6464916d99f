"""States and settings of the calibration procedure."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from handcal.core.errors import HandcalError
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
