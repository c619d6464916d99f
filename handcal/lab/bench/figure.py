"""Measured figures with their targets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class BenchFigure:
    """One measured number."""

    what: str
    value: float
    unit: str
    """Unit; empty for a ratio."""
    at_least: float | None = None
    at_most: float | None = None
    """Target limits; None if there is none on that side."""

    def to_json(self) -> dict[str, Any]:
        """Return the figure, its target as text, and whether it is met (None without target)."""
        bounds = []
        if self.at_least is not None:
            bounds.append((f"≥ {self.at_least:g}", self.value >= self.at_least))
        if self.at_most is not None:
            bounds.append((f"≤ {self.at_most:g}", self.value <= self.at_most))
        return {
            "what": self.what,
            "value": self.value,
            "unit": self.unit,
            "target": ", ".join(text for text, _ in bounds),
            "met": all(met for _, met in bounds) if bounds else None,
        }
