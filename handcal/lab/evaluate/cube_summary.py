"""A cube test in numbers: each error over all pairs of captures, for each way of drawing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from handcal.lab.evaluate.cube_test import CubeRow
from handcal.report.statistics import MeanInterval, Summary, mean_interval, summarise


@dataclass(frozen=True, slots=True)
class ErrorSummary:
    """One error over all pairs."""

    spread: Summary
    interval: MeanInterval | None
    """Of the mean; positions of the camera count as independent, as each has its own calibration.
    None of a single position."""


def cube_summary(rows: Sequence[CubeRow]) -> dict[str, dict[str, ErrorSummary]]:
    """Return each error's summary by name, for each way of drawing."""
    by_drawn: dict[str, list[CubeRow]] = {}
    for row in rows:
        by_drawn.setdefault(str(row["drawn"]), []).append(row)
    return {
        drawn: {name: _summarise(group, name) for name in group[0] if name.startswith("err_")}
        for drawn, group in by_drawn.items()
    }


def _summarise(rows: Sequence[Mapping[str, float | int | str]], name: str) -> ErrorSummary:
    values = [float(row[name]) for row in rows]
    positions = [row["position"] for row in rows]
    several = len(set(positions)) > 1
    return ErrorSummary(summarise(values), mean_interval(values, positions) if several else None)
