"""Numbers and statistics as texts."""

from __future__ import annotations

import pytest

from handcal.report.cells import extremes, interval_ends, mean_sd, median_quartiles, signed
from handcal.report.statistics import mean_interval, summarise


@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [(1.25, 2, "+1.25"), (-3.06, 1, "−3.1"), (-0.04, 1, "+0.0"), (-0.0, 0, "+0")],
)
def test_sign(value: float, decimals: int, text: str) -> None:
    assert signed(value, decimals) == text


def test_texts_are_two_decimals_and_never_broken() -> None:
    summary = summarise([1.0, 2.0, 3.0, 4.0])
    assert mean_sd(summary) == "2.50\u00a0±\u00a01.29"
    assert median_quartiles(summary) == "2.50\u00a0(1.75–3.25)"
    assert extremes(summary) == "1.00–4.00"
    assert interval_ends(mean_interval([-1.0, 1.0])) == "−12.71\u00a0to\u00a012.71"
    assert interval_ends(None) == "–"
