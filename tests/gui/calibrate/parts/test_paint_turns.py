from __future__ import annotations

from PySide6.QtCore import QEvent, QObject
from PySide6.QtGui import QPaintEvent
from PySide6.QtWidgets import QHBoxLayout, QWidget
from pytestqt.qtbot import QtBot
from shiboken6 import delete

from handcal_gui.calibrate.parts.paint_turns import update_in_turn
from tests.gui.helpers import show


class _Picture(QWidget):
    def __init__(self, name: str, log: list[str]) -> None:
        super().__init__()
        self._name, self._log = name, log

    def paintEvent(self, _: QPaintEvent) -> None:
        self._log.append(self._name)


class _Passes(QObject):
    """Notes each pass in which a window paints what has changed."""

    def __init__(self, log: list[str]) -> None:
        super().__init__()
        self._log = log

    def eventFilter(self, _: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.UpdateRequest:
            self._log.append("pass")
        return False


def test_pictures_updated_together_are_painted_in_passes_of_their_own(qtbot: QtBot) -> None:
    log: list[str] = []
    window, pictures = QWidget(), [_Picture(name, log) for name in ("first", "second", "third")]
    layout = QHBoxLayout(window)
    for picture in pictures:
        layout.addWidget(picture)
    show(qtbot, window, 300, 100)
    qtbot.waitUntil(lambda: "third" in log)
    passes = _Passes(log)
    window.installEventFilter(passes)
    log.clear()
    for picture in (*pictures, pictures[0]):
        update_in_turn(picture)
    qtbot.waitUntil(lambda: "third" in log)
    assert log == ["pass", "first", "pass", "second", "pass", "third"]


def test_a_picture_that_is_gone_holds_up_no_other(qtbot: QtBot) -> None:
    log: list[str] = []
    gone, left = _Picture("gone", log), show(qtbot, _Picture("left", log), 100, 100)
    qtbot.waitUntil(lambda: "left" in log)
    log.clear()
    update_in_turn(gone)
    update_in_turn(left)
    delete(gone)
    qtbot.waitUntil(lambda: log == ["left"])
