"""Selection of the views of a moving board."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from handcal.core.geometry import image_points, rigid, transform
from handcal.core.types import Intrinsics
from handcal.rig.boards.board import Board, BoardView, corners_m
from handcal.rig.boards.choose import ChooseSettings, ViewSelector, variety

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


def test_views_are_counted_by_distance_and_tilt_without_intrinsics() -> None:
    """The measured tilts differ from the true ones by less than 5° up to the image's edge."""
    board = Board(squares=(8, 6))
    camera = Intrinsics(640, 360, 502.0, 502.0, 319.5, 179.5, (0.0,) * 5)
    points_m = corners_m(board)
    centred = rigid(None, -points_m.mean(axis=0))
    views: dict[tuple[float, float], list[BoardView]] = {}
    for turn_deg, depth_m in product((0.0, 15.0, 25.0, 40.0), (0.25, 0.40, 0.60)):
        for side in (-0.25, 0.0, 0.25):
            facing = rigid([0.0, np.arctan(side), 0.0])  # towards the camera
            turn = facing @ rigid([0.0, np.radians(turn_deg), 0.0])
            T_C_B = rigid(None, [side * depth_m, 0.0, depth_m]) @ turn @ centred
            pixels = image_points(transform(T_C_B, points_m), camera)
            ids = np.arange(len(points_m))
            seen = BoardView(points_m, pixels, (camera.width, camera.height), ids, 2.0)
            views.setdefault((turn_deg, depth_m), []).append(seen)
    for (turn_deg, depth_m), some in views.items():
        near, far, tilted = variety(some, board)
        assert (near, far) == (3 * (depth_m < 0.3), 3 * (depth_m > 0.5))
        assert tilted == 3 * (turn_deg > 20)
    assert variety([], board) == (0, 0, 0)
