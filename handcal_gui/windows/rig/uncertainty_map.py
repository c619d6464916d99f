"""A map of a solved camera's projection uncertainty over its image."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from handcal.rig.uncertainty import GRID, ProjectionUncertainty
from handcal_gui.theme import SPACING_PX, colors
from handcal_gui.translation import tr

_WIDTH_PX, _HEIGHT_PX = 160, 96
_LARGE_PX = 1.0
"""Uncertainty from which on a cell has its full colour."""


class UncertaintyMap(QWidget):
    """Shows by colour how uncertain the direction of a pixel is in each part of the image.

    Parameters
    ----------
    title : str
        Name of the camera.
    """

    def __init__(self, title: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("uncertainty")
        self.setAccessibleName(tr("Uncertainty, {}").format(title.lower()))
        self.setToolTip(
            tr(
                "Standard deviation of the pixel at which a distant point appears; dark from 1 px "
                "on. Take images with the board in the dark parts. Crossed: not known."
            )
        )
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self._title = title
        self._uncertainty: ProjectionUncertainty | None = None
        self.setFixedSize(_WIDTH_PX + 1, _HEIGHT_PX + 3 * SPACING_PX + 1)

    def show_uncertainty(self, uncertainty: ProjectionUncertainty | None) -> None:
        """Show the uncertainty; None if the camera was not solved."""
        self._uncertainty = uncertainty
        self.setAccessibleDescription(self.caption)
        self.update()

    @property
    def caption(self) -> str:
        """The text above the cells."""
        if self._uncertainty is None:
            return f"{self._title}: –"
        found = self._uncertainty
        return f"{self._title}: ± {found.middle_px:.2f}, {found.edge_px:.2f} px"

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the cells below the caption."""
        painter = QPainter(self)
        painter.setPen(self.palette().windowText().color())
        head = QRectF(0, 0, self.width(), 3 * SPACING_PX)
        painter.drawText(head, Qt.AlignmentFlag.AlignVCenter, self.caption)
        columns, rows = GRID
        painter.setPen(QColor(colors().muted))
        for row in range(rows):
            for column in range(columns):
                corner = QPointF(column * _WIDTH_PX / columns, row * _HEIGHT_PX / rows)
                cell = QRectF(0, 0, _WIDTH_PX / columns, _HEIGHT_PX / rows)
                cell.moveTo(corner + QPointF(0, 3 * SPACING_PX))
                self._paint_cell(painter, cell, row, column)
        painter.end()

    def _paint_cell(self, painter: QPainter, cell: QRectF, row: int, column: int) -> None:
        painter.fillRect(cell, self.palette().base())
        if self._uncertainty is not None:
            sigma_px = float(self._uncertainty.sigma_px[row, column])
            if np.isfinite(sigma_px):
                fill = QColor(colors().live)
                fill.setAlphaF(0.9 * min(1.0, sigma_px / _LARGE_PX))
                painter.fillRect(cell, fill)
            else:
                painter.drawLine(cell.topLeft(), cell.bottomRight())
        painter.drawRect(cell)
