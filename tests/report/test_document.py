"""The parts of a report."""

from __future__ import annotations

import csv
import io
from importlib.metadata import version

import pytest

from handcal.report.cells import (
    extremes,
    interval_ends,
    mean_sd,
    median_quartiles,
    rows_csv,
    signed,
)
from handcal.report.document import (
    Figure,
    Report,
    Section,
    Table,
    at_minute,
    made_with,
    settings_items,
)
from handcal.report.statistics import mean_interval, summarise


def figure(name: str) -> Figure:
    return Figure(name, "", lambda _axes: None, [])


@pytest.mark.parametrize("name", ["", "../x", "a b", "A", "a--b", "a.png", "x\n", "-a"])
def test_a_figures_name_is_one_for_a_file(name: str) -> None:
    with pytest.raises(ValueError, match="lower-case letters, digits and hyphens"):
        figure(name)


def test_no_two_figures_share_a_name() -> None:
    sections = [Section("", [figure("a-1"), "text"]), Section("", [figure("b"), figure("a-1")])]
    with pytest.raises(ValueError, match="more than one figure is named a-1"):
        Report("title", "subject", "lead", sections)


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


def read(content: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(content.decode(), newline="")))


def test_columns_are_all_that_there_are_and_numbers_come_back() -> None:
    content = rows_csv([{"a": 0.1 + 0.2, "b": None}, {"a": 1, "c": 'x, "y"\nz'}])
    first, second = read(content)
    assert list(first) == ["a", "b", "c"]
    assert float(first["a"]) == 0.1 + 0.2
    assert (first["b"], first["c"], second["c"]) == ("", "", 'x, "y"\nz')


def test_columns_may_be_given() -> None:
    assert rows_csv([], ["a", "b"]) == b"a,b\r\n"
    with pytest.raises(ValueError, match="'c'"):
        rows_csv([{"c": 1}], ["a"])


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@x", "\tx", "\rx"])
def test_no_text_is_a_formula(text: str) -> None:
    assert read(rows_csv([{"a": text, "b": -1}]))[0] == {"a": f"'{text}", "b": "-1"}


def test_what_utf8_cannot_hold_is_replaced() -> None:
    assert read(rows_csv([{"a": "\ud800Zoë"}]))[0]["a"] == "?Zoë"


def test_settings_are_flat_and_short() -> None:
    (table,) = settings_items({"a": {"b": 0.1 + 0.2, "c": {}}, "d": ["x" * 500]})
    assert isinstance(table, Table)
    assert table.rows[:2] == [("a.b", "0.3"), ("a.c", "{}")]
    assert table.rows[2][0] == "d"
    assert len(table.rows[2][1]) == 200


def test_too_many_settings_are_counted() -> None:
    table, more = settings_items({str(number): number for number in range(1500)}, "study.json")
    assert isinstance(table, Table)
    assert len(table.rows) == 120
    assert more == "and 1,380 more, in study.json"


def test_versions_and_time_are_told() -> None:
    found = made_with()
    assert f"handcal {version('handcal')}, Python 3" in found["Made with"]
    assert found["Made at"].endswith(" UTC")
    assert at_minute("2026-11-21T09:30:59.123+00:00") == "2026-11-21 09:30 UTC"
