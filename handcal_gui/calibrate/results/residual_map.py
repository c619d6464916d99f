"""The hand seen from the eye, each point coloured by its residual."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QWidget

from handcal.core.types import Float64
from handcal_gui.app.theme import follow_theme
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.parts.residual_scale import LARGEST_MM, OUTLIER, residual_ramp
from handcal_gui.widgets.plots import Plot

_SHADES = 32
_POINTS_ACROSS = 130
"""A hand has about as many points across a large map, beside one another."""


class ResidualMap(Plot):
    """Shows residuals in colour; points without a partner are crosses.

    Attributes
    ----------
    scatters : tuple of 2 pyqtgraph.ScatterPlotItem
        Inliers and outliers, mm.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            "residual-map", tr("Residual map"), tr("Right (mm)"), tr("Down (mm)"), parent
        )
        self._shown = np.empty((0, 2)), np.empty(0)
        self.scatters = (
            pg.ScatterPlotItem(size=4, pen=None),
            pg.ScatterPlotItem(size=5, symbol="x"),
        )
        self._bar = pg.ColorBarItem(
            values=(0.0, LARGEST_MM), width=14, interactive=False, label=tr("Residual (mm)")
        )
        item = self.item
        item.setAspectLocked()
        item.invertY()
        for scatter in reversed(self.scatters):
            item.addItem(scatter)
        item.layout.addItem(self._bar, 2, 5)
        follow_theme(self, self._redraw)

    def show_residuals(self, places_m: Float64, residuals_m: Float64) -> None:
        """Show points.

        Parameters
        ----------
        places_m : (N, 2) float64
            Right and down, as seen from the eye.
        residuals_m : (N,) float64
            NaN for points without a partner.
        """
        self._shown = places_m, residuals_m
        self._redraw()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Draw the points as large as the map has room for."""
        super().resizeEvent(event)
        least_px = min(self.width(), self.height()) // _POINTS_ACROSS
        for scatter, smallest_px in zip(self.scatters, (4, 5), strict=True):
            scatter.setSize(max(smallest_px, least_px))

    def _redraw(self) -> None:
        places_m, residuals_m = self._shown
        is_outlier = np.isnan(residuals_m)
        palette = pg.ColorMap(None, residual_ramp())
        self._bar.setColorMap(palette)
        for side in ("left", "right"):
            self._bar.getAxis(side).setTextPen(self.palette().windowText().color())
        shades = [pg.mkBrush(c) for c in palette.getLookupTable(0.0, 1.0, _SHADES)]
        shade = (_SHADES / LARGEST_MM * 1e3 * residuals_m[~is_outlier]).astype(int)
        inliers, outliers = self.scatters
        inliers.setData(
            pos=1e3 * places_m[~is_outlier], brush=[shades[min(i, _SHADES - 1)] for i in shade]
        )
        outliers.setData(pos=1e3 * places_m[is_outlier], pen=OUTLIER)
