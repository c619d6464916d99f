"""What every part of the offline calibration ends with: whether it may be used, and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

CalibrationVerdictName: TypeAlias = Literal["good", "needs more views", "bad"]


@dataclass(frozen=True, slots=True)
class CalibrationVerdict:
    """Whether a part of the offline calibration may be used, and why."""

    name: CalibrationVerdictName
    reason: str
