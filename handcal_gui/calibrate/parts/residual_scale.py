"""Colours of residuals, and their scale."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QLineF, QRectF, Qt
from PySide6.QtGui import QColor, QLinearGradient, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from handcal.core.types import Float64, UInt8
from handcal_gui.app.theme import SPACING_PX, colors, is_dark
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.parts.splat import rgb

_VIRIDIS = (
    *("#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b"),
    "#fde725",
)
"""Matplotlib's map without its darkest colour."""
_BAR_PX = 12


def residual_ramp() -> UInt8:
    """Return (N, 3) RGB from 0 to the end of the scale, in increasing contrast with the canvas."""
    ramp = np.array([rgb(stop) for stop in _VIRIDIS], np.uint8)
    return ramp[2:] if is_dark() else ramp[-2::-1]  # without what hardly differs from the canvas


def residual_colors(residuals_m: Float64, reach_m: float) -> UInt8:
    """Return (N, 3) RGB of distances on a scale from 0 to `reach_m`."""
    ramp = residual_ramp()
    place = np.clip(residuals_m / reach_m, 0.0, 1.0) * (len(ramp) - 1)
    shades = np.stack([np.interp(place, np.arange(len(ramp)), c) for c in ramp.T], axis=1)
    return shades.astype(np.uint8)


def fill_with_ramp(painter: QPainter, where: QRectF) -> None:
    """Fill a rectangle with the colours of residuals, from 0 at its left."""
    gradient = QLinearGradient(where.topLeft(), where.topRight())
    ramp = residual_ramp().tolist()
    for i, color in enumerate(ramp):
        gradient.setColorAt(i / (len(ramp) - 1), QColor(*color))
    painter.fillRect(where, gradient)


def draw_crosses(painter: QPainter, places_px: Float64, reach_px: float) -> None:
    """Draw outliers, (N, 2): muted crosses, as most of them are at the wrist, where that is right.

    The hand is cut there, in each cloud at another place.
    """
    painter.setPen(QColor(colors().muted))
    for slope in (-1.0, 1.0):
        arm_px = np.array([reach_px, slope * reach_px])
        ends = np.hstack([places_px - arm_px, places_px + arm_px])
        painter.drawLines([QLineF(*end) for end in ends.tolist()])


class ResidualScale(QWidget):
    """A colour scale from 0, and the cross of points without a partner."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("residual-scale")
        self.setAccessibleName(tr("Scale of residuals"))
        self.setToolTip(
            tr(
                "Distance of each point of the hand from its partner on the cursor after "
                "registration, in millimetres; outliers have no partner"
            )
        )
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setFixedHeight(max(_BAR_PX, self.fontMetrics().height()))
        self._reach_m = 0.0

    def show_reach(self, reach_m: float) -> None:
        """Show a scale that ends at this residual."""
        self._reach_m = reach_m
        self.update()

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the bar between its limits, and then the cross of outliers."""
        painter = QPainter(self)
        width_of = painter.fontMetrics().horizontalAdvance
        high, outlier = f"≥ {1e3 * self._reach_m:.1f} mm", tr("Outlier")
        low = tr("Residual 0")
        gap, top = SPACING_PX / 2, (self.height() - _BAR_PX) / 2
        swatch = QRectF(self.width() - width_of(outlier) - gap - _BAR_PX, top, _BAR_PX, _BAR_PX)
        left = width_of(low) + gap
        bar = QRectF(left, top, swatch.x() - width_of(high) - 5 * gap - left, _BAR_PX)
        fill_with_ramp(painter, bar)
        draw_crosses(painter, np.array([swatch.center().toTuple()]), _BAR_PX / 2 - 1)
        painter.setPen(self.palette().windowText().color())
        for x, text in ((0.0, low), (bar.right() + gap, high), (swatch.right() + gap, outlier)):
            where = QRectF(x, 0, self.width(), self.height())
            painter.drawText(where, Qt.AlignmentFlag.AlignVCenter, text)
