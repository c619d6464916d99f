"""Statistics as texts."""

from __future__ import annotations

from handcal.report.cells import extremes, interval_ends, mean_sd, median_quartiles
from handcal.statistics import mean_interval, summarise


def test_texts_are_two_decimals_and_never_broken() -> None:
    summary = summarise([1.0, 2.0, 3.0, 4.0])
    assert mean_sd(summary) == "2.50\u00a0±\u00a01.29"
    assert median_quartiles(summary) == "2.50\u00a0(1.75–3.25)"
    assert extremes(summary) == "1.00–4.00"
    assert interval_ends(mean_interval([-1.0, 1.0])) == "-12.71\u00a0to\u00a012.71"
    assert interval_ends(None) == "–"
