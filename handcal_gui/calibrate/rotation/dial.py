"""The rotation dial: an angle against its limit, readable from two metres."""

from __future__ import annotations

import math

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from handcal_gui.app.theme import colors, number_font
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.parts.paint_turns import update_in_turn

_FROM_DEG, _SPAN_DEG = 210.0, 240.0
"""Start of the scale, counter-clockwise from three o'clock, and its extent clockwise."""
_SCALE_LIMITS = 2.0
"""End of the scale in multiples of the limit, which is thus at the top."""
_WIDEST = 190
"""Maximum width of a line of text; the dial is 200 wide."""
_LEAST_PX = 9.0
"""Smallest readable text, on the screen."""


class RotationDial(QWidget):
    """Large digits within an arc that fills towards the limit, and a symbol and word below."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("rotation-dial")
        self.setAccessibleName(tr("Rotation of the hand"))
        self.setToolTip(tr("Rotation of the hand from the cursor, and its limit"))
        self.setMinimumSize(100, 72)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self._angle_deg: float | None = None
        self._limit_deg = 9.0
        self._word, self._word_is_red = "", False
        self._seen: tuple[object, ...] = ()

    def sizeHint(self) -> QSize:
        """Prefer a square that is readable from across the room."""
        return QSize(220, 220)

    @property
    def is_over(self) -> bool:
        """True if the angle shown exceeds the limit."""
        return self._angle_deg is not None and self._angle_deg > self._limit_deg

    def show_angle(
        self, angle_rad: float | None, limit_rad: float, word: str, *, is_refused: bool = False
    ) -> None:
        """Show an angle and its meaning in a word or two; None if there is no angle.

        The word of what is refused whatever its angle has the colour of too large an angle.
        """
        self._angle_deg = None if angle_rad is None else math.degrees(angle_rad)
        self._limit_deg = math.degrees(limit_rad)
        self._word_is_red = is_refused
        if word != self._word:
            self._word = word
            self.setAccessibleDescription(word)
        seen = self._digits, self.is_over, self._limit_deg, word, is_refused
        if seen != self._seen:  # a tenth of a degree is no wider than the arc's end
            self._seen = seen
            update_in_turn(self)

    @property
    def _digits(self) -> str:
        return "–" if self._angle_deg is None else f"{self._angle_deg:.1f}°"

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the arc, its limit, the digits and the word."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        side = min(self.width(), self.height() * 1.1)
        painter.translate(self.width() / 2, self.height() / 2 + 0.05 * side)
        painter.scale(side / 200, side / 200)
        self._paint_arc(painter)
        text = self.palette().windowText().color()
        fixed, normal = number_font(), self.font()
        _write(painter, fixed, self._digits, -14, 46, self._color())
        limit_size = round(min(max(13.0, _LEAST_PX * 200 / side), 23.0))
        _write(painter, normal, tr("limit {:.1f}°").format(self._limit_deg), 22, limit_size, text)
        color = QColor(colors().red) if self._word_is_red else self._color()
        _write(painter, normal, self._word, 64, 22, color)

    def _color(self) -> QColor:
        if self._angle_deg is None:
            return QColor(colors().muted)
        return QColor(colors().red if self.is_over else colors().live)

    def _paint_arc(self, painter: QPainter) -> None:
        box = QRectF(-84, -84, 168, 168)
        half = -_SPAN_DEG / _SCALE_LIMITS
        track, beyond = QColor(colors().muted), QColor(colors().red)
        track.setAlphaF(0.35)
        beyond.setAlphaF(0.35)
        _arc(painter, box, _FROM_DEG, half, QPen(track, 14))
        _arc(painter, box, _FROM_DEG + half, half, QPen(beyond, 14))
        if self._angle_deg is not None:
            part = min(1.0, self._angle_deg / (_SCALE_LIMITS * self._limit_deg))
            _arc(painter, box, _FROM_DEG, -part * _SPAN_DEG, QPen(self._color(), 14))
        painter.setPen(QPen(self.palette().windowText().color(), 4))
        painter.drawLine(QPointF(0, -94), QPointF(0, -72))


def _arc(painter: QPainter, box: QRectF, from_deg: float, span_deg: float, pen: QPen) -> None:
    pen.setCapStyle(Qt.PenCapStyle.FlatCap)
    painter.setPen(pen)
    painter.drawArc(box, round(16 * from_deg), round(16 * span_deg))


def _write(painter: QPainter, font: QFont, text: str, y: float, size: int, color: QColor) -> None:
    """Write one line centred at a height; smaller if it would be wider than the dial."""
    font.setWeight(QFont.Weight.Bold if size > 20 else QFont.Weight.Normal)
    font.setPixelSize(size)
    painter.setFont(font)
    width = painter.fontMetrics().horizontalAdvance(text)
    if width > _WIDEST:
        font.setPixelSize(int(size * _WIDEST / width))
        painter.setFont(font)
    painter.setPen(color)
    painter.drawText(QRectF(-100, y - 40, 200, 80), Qt.AlignmentFlag.AlignCenter, text)
