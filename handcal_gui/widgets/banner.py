"""A one-line message: a problem until it is solved or closed, a notice for some seconds."""

from __future__ import annotations

import logging

from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QLabel, QToolButton, QWidget

from handcal_gui.app.theme import SPACING_PX, colors, follow_theme, icon
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import paragraph
from handcal_gui.widgets.layouts import hbox
from handcal_gui.widgets.sentence import sentence

_NOTICE_MS = 6000
_LOG = logging.getLogger(__name__)


class Banner(QWidget):
    """Shows the newest message; hidden if there is none.

    A message, which the user must close, takes precedence over a condition, which disappears on
    its own, and a condition over a notice, which reports no problem.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("banner")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._message = ""
        self._condition = ""
        self._notice = ""
        self._notice_end = QTimer(self, interval=_NOTICE_MS, singleShot=True)
        self._notice_end.timeout.connect(self._end_notice)
        self._icon = QLabel()
        self._text = paragraph()
        self._text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        close = QToolButton()
        close.setText(tr("Close (Esc)"))
        close.setObjectName("bannerClose")
        close.setToolTip(tr("Close this message (Esc)"))
        close.clicked.connect(self.clear)
        self._close = close
        hbox(
            self._icon,
            (self._text, 1),
            close,
            on=self,
            margins=(SPACING_PX, SPACING_PX // 2, SPACING_PX, SPACING_PX // 2),
        )
        follow_theme(self, self._refresh)

    @property
    def text(self) -> str:
        """The message shown; empty if there is none."""
        return self._message or self._condition or self._notice

    def show_message(self, text: str) -> None:
        """Show a message until it is closed or replaced, and log it."""
        _LOG.info("%s", text)
        self._message, self._notice = text, ""
        self._refresh()

    def show_notice(self, text: str) -> None:
        """Show for some seconds what is going on; it replaces a message."""
        self._message, self._notice = "", text
        self._notice_end.start()
        self._refresh()

    def show_condition(self, text: str) -> None:
        """Show a present problem, and log it; an empty text removes it."""
        if text != self._condition:
            _LOG.info("%s", text or "the condition has ended")
            self._condition = text
            self._refresh()

    def clear(self) -> None:
        """Close the message or notice."""
        self._message = self._notice = ""
        self._refresh()

    def _end_notice(self) -> None:
        self._notice = ""
        self._refresh()

    def _refresh(self) -> None:
        is_notice = not (self._message or self._condition)
        self._icon.setPixmap(icon("wait" if is_notice else "warning").pixmap(2 * SPACING_PX))
        self._text.setText(sentence(self.text))
        self._close.setVisible(bool(self._message) or is_notice)
        border = colors().muted if is_notice else colors().red
        self.setStyleSheet(f"#banner {{ border: 1px solid {border}; border-radius: 4px; }}")
        self.setVisible(bool(self.text))
