"""Windows that lie on the screen with their frames and title bars."""

from __future__ import annotations

from PySide6.QtCore import QMargins, QRect, QTimer
from PySide6.QtWidgets import QWidget

_FRAME_PX = QMargins(8, 32, 8, 8)
"""Room for edges and title bar, which a window manager adds only after the window is shown."""


def show_on_screen(window: QWidget) -> None:
    """Show a window, maximized if it is as large as the screen."""
    available = window.screen().availableGeometry()
    highest_px = available.marginsRemoved(_FRAME_PX).height()
    fills = window.width() >= available.width() or window.height() > highest_px
    if fills and window.isWindow():
        window.showMaximized()
    else:
        window.show()
    keep_on_screen(window)


def keep_on_screen(window: QWidget) -> None:
    """Move a window onto the screen, and make it smaller if needed, with its frame."""
    has_frame = window.frameGeometry() != window.geometry()
    if not (has_frame or window.isMaximized() or window.isFullScreen()):
        room = window.screen().availableGeometry().marginsRemoved(_FRAME_PX)
        # Not `move`, which is of the frame: with none yet, the title bar ended above the screen.
        window.setGeometry(placed(window.geometry(), room))
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
