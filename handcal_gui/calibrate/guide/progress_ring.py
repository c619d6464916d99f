"""A ring that fills."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from handcal_gui.app.theme import SPACING_PX, colors
from handcal_gui.app.translation import tr

_STEPS = 60
"""The ring is painted again only if it has grown by one of so many parts."""


class ProgressRing(QWidget):
    """Shows a count with its name, and fills with it."""

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(name)
        self.setAccessibleName(tr("Progress"))
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self._text = self._unit = ""
        self._part = 0
        self.set_diameter(9 * SPACING_PX)

    @property
    def text(self) -> str:
        """The upper text inside."""
        return self._text

    def set_diameter(self, diameter_px: int) -> None:
        """Set the size."""
        self.setFixedSize(QSize(diameter_px, diameter_px))

    def show_count(self, done: int, planned: int, unit: str) -> None:
        """Show a count."""
        text = f"{done}/{planned}"
        part = round(_STEPS * done / planned)
        shown = part, text, unit
        if shown != (self._part, self._text, self._unit):
            self._part, self._text, self._unit = shown
            self.setAccessibleDescription(f"{text} {unit}")
            self.update()

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the ring, what has filled of it from the top, and the text."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        width = self.width() / 11
        ring = QRectF(self.rect()).adjusted(width, width, -width, -width)
        faint = QColor(colors().muted)
        faint.setAlphaF(0.3)
        painter.setPen(QPen(faint, width))
        painter.drawEllipse(ring)
        pen = QPen(QColor(colors().good), width)
        pen.setCapStyle(Qt.PenCapStyle.FlatCap)
        painter.setPen(pen)
        painter.drawArc(ring, 90 * 16, -round(360 * 16 * self._part / _STEPS))
        painter.setPen(self.palette().windowText().color())
        upper = ring.adjusted(0, 0, 0, -ring.height() / 4 if self._unit else 0)
        self._write(painter, upper, self._text, self.width() // 4)
        lower = ring.adjusted(1.8 * width, ring.height() / 2.1, -1.8 * width, -ring.height() / 6)
        self._write(painter, lower, self._unit, self.width() // 6)

    def _write(self, painter: QPainter, place: QRectF, text: str, height_px: int) -> None:
        """Write a text in the middle of a place, smaller if it would not fit."""
        font = self.font()
        font.setPixelSize(height_px)
        width_px = QFontMetricsF(font).horizontalAdvance(text)
        if width_px > place.width():
            font.setPixelSize(int(height_px * place.width() / width_px))
        painter.setFont(font)
        painter.drawText(place, Qt.AlignmentFlag.AlignCenter, text)
