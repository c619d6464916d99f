from __future__ import annotations

import pytest
from pytestqt.qtbot import QtBot

from handcal.lab.evaluate.cube_folder import CapturePlan
from handcal_gui.evaluate.capture_list import CaptureList

CAPTURES = CapturePlan(positions=("a",), poses=2).captures  # of five images


@pytest.fixture
def shown(qtbot: QtBot) -> CaptureList:
    shown = CaptureList()
    qtbot.addWidget(shown)
    return shown


def test_each_image_is_listed_with_its_state(shown: CaptureList) -> None:
    shown.show_captures(CAPTURES, CAPTURES[3:])
    model = shown.model()
    cells = [[model.index(row, column).data() for column in range(2)] for row in range(5)]
    assert cells[0] == ["a/grid", "taken"]
    assert cells[3] == ["a/pose-2/real", "missing"]
    assert [state for _, state in cells].count("missing") == 2


@pytest.mark.parametrize(
    ("chosen", "missing", "following"),
    [(-1, (0, 1), 0), (0, (1, 2), 1), (1, (1, 2), 1), (2, (0, 4), 4), (4, (1, 2), 1)],
)
def test_the_next_missing_image_is_chosen(
    shown: CaptureList, chosen: int, missing: tuple[int, ...], following: int
) -> None:
    shown.show_captures(CAPTURES, CAPTURES)
    shown.setCurrentIndex(shown.model().index(chosen, 0))
    shown.show_captures(CAPTURES, [CAPTURES[place] for place in missing])
    assert shown.chosen == CAPTURES[following]
    assert not shown.chosen_is_taken
    assert not shown.is_complete


def test_when_all_are_there_none_is_chosen_but_one_can_be(qtbot: QtBot, shown: CaptureList) -> None:
    assert not shown.is_complete
    shown.show_captures(CAPTURES, ())
    assert shown.is_complete
    assert shown.chosen is None
    with qtbot.waitSignal(shown.chosen_changed):
        shown.setCurrentIndex(shown.model().index(2, 0))
    assert shown.chosen == CAPTURES[2]
    assert shown.chosen_is_taken
