"""Messages that are shown for a moment, of what leaves no trace in the window, such as copying."""

from __future__ import annotations

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QAccessible, QAccessibleAnnouncementEvent, QGuiApplication, QPalette
from PySide6.QtWidgets import QFrame, QLabel, QLineEdit, QWidget

from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr

_SHOWN_MS = 3000


class _Brief(QLabel):
    """A message that lies over its window; a tooltip would end as soon as the focus moves."""

    def __init__(self, said: str, window: QWidget) -> None:
        super().__init__(said, window, textFormat=Qt.TextFormat.PlainText)
        self.setObjectName("brief")
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setFrameShape(QFrame.Shape.Box)
        self.setMargin(SPACING_PX // 2)
        self.setAutoFillBackground(True)
        self.setBackgroundRole(QPalette.ColorRole.ToolTipBase)
        self.setForegroundRole(QPalette.ColorRole.ToolTipText)
        end = QTimer(self, singleShot=True, interval=_SHOWN_MS)
        end.timeout.connect(self.deleteLater)
        end.start()


def copy_text(source: QWidget, text: str, said: str) -> None:
    """Copy a text, and say over a widget what was copied."""
    QGuiApplication.clipboard().setText(text)
    show_briefly(source, said)


def limit_length(field: QLineEdit, most: int) -> None:
    """Let a field take so many characters; say so when more are typed or pasted."""
    field.setMaxLength(most)
    said = tr("At most {} characters; the rest is cut off").format(most)
    field.inputRejected.connect(lambda: show_briefly(field, said))


def show_briefly(source: QWidget, said: str) -> None:
    """Say something over a widget for a moment, and to a screen reader; nothing moves."""
    window = source.window()
    for former in window.findChildren(_Brief):
        former.hide()
        former.deleteLater()
    shown = _Brief(said, window)
    shown.resize(shown.sizeHint().boundedTo(window.size()))
    middle = source.mapTo(window, source.rect().center()) - shown.rect().center()
    room = window.size() - shown.size()
    x, y = min(middle.x(), room.width()), min(middle.y(), room.height())
    shown.move(max(x, 0), max(y, 0))
    shown.show()
    QAccessible.updateAccessibility(QAccessibleAnnouncementEvent(source, said))
