"""The results of an evaluation."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtWidgets import QLabel, QTabWidget
from pytestqt.qtbot import QtBot

from handcal.report.document import Column, Report, Section, Table
from handcal_gui.windows.evaluation.results_view import ResultsView
from handcal_gui.windows.evaluation.work import Outcome
from tests.gui.helpers import child, show


@pytest.mark.parametrize(
    ("captions", "titles"),
    [
        (("offline, 20 pairs of captures", "solved, 19 pairs of captures"), ["Offline", "Solved"]),
        (("By distance.", "In space."), ["By distance", "In space"]),
        (("left, 1", "left, 2"), ["Numbers 1", "Numbers 2"]),
        (("", "In space."), ["Numbers 1", "Numbers 2"]),
        (("offline, 20 pairs of captures",), ["Numbers"]),
    ],
)
def test_a_tab_says_what_its_numbers_are_of(
    qtbot: QtBot, captions: tuple[str, ...], titles: list[str]
) -> None:
    tables = [Table([Column("a"), Column("b")], [("1", "2")], one) for one in captions]
    view = show(qtbot, ResultsView(), 500, 400)
    view.show_outcome(Outcome(Path(), Report("", "", "", [Section("", tables)]), []))
    tabs = child(view, QTabWidget)
    assert [tabs.tabText(place) for place in range(tabs.count())] == titles


def test_the_text_of_an_empty_view_is_no_greyed_control(qtbot: QtBot) -> None:
    view = show(qtbot, ResultsView(), 500, 400)
    assert child(view, QLabel, "noResults").isEnabled()
