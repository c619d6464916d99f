"""Blinded comparisons: the offline calibration against the applied φ, as the wearer judges them.

The wearer sees both in a hidden random order, and says which fits the hand better. The order
is in the journal, and only the report shows it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, get_args

from handcal.core.display import as_shifts
from handcal.core.types import Eye, Float64
from handcal.session.journal import Event

Drawing: TypeAlias = Literal["offline", "applied"]
Place: TypeAlias = Literal["first", "second"]
Answer: TypeAlias = Literal["first", "second", "neither"]
COMPARED = "compared"
"""Name of the event."""


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """One answer of the wearer."""

    first: Drawing
    """The drawing that was shown first; the other one was shown second."""
    answer: Answer
    """The one that fits better."""
    applied_shift_m: Mapping[Eye, Float64]
    """each (3,); φ of the drawing *applied*."""
    time: str = ""
    """UTC, ISO 8601; empty before it is saved."""

    @property
    def better(self) -> Drawing | None:
        """The drawing that fits better; None if neither does."""
        if self.answer == "neither":
            return None
        if self.answer == "first":
            return self.first
        return "applied" if self.first == "offline" else "offline"


@dataclass(frozen=True, slots=True)
class ComparisonCounts:
    """Answers of several comparisons."""

    applied: int
    offline: int
    neither: int
    p_value: float
    """Two-sided sign test of *applied* against *offline*; 1 without either. Answers of one wearer
    say nothing about other wearers."""


def comparison_json(comparison: Comparison) -> dict[str, Any]:
    """Return the data of the event of a comparison."""
    shifts_m = {eye: shift_m.tolist() for eye, shift_m in comparison.applied_shift_m.items()}
    return {"first": comparison.first, "answer": comparison.answer, "applied_shift_m": shifts_m}


def read_comparisons(events: Iterable[Event]) -> list[Comparison]:
    """Return the comparisons of a session's events; those that lack something are left out."""
    found = []
    for event in events:
        first: Any = event.data.get("first")
        answer: Any = event.data.get("answer")
        is_sound = first in get_args(Drawing) and answer in get_args(Answer)
        if event.name != COMPARED or not is_sound:
            continue
        with suppress(KeyError, TypeError, ValueError, AttributeError):
            shifts_m = as_shifts(event.data["applied_shift_m"])
            found.append(Comparison(first, answer, shifts_m, event.time))
    return found


def count_comparisons(comparisons: Iterable[Comparison]) -> ComparisonCounts:
    """Return how often each drawing was the better one."""
    better = [one.better for one in comparisons]
    applied, offline = better.count("applied"), better.count("offline")
    return ComparisonCounts(applied, offline, better.count(None), sign_test(applied, offline))


def sign_test(first: int, second: int) -> float:
    """Return the two-sided p-value of two counts that are equally likely by chance, exactly."""
    total = first + second
    tail = sum(math.comb(total, k) for k in range(min(first, second) + 1))
    return float(min(1.0, 2 * tail / 2**total))
