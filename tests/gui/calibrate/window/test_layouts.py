"""Layouts of the docks: the room that they leave the guide, and those that are restored."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, QSize, Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from handcal_gui.calibrate.window import MainWindow
from tests.gui.calibrate.window.conftest import is_in_front, shown


def settle(window: MainWindow) -> None:
    """Wait until the panels have shared the room of a new size."""
    children_only = Qt.FindChildOption.FindDirectChildrenOnly
    timers = window.findChildren(QTimer, options=children_only)
    QApplication.processEvents()  # the size arrives
    while any(one.isActive() for one in timers):
        QApplication.processEvents()
    for _ in range(3):  # a layout may ask for another
        QApplication.processEvents()


def guide_px(window: MainWindow) -> int:
    settle(window)
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


def sizes(window: MainWindow) -> dict[str, object]:
    settle(window)
    return {name: one.geometry() for name, one in window.docks.items() if is_in_front(window, name)}


def drag_guide(window: MainWindow, by_px: int) -> None:
    """Drag the splitter between the left panels and the guide."""
    camera = window.docks["camera"].geometry()
    start = QPoint(camera.right() + 3, camera.center().y())
    left, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    QTest.mousePress(window.windowHandle(), left, none, start)
    for share in (0.5, 1.0):
        QTest.mouseMove(window.windowHandle(), start + QPoint(round(share * by_px), 0))
        QApplication.processEvents()
    QTest.mouseRelease(window.windowHandle(), left, none, start + QPoint(by_px, 0))


def test_a_window_made_smaller_or_larger_is_divided_as_by_default(window: MainWindow) -> None:
    window.show_page("live")
    small, large = QSize(1280, 690), QSize(1920, 1050)
    default = {}
    for size in (small, large):
        window.resize(size)
        window.reset_layout()
        default[size] = sizes(window)
    for size in (small, large):
        window.resize(size)
        assert sizes(window) == default[size]


def test_a_guide_that_was_dragged_narrower_stays_so(window: MainWindow) -> None:
    window.resize(1280, 690)
    window.show_page("live")
    default_px = guide_px(window)
    drag_guide(window, 120)
    camera_px = window.docks["camera"].width()
    assert guide_px(window) == default_px - 120
    window.resize(1280, 700)
    assert guide_px(window) == default_px - 120
    window.resize(1400, 700)
    assert guide_px(window) == default_px, "the guide has all new room"
    assert window.docks["camera"].width() == camera_px
    window.show_page("start")
    window.resize(1280, 690)
    window.restore_layouts(window.layouts())
    window.show_page("live")
    assert guide_px(window) == default_px - 120
    window.resize(1250, 690)
    assert 0 <= guide_px(window) - (default_px - 120) <= 2, "no narrower, and hardly wider"
    window.resize(1280, 690)
    window.reset_layout()
    assert guide_px(window) == default_px


@pytest.mark.parametrize("text", ["", "garbage", "AAAA"])
def test_a_layout_that_does_not_fit_is_left_out(window: MainWindow, text: str) -> None:
    window.restore_layouts({"live": text})
    window.show_page("live")
    assert shown(window) == set(window.docks)


def test_a_window_made_small_has_tabs_and_columns_again_once_it_is_large(
    window: MainWindow,
) -> None:
    window.resize(1600, 1000)
    window.show_page("live")
    window.docks["link"].close()
    window.docks["cloud"].widget().setFocus()
    for size_px, is_small in (((960, 540), True), ((1600, 1000), False)):
        window.resize(*size_px)
        assert guide_px(window) >= 500
        assert is_in_front(window, "cloud"), "it has the keyboard focus"
        assert not window.docks["link"].toggleViewAction().isChecked(), "the user closed it"
        assert bool(window.tabifiedDockWidgets(window.docks["camera"])) is is_small
