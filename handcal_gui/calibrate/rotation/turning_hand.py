"""A drawing of a hand as its wearer sees it, with an arrow for the direction to turn it."""

from __future__ import annotations

from functools import cache

import numpy as np
from PySide6.QtCore import QLineF, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import (
    QColor,
    QPainter,
    QPainterPath,
    QPainterPathStroker,
    QPaintEvent,
    QPen,
    QPolygonF,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from handcal.core.types import Float64
from handcal_gui.app.theme import colors
from handcal_gui.app.translation import tr

# The drawing is 200 units wide and high; its origin is the centre of the hand.
_FINGERS = ((-16, 10, -50, -14), (-21, 0, -33, -52), (-7, -4, -11, -68), (7, -4, 10, -64),
            (20, 2, 29, -44))  # fmt: skip
_PALM = QRectF(-27, -14, 54, 54)
_WRIST = QRectF(-18, 30, 36, 50)
_RADIUS = 78.0
_ARROW_DEG = 70.0
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


class TurningHand(QWidget):
    """Shows a hand; `show_turn` adds an axis and an arrow."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("turning-hand")
        self.setAccessibleName(tr("Direction to turn the hand"))
        self.setToolTip(tr("Direction to turn the hand, as the wearer sees it"))
        self.setMinimumSize(80, 72)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self._turn = ("", False)

    def sizeHint(self) -> QSize:
        """Prefer a square."""
        return QSize(150, 150)

    def show_turn(self, axis: str, *, positive: bool = True) -> None:
        """Show a rotation about an axis of the depth camera, or none.

        Parameters
        ----------
        axis : {"x", "y", "z", ""}
            Right, down and away from the wearer.
        positive : bool
            By the right-hand rule about the axis.
        """
        if (axis, positive) != self._turn:
            self._turn = axis, positive
            self.update()

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw circle and axis, the hand over them, and the arrow on top."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        side = min(self.width(), self.height())
        painter.translate(self.width() / 2, self.height() / 2)
        painter.scale(side / 200, side / 200)
        axis, positive = self._turn
        muted = QColor(colors().muted)
        if axis:
            painter.setPen(QPen(muted, 2, Qt.PenStyle.DashLine))
            painter.drawPolyline(_on_screen(_circle(axis, 0.0, 360.0)))
            painter.drawPolyline(_on_screen(np.outer([-95.0, 95.0], _AXES[axis])))
        fill = QColor(muted)
        fill.setAlphaF(0.45)
        painter.setPen(QPen(muted, 2))
        painter.setBrush(fill)
        painter.drawPath(_hand())
        if axis:
            _paint_arrow(painter, axis, positive, self.palette().windowText().color())


def _paint_arrow(painter: QPainter, axis: str, positive: bool, color: QColor) -> None:
    end_deg = _ARROW_DEG if positive else -_ARROW_DEG
    bend = _on_screen(_circle(axis, -end_deg, end_deg))
    painter.setPen(QPen(color, 9, c=Qt.PenCapStyle.FlatCap, j=Qt.PenJoinStyle.RoundJoin))
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawPolyline(bend)
    direction = QLineF(bend[-3], bend[-1]).unitVector()
    along = QPointF(direction.dx(), direction.dy())
    across = QPointF(-along.y(), along.x())
    tip = bend[-1]
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(color)
    painter.drawPolygon(QPolygonF([tip + along * 20, tip + across * 15, tip - across * 15]))


def _circle(axis: str, from_deg: float, to_deg: float) -> Float64:
    """Return an arc about an axis, (49, 3); 0° is nearest the wearer, or at the top for z."""
    start = np.array([0.0, -1.0, 0.0] if axis == "z" else [0.0, 0.0, -1.0])
    quarter_on = np.cross(_AXES[axis], start)
    angles = np.radians(np.linspace(from_deg, to_deg, 49))[:, None]
    return np.asarray(_RADIUS * (np.cos(angles) * start + np.sin(angles) * quarter_on))


def _on_screen(points: Float64) -> list[QPointF]:
    """Project obliquely: points farther from the wearer are higher and more to the right."""
    return [QPointF(x + 0.3 * z, y - 0.25 * z) for x, y, z in points.tolist()]


@cache
def _hand() -> QPainterPath:
    """Return the outline of a right hand, seen from its back."""
    bones = QPainterPath()
    for x0, y0, x1, y1 in _FINGERS:
        bones.moveTo(x0, y0)
        bones.lineTo(x1, y1)
    flesh = QPainterPathStroker()
    flesh.setWidth(12)
    flesh.setCapStyle(Qt.PenCapStyle.RoundCap)
    palm = QPainterPath()
    palm.addRoundedRect(_PALM, 14, 14)
    wrist = QPainterPath()
    wrist.addRect(_WRIST)
    return flesh.createStroke(bones).united(palm).united(wrist).simplified()
