"""Selection of the views of a moving board."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handcal.rig.board import Board, BoardView, corners_m
from handcal.rig.choose import ChooseSettings, ViewSelector

POINTS_M = corners_m(Board())
IDS = np.arange(len(POINTS_M))


def seen(x_px: float = 0.0, blur_px: float = 2.0, ids: slice = slice(None)) -> BoardView:
    pixels = POINTS_M[:, :2] * 1000.0 + [100.0 + x_px, 100.0]
    return BoardView(POINTS_M[ids], pixels[ids], (1000, 800), IDS[ids], blur_px)


def test_a_board_is_kept_once_it_rests_and_again_elsewhere() -> None:
    selector = ViewSelector()
    said = [selector.consider([seen(x_px)]) for x_px in (0, 1, 2, 300, 301)]
    assert [not why for why in said] == [False, True, False, False, True]
    assert "moves" in said[0]
    assert "like this before" in said[2]
    assert "moves" in said[3]


@pytest.mark.parametrize(
    ("moment", "why"),
    [
        ([None], "not seen"),
        ([seen(), None], "not seen"),
        ([seen(blur_px=6.0)], "blurred"),
        ([seen(), seen(blur_px=6.0)], "blurred"),
        ([seen(x_px=4.0)], "moves"),
    ],
)
def test_what_is_not_kept_is_explained(moment: list[BoardView | None], why: str) -> None:
    selector = ViewSelector()
    selector.consider([seen()])
    assert why in selector.consider(moment)


@pytest.mark.parametrize(
    ("moment", "by"),
    [
        ([None, seen()], " by the depth camera"),
        ([seen(), None], " by the headset camera"),
        ([None, None], " by the depth camera and the headset camera"),
    ],
)
def test_the_cameras_that_do_not_see_the_board_are_named(
    moment: list[BoardView | None], by: str
) -> None:
    selector = ViewSelector(cameras=["depth camera", "headset camera"])
    assert selector.consider(moment).startswith(f"the board is not seen{by}: bring it")


def test_other_corners_of_the_board_are_another_view() -> None:
    selector = ViewSelector()
    for part in (slice(0, 20), slice(30, 54)):
        selector.consider([seen(ids=part)])
        assert selector.consider([seen(ids=part)]) == ""


def test_a_grid_is_kept_as_often_as_asked_for() -> None:
    selector = ViewSelector(ChooseSettings(most=3, apart_share=0.0))
    kept = 0
    while not selector.is_done:
        kept += not selector.consider([replace(seen())])
    assert kept == 3
