"""Versions and settings."""

from __future__ import annotations

from importlib.metadata import version

from handcal.report.document import Table
from handcal.report.provenance import at_minute, made_with, settings_items


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
