"""A colour scale for depth images."""

from __future__ import annotations

import cv2
import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QImage, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from handcal.core.types import Float64, UInt8, UInt16
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr

NEAREST_M, FARTHEST_M = 0.2, 1.0
_HOLE = (10, 10, 12)
_GREY = 0.8
"""Share of grey in the colours beyond the depth gate."""
_BAR_PX = 12


class DepthColors:
    """Colours from `NEAREST_M` to `FARTHEST_M`, bright to dark; grey beyond the gate, holes black.

    Parameters
    ----------
    gate_m : (float, float)
        Range of depths in which a hand is looked for.
    """

    def __init__(self, gate_m: tuple[float, float]) -> None:
        self.gate_m = gate_m
        self._levels = _levels(gate_m)
        self._scale_m = 0.0
        self._level_of_depth = np.zeros(65536, np.uint8)

    def set_scale(self, depth_scale_m: float) -> None:
        """Set the size of a unit of depth in metres."""
        if depth_scale_m != self._scale_m:
            self._scale_m = depth_scale_m
            self._level_of_depth = _level(depth_scale_m * np.arange(65536.0))
            self._level_of_depth[0] = 0

    def colorize(self, depth: UInt16) -> UInt8:
        """Return (h, w, 3) RGB of a (h, w) depth image."""
        levels = cv2.LUT(depth, self._level_of_depth[None])
        return np.asarray(cv2.applyColorMap(levels, self._levels[:, None]), np.uint8)

    def ramp(self) -> UInt8:
        """Return (255, 3) RGB from the nearest to the farthest."""
        return self._levels[1:]


def _level(depth_m: Float64) -> UInt8:
    """Return depths as levels 1 to 255."""
    part = (depth_m - NEAREST_M) / (FARTHEST_M - NEAREST_M)
    return np.asarray(1.5 + 254.0 * np.clip(part, 0.0, 1.0 - 1e-9), np.uint8)


def _levels(gate_m: tuple[float, float]) -> UInt8:
    """Return (256, 3) RGB of all levels, holes first."""
    # The darkest fifth of the map is reserved for holes.
    steps = np.linspace(255.0, 50.0, 255).astype(np.uint8)
    ramp = cv2.applyColorMap(steps[:, None], cv2.COLORMAP_VIRIDIS)[:, 0, ::-1].astype(float)
    grey = ramp.mean(axis=1, keepdims=True)
    depth_m = np.linspace(NEAREST_M, FARTHEST_M, 255)[:, None]
    is_gated = (depth_m >= gate_m[0]) & (depth_m <= gate_m[1])
    ramp = np.where(is_gated, ramp, _GREY * grey + (1.0 - _GREY) * ramp)
    return np.vstack([_HOLE, ramp]).astype(np.uint8)


class DepthLegend(QWidget):
    """The scale, with the limits of the gate marked."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colors: DepthColors | None = None
        self.setObjectName("depth-legend")
        self.setAccessibleName(tr("Scale of depth"))
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Expanding)
        width_px = self.fontMetrics().horizontalAdvance("0.00 m")
        self.setFixedWidth(_BAR_PX + SPACING_PX + width_px)

    def show_colors(self, depth_colors: DepthColors) -> None:
        """Show the scale of some colours."""
        self._colors = depth_colors
        low_m, high_m = depth_colors.gate_m
        self.setToolTip(
            tr(
                "Depth in metres. A hand is looked for from {:.2f} to {:.2f} m (colour). "
                "Grey: nearer or farther. Black: not measured."
            ).format(low_m, high_m)
        )
        self.update()

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the bar from near, at the top, to far, with its marks."""
        if self._colors is None:
            return
        painter = QPainter(self)
        line_px = self.fontMetrics().height()
        bar = QRectF(0, line_px / 2, _BAR_PX, self.height() - line_px)
        ramp = np.ascontiguousarray(self._colors.ramp())
        painter.drawImage(bar, QImage(ramp.data, 1, len(ramp), 3, QImage.Format.Format_RGB888))
        painter.setPen(QPen(self.palette().windowText().color(), 1))
        for depth_m in (NEAREST_M, *self._colors.gate_m, FARTHEST_M):
            part = (depth_m - NEAREST_M) / (FARTHEST_M - NEAREST_M)
            y = bar.top() + part * bar.height()
            painter.drawLine(QPointF(0, y), QPointF(_BAR_PX + SPACING_PX / 2, y))
            where = QRectF(_BAR_PX + SPACING_PX, y - line_px / 2, self.width(), line_px)
            painter.drawText(where, Qt.AlignmentFlag.AlignVCenter, f"{depth_m:.2f} m")
