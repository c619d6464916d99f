"""Windows that lie on the screen."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget


def keep_on_screen(window: QWidget) -> None:
    """Move a window that has grown onto its screen, and make it no larger than that."""
    room, frame = window.screen().availableGeometry(), window.frameGeometry()
    window.resize(window.size().boundedTo(room.size()))
    left, top = room.right() + 1 - frame.width(), room.bottom() + 1 - frame.height()
    window.move(max(room.left(), min(window.x(), left)), max(room.top(), min(window.y(), top)))
