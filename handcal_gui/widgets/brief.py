"""Messages that are shown for a moment, of what leaves no trace in the window, such as copying."""

from __future__ import annotations

from PySide6.QtGui import QAccessible, QAccessibleAnnouncementEvent, QCursor, QGuiApplication
from PySide6.QtWidgets import QToolTip, QWidget

from handcal_gui.widgets.fields import plain_tooltip

_SHOWN_MS = 3000


def copy_text(source: QWidget, text: str, said: str) -> None:
    """Copy a text, and say beside a widget what was copied."""
    QGuiApplication.clipboard().setText(text)
    show_briefly(source, said)


def show_briefly(source: QWidget, said: str) -> None:
    """Say something beside a widget for a moment, and to a screen reader; nothing moves."""
    pointer = source.mapFromGlobal(QCursor.pos())
    place = pointer if source.rect().contains(pointer) else source.rect().center()
    QToolTip.showText(
        source.mapToGlobal(place), plain_tooltip(said), source, source.rect(), _SHOWN_MS
    )
    QAccessible.updateAccessibility(QAccessibleAnnouncementEvent(source, said))
