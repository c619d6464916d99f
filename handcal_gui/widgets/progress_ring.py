"""A ring that fills."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from handcal_gui.theme import SPACING_PX, colors
from handcal_gui.translation import tr

_STEPS = 60
"""The ring is painted again only if it has grown by one of so many parts."""


class ProgressRing(QWidget):
    """Shows a share from 0 to 1, or none, and a short text inside."""

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(name)
        self.setAccessibleName(tr("Progress"))
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self._text = ""
        self._part: int | None = None
        self.set_diameter(8 * SPACING_PX)

    @property
    def share(self) -> float | None:
        """The share shown."""
        return None if self._part is None else self._part / _STEPS

    @property
    def text(self) -> str:
        """The text inside."""
        return self._text

    def set_diameter(self, diameter_px: int) -> None:
        """Set the size."""
        self.setFixedSize(QSize(diameter_px, diameter_px))
        font = self.font()
        font.setPixelSize(diameter_px // 4)
        self.setFont(font)

    def show_share(self, share: float | None, text: str) -> None:
        """Show a share and a text."""
        part = None if share is None else round(_STEPS * share)
        if (part, text) != (self._part, self._text):
            self._part, self._text = part, text
            filled = "" if part is None else f", {100 * part // _STEPS} %"
            self.setAccessibleDescription(f"{text}{filled}")
            self.update()

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the ring, what has filled of it from the top, and the text."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        width = self.width() / 9
        ring = QRectF(self.rect()).adjusted(width, width, -width, -width)
        faint = QColor(colors().muted)
        faint.setAlphaF(0.3)
        painter.setPen(QPen(faint, width))
        painter.drawEllipse(ring)
        if self._part:
            pen = QPen(QColor(colors().live), width)
            pen.setCapStyle(Qt.PenCapStyle.FlatCap)
            painter.setPen(pen)
            painter.drawArc(ring, 90 * 16, -round(360 * 16 * self._part / _STEPS))
        painter.setPen(self.palette().windowText().color())
        painter.drawText(ring, Qt.AlignmentFlag.AlignCenter, self._text)
