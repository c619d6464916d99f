"""A label for a changing number that does not shift its neighbours."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QLabel

from handcal_gui.app.theme import number_font

UNKNOWN = "–"


class NumberLabel(QLabel):
    """A right-aligned number in tabular digits, as wide as its widest text; a dash at first.

    A QLabel recomputes all enclosing layouts, up to the window's, with every new text, which takes
    as long as painting an image. This label does so only if its text is wider than any before.

    Parameters
    ----------
    name : str
        Object name.
    widest : str
        The widest expected text, with its unit.
    tooltip : str
        Meaning of the number.
    scale : float
        Size of the digits relative to other text.
    """

    def __init__(self, name: str, widest: str, tooltip: str, scale: float = 1.0) -> None:
        super().__init__(UNKNOWN)
        self._text = UNKNOWN
        self.setObjectName(name)
        self.setToolTip(tooltip)
        self.setFont(number_font(scale))
        self.setMinimumWidth(self.fontMetrics().horizontalAdvance(widest))
        self.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)

    def text(self) -> str:
        """Return the text shown."""
        return self._text

    def setText(self, text: str) -> None:
        """Show a number with its unit."""
        if text == self._text:
            return
        self._text = text
        self.setAccessibleName(text)
        self.setMinimumWidth(max(self.minimumWidth(), self.fontMetrics().horizontalAdvance(text)))
        self.update()

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the text like a QLabel."""
        self.style().drawItemText(
            QPainter(self),
            self.contentsRect(),
            self.alignment().value,
            self.palette(),
            self.isEnabled(),
            self._text,
            self.foregroundRole(),
        )
