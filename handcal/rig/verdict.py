"""The verdict on a part of the offline calibration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

CalibrationVerdictName: TypeAlias = Literal["good", "needs more views", "bad"]


@dataclass(frozen=True, slots=True)
class CalibrationVerdict:
    """A verdict on a part of the offline calibration, with its reason; a bad part is not used."""

    name: CalibrationVerdictName
    reason: str
