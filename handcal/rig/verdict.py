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

    def unless_few(self, views: int, asked: int, of: str) -> CalibrationVerdict:
        """Return this verdict, or that more views are needed if a good one is of too few."""
        if self.name != "good" or views >= asked:
            return self
        reason = f"{views} {of}, take {asked} or more; {self.reason}"
        return CalibrationVerdict("needs more views", reason)
