"""A one-line message about a problem, shown until it is solved or closed."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QToolButton, QWidget

from handcal_gui.theme import SPACING_PX, colors, follow_theme, icon
from handcal_gui.translation import tr
from handcal_gui.widgets.fields import paragraph
from handcal_gui.widgets.layouts import hbox
from handcal_gui.widgets.sentence import sentence


class Banner(QWidget):
    """Shows the newest message; hidden if there is none.

    A message, which the user must close, takes precedence over a condition, which ends by itself.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("banner")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._message = ""
        self._condition = ""
        self._icon = QLabel()
        self._text = paragraph()
        self._text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        close = QToolButton(autoRaise=True)
        close.setText(tr("Close"))
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
        return self._message or self._condition

    def show_message(self, text: str) -> None:
        """Show a message until it is closed or replaced."""
        self._message = text
        self._refresh()

    def show_condition(self, text: str) -> None:
        """Show a present problem; an empty text removes it."""
        if text != self._condition:
            self._condition = text
            self._refresh()

    def clear(self) -> None:
        """Close the message."""
        self._message = ""
        self._refresh()

    def _refresh(self) -> None:
        self._icon.setPixmap(icon("warning").pixmap(2 * SPACING_PX))
        self._text.setText(sentence(self.text))
        self._close.setVisible(bool(self._message))
        self.setStyleSheet(f"#banner {{ border: 1px solid {colors().red}; border-radius: 4px; }}")
        self.setVisible(bool(self.text))
