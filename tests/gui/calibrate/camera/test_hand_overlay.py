from __future__ import annotations

from itertools import pairwise

import numpy as np
from PySide6.QtGui import QColor, QImage, QPainter
from pytestqt.qtbot import QtBot

from handcal.core.types import UInt8
from handcal.hand.overlay import contour_px
from handcal_gui.calibrate.camera.hand_overlay import HandOverlay, contour_runs
from tests.gui.conftest import Shots

SQUARE_PX = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])


def test_a_contour_without_cuts_is_one_closed_line() -> None:
    (line_px, is_cut), *rest = contour_runs(SQUARE_PX, np.zeros(4, bool))
    assert not rest
    assert not is_cut
    np.testing.assert_array_equal(line_px, [*SQUARE_PX, SQUARE_PX[0]])


def test_a_contour_is_split_where_cuts_begin_and_end() -> None:
    runs = contour_runs(SQUARE_PX, np.array([True, False, True, True]))
    assert [is_cut for _, is_cut in runs] == [False, True]
    np.testing.assert_array_equal(runs[0][0], SQUARE_PX[[0, 1, 2]])
    np.testing.assert_array_equal(runs[1][0], SQUARE_PX[[2, 3, 0]])


def test_every_edge_is_drawn_once() -> None:
    rng = np.random.default_rng(0)
    points_px = rng.random((60, 2))
    runs = contour_runs(points_px, rng.random(60) < 0.6)
    assert sum(len(line_px) - 1 for line_px, _ in runs) == 60
    for (before_px, before_cut), (after_px, after_cut) in pairwise(runs):
        assert before_cut != after_cut
        np.testing.assert_array_equal(before_px[-1], after_px[0])


def draw(shots: Shots, *, is_red: bool, shift_px: tuple[int, int] = (0, 0)) -> UInt8:
    """Return the RGB of the live hand on white."""
    cloud = shots.live.cloud
    depth_px, _ = contour_px(cloud, shots.frame)
    picture = QImage(1280, 720, QImage.Format.Format_RGB32)
    picture.fill(QColor("white"))
    painter = QPainter(picture)
    HandOverlay(cloud, depth_px, depth_px + np.array(shift_px), is_red).draw(painter)
    painter.end()
    return np.frombuffer(picture.bits(), np.uint8).reshape(720, 1280, 4)[..., 2::-1].copy()


def test_the_mask_is_tinted_where_it_is(shots: Shots, qtbot: QtBot) -> None:
    inside = shots.live.cloud.mask == 255
    tinted = draw(shots, is_red=False).min(axis=-1) < 255
    assert tinted[inside].all()
    assert tinted[~inside].mean() < 0.01  # the box and the line


def test_a_picture_from_beside_has_all_of_it_shifted(shots: Shots, qtbot: QtBot) -> None:
    straight = draw(shots, is_red=False).astype(int)
    shifted = draw(shots, is_red=False, shift_px=(30, -10))
    moved_back = np.roll(shifted, (10, -30), axis=(0, 1))
    assert (np.abs(moved_back - straight).max(axis=-1) > 40).mean() < 1e-3
    assert (np.abs(shifted - straight).max(axis=-1) > 40).mean() > 0.01


def test_it_turns_red(shots: Shots, qtbot: QtBot) -> None:
    inside = shots.live.cloud.mask == 255
    blue, red = (draw(shots, is_red=is_red)[inside].mean(axis=0) for is_red in (False, True))
    assert blue[2] > blue[0] + 20
    assert red[0] > red[2] + 20
