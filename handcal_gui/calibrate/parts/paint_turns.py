"""Slow pictures painted one after the other, so that the window answers between them."""

from __future__ import annotations

from functools import cache

from PySide6.QtCore import QCoreApplication, QTimer
from PySide6.QtWidgets import QWidget
from shiboken6 import isValid


def update_in_turn(widget: QWidget) -> None:
    """Have a widget painted soon, in a pass of the event loop of its own.

    Widgets that are updated at the same time are painted in the same pass, which keeps the window
    from answering until the last of them is done.
    """
    _turns().add(widget)


class _Turns(QTimer):
    """Updates one waiting widget in each pass."""

    def __init__(self) -> None:
        # Unlike `singleShot`, a timer waits until what was updated before has been painted.
        super().__init__(QCoreApplication.instance(), interval=0)
        self._waiting: list[QWidget] = []
        self.timeout.connect(self._update_next)

    def add(self, widget: QWidget) -> None:
        if widget not in self._waiting:
            self._waiting.append(widget)
            self.start()

    def _update_next(self) -> None:
        widget = self._waiting.pop(0)
        if not self._waiting:
            self.stop()
        if isValid(widget):
            widget.update()


@cache
def _turns() -> _Turns:
    return _Turns()
