"""A map of a solved camera's projection uncertainty over its image."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QRectF
from PySide6.QtGui import QPainter

from handcal.rig.lens.uncertainty import GRID, ProjectionUncertainty
from handcal_gui.app.translation import tr
from handcal_gui.rig.coverage_map import CellMap, shade

_LARGE_PX = 1.0
"""Uncertainty from which on a cell has its full colour."""


class UncertaintyMap(CellMap):
    """Shows by colour how uncertain the direction of a pixel is in each part of the image."""

    def __init__(self, title: str) -> None:
        super().__init__(title, GRID)
        self.setObjectName("uncertainty")
        self.setAccessibleName(tr("Uncertainty, {}").format(title.lower()))
        self.setToolTip(
            tr(
                "Standard deviation of the pixel at which a distant point appears; dark from 1 px "
                "on. Take images with the board in the dark parts. Crossed: not known."
            )
        )
        self._uncertainty: ProjectionUncertainty | None = None

    def show_uncertainty(self, uncertainty: ProjectionUncertainty | None) -> None:
        """Show the uncertainty; None if the camera was not solved."""
        self._uncertainty = uncertainty
        self.refresh()

    @property
    def caption(self) -> str:
        """The text above the cells."""
        if self._uncertainty is None:
            return f"{self._title}: –"
        found = self._uncertainty
        return f"{self._title}: ± {found.middle_px:.2f}, {found.edge_px:.2f} px"

    def paint_cell(self, painter: QPainter, cell: QRectF, row: int, column: int) -> None:
        """Draw the uncertainty there."""
        if self._uncertainty is None:
            return
        sigma_px = float(self._uncertainty.sigma_px[row, column])
        if np.isfinite(sigma_px):
            shade(painter, cell, 0.9 * min(1.0, sigma_px / _LARGE_PX))
        else:
            painter.drawLine(cell.topLeft(), cell.bottomRight())
