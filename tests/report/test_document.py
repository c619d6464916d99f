"""The parts of a report."""

from __future__ import annotations

import pytest

from handcal.report.document import Column, Figure, Report, Section, facts


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


def test_figures_are_found_in_order() -> None:
    sections = [Section("", [figure("b"), "text"]), Section("", [figure("a")])]
    assert [one.name for one in Report("", "", "", sections).figures] == ["b", "a"]


def test_facts_are_a_table_without_head() -> None:
    table = facts({"Wearers": "3"}, "caption")
    assert (table.rows, table.caption) == ([("Wearers", "3")], "caption")
    assert table.columns == [Column("", "left"), Column("", "left")]
