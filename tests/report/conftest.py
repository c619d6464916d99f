from __future__ import annotations

from collections.abc import Sequence

import pytest
from matplotlib.axes import Axes

from handcal.report.document import Column, Figure, FigureRow, Report, Section, Table, facts

ROWS: list[FigureRow] = [
    {"angle_deg": 0, "error_mm": 1.5, "method": "paper"},
    {"angle_deg": 9, "error_mm": None},
]


def draw(axes: Sequence[Axes]) -> None:
    for ax in axes:
        ax.plot([0, 9], [1.5, 2.5])
        ax.set_xlabel("angle, °")


@pytest.fixture
def report() -> Report:
    """Return a report with every kind of item."""
    table = Table([Column("method", "left"), Column("mean, mm")], [["paper", "1.50"]], "In mm.")
    figures = [Figure(name, f"Of {name}.", draw, ROWS, 50.0, columns=2) for name in ("one", "two")]
    return Report(
        title="Noise study",
        subject="1,000 alignments",
        lead="The paper's method stays below 4 mm up to 9°.",
        sections=[
            Section("", [facts({"Wearers": "3"}), "What was done."]),
            Section("Errors", [table, figures[0]]),
            Section("More", [figures[1]], starts_page=True),
        ],
    )
