"""The border of a board's sheet in depth and in colour, by a camera whose edges are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handcal.core.geometry import rigid
from handcal.core.types import DepthEdges, Float64, Frame
from handcal.rig.boards.board import BoardError
from handcal.rig.depth import MIN_BORDER_VIEWS, border_outside_px, fit_edges
from handcal.sim.boards import BoardPainter
from tests.board_frames import BOARD, COLOR, SENSOR, frames, poses, seen
from tests.fat_hands import beside_truth, fat_hand

PAINTER = BoardPainter(BOARD, COLOR)


def frames_of(count: int, fatten_px: int = 0) -> list[tuple[Float64, Frame]]:
    rng = np.random.default_rng(fatten_px)
    made = poses(count, rng)
    sensor = replace(SENSOR, fatten_px=fatten_px)
    return list(zip(made, frames(made, rng, painter=PAINTER, sensor=sensor), strict=True))


def edges_of_boards(fatten_px: int) -> DepthEdges:
    rng = np.random.default_rng(7)
    found = fit_edges(
        [border_outside_px(seen(T_D_B, rng), frame) for T_D_B, frame in frames_of(8, fatten_px)]
    )
    assert found is not None
    return found


@pytest.mark.parametrize("fatten_px", [0, 1, 2, 3])
def test_what_boards_tell_is_true_of_hands(fatten_px: int) -> None:
    edges = edges_of_boards(fatten_px)
    assert (edges.source, edges.views) == ("measured", 8)
    assert 0.3 <= edges.sigma_px < 0.35
    of_hands_px = []
    for seed in range(3):
        cloud, _, hand, T_H_hand = fat_hand(seed, fatten_px)
        of_hands_px.append(beside_truth(cloud, hand, T_H_hand).outside_px)
    assert edges.fatten_px == pytest.approx(np.mean(of_hands_px), abs=edges.sigma_px)


def test_a_shift_between_depth_and_color_is_no_fattening() -> None:
    rng = np.random.default_rng(8)
    ((T_D_B, frame),) = frames_of(1, 2)
    right = border_outside_px(view := seen(T_D_B, rng), frame)
    shifted = replace(frame, depth=np.roll(frame.depth, (1, -1), axis=(0, 1)))
    assert border_outside_px(view, shifted) == pytest.approx(right, abs=0.15)


def test_a_border_that_is_not_seen_is_refused() -> None:
    rng = np.random.default_rng(9)
    ((T_D_B, frame),) = frames_of(1)
    view = seen(T_D_B, rng)
    on_table = np.where(frame.depth > 15_000, np.median(frame.depth[150:210, 280:360]), frame.depth)
    elsewhere = frame.T_C_D @ rigid(None, [0.0, 0.0, 0.1])
    assert frame.color is not None
    for other in (
        replace(frame, color=np.full_like(frame.color, 200)),
        replace(frame, depth=on_table.astype(np.uint16)),
    ):
        with pytest.raises(BoardError, match="the border of its sheet is not seen in both"):
            border_outside_px(view, other)
    for other in (
        replace(frame, depth=np.zeros_like(frame.depth)),
        replace(frame, T_C_D=elsewhere),
    ):
        with pytest.raises(BoardError, match="the depth image shows too little of the board"):
            border_outside_px(view, other)
    with pytest.raises(ValueError, match="needs colour"):
        border_outside_px(view, replace(frame, color=None, color_intrinsics=None))


def test_few_views_are_not_enough() -> None:
    assert fit_edges([1.0] * (MIN_BORDER_VIEWS - 1)) is None
