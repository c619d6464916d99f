"""Windows that lie on the screen with their frames and title bars."""

from __future__ import annotations

from PySide6.QtCore import QRect, QTimer
from PySide6.QtWidgets import QWidget

FRAME_PX = 40
"""Height that a title bar may take, which is not known before the window is shown."""


def show_on_screen(window: QWidget) -> None:
    """Show a window, maximized if it is as large as the screen."""
    available = window.screen().availableGeometry()
    fills = window.width() >= available.width() or window.height() > available.height() - FRAME_PX
    if fills and window.isWindow():
        window.showMaximized()
    else:
        window.show()
    keep_on_screen(window)


def keep_on_screen(window: QWidget) -> None:
    """Move a window onto the screen, and make it smaller if needed, once it has its frame."""
    QTimer.singleShot(0, window, lambda: _place(window))


def placed(frame: QRect, available: QRect) -> QRect:
    """Return where a frame lies within the available part of the screen, no larger than it."""
    inside = QRect(frame)
    inside.setSize(frame.size().boundedTo(available.size()))
    inside.moveLeft(
        min(max(frame.left(), available.left()), available.right() - inside.width() + 1)
    )
    inside.moveTop(min(max(frame.top(), available.top()), available.bottom() - inside.height() + 1))
    return inside


def _place(window: QWidget) -> None:
    if window.isMaximized() or window.isFullScreen():
        return
    frame = window.frameGeometry()
    inside = placed(frame, window.screen().availableGeometry())
    if inside != frame:
        window.resize(window.size() - (frame.size() - inside.size()))
        window.move(inside.topLeft())
