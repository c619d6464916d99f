"""Layouts of the docks: the room that they leave the guide, and those that are restored."""

from __future__ import annotations

import pytest
from PySide6.QtWidgets import QApplication

from handcal_gui.window import MainWindow
from tests.gui.window.conftest import shown


def guide_px(window: MainWindow) -> int:
    for _ in range(3):  # a layout may ask for another
        QApplication.processEvents()
    guide = window.centralWidget()
    assert guide is not None
    return guide.width()


def test_the_guide_keeps_the_width_it_needs_in_a_window_made_narrower(window: MainWindow) -> None:
    window.resize(1600, 1000)
    window.show_page("live")
    camera_px = window.docks["camera"].width()
    window.resize(1280, 720)
    assert guide_px(window) >= 500
    assert window.docks["camera"].width() < camera_px


def test_a_layout_of_a_wider_window_leaves_the_guide_the_width_it_needs(
    window: MainWindow,
) -> None:
    window.resize(1600, 1000)
    window.show_page("live")
    layouts = window.layouts()
    window.show_page("start")
    for size_px, least_px in (((1280, 720), 500), ((1100, 640), 700)):
        window.resize(*size_px)
        window.restore_layouts(layouts)
        window.show_page("live")
        assert guide_px(window) >= least_px
        window.use_arrangement("station")
        window.use_arrangement("panels")
        assert guide_px(window) >= least_px
        window.show_page("start")


@pytest.mark.parametrize("text", ["", "garbage", "AAAA"])
def test_a_layout_that_does_not_fit_is_left_out(window: MainWindow, text: str) -> None:
    window.restore_layouts({"live": text})
    window.show_page("live")
    assert shown(window) == set(window.docks)
