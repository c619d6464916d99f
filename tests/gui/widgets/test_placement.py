from __future__ import annotations

from PySide6.QtCore import QRect
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from handcal_gui.widgets.placement import keep_on_screen, placed, show_on_screen

SCREEN = QRect(0, 24, 1366, 744)


def test_a_frame_is_moved_and_made_smaller_only_as_needed() -> None:
    inside = QRect(100, 100, 600, 400)
    assert placed(inside, SCREEN) == inside
    above = QRect(100, -60, 600, 400)
    assert placed(above, SCREEN) == QRect(100, 24, 600, 400)
    beyond = QRect(1200, 700, 600, 400)
    assert placed(beyond, SCREEN) == QRect(766, 368, 600, 400)
    too_large = QRect(-5, -5, 3000, 2000)
    assert placed(too_large, SCREEN) == SCREEN


def test_a_window_above_the_screen_comes_down(qtbot: QtBot) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    window.setGeometry(20, -200, 300, 200)
    window.show()
    available = window.screen().availableGeometry()
    assert not available.contains(window.frameGeometry())
    keep_on_screen(window)
    qtbot.waitUntil(lambda: available.contains(window.frameGeometry()))


def test_a_window_as_large_as_the_screen_is_maximized(qtbot: QtBot) -> None:
    large, small = QWidget(), QWidget()
    for window in (large, small):
        qtbot.addWidget(window)
    large.resize(large.screen().availableSize())
    small.resize(300, 200)
    for window in (large, small):
        show_on_screen(window)
    assert (large.isMaximized(), small.isMaximized()) == (True, False)


def test_room_is_left_for_a_frame_that_is_not_known_yet(qtbot: QtBot) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    available = window.screen().availableSize()
    window.resize(available)
    assert window.frameGeometry() == window.geometry()
    keep_on_screen(window)
    qtbot.waitUntil(lambda: window.height() == available.height() - 40)
    assert window.width() < available.width()
    assert window.y() == 32, "the title bar is not above the screen"
