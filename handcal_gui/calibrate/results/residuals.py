"""The residual map of a chosen alignment: the hand from the eye, coloured by residuals."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Signal
from PySide6.QtGui import QResizeEvent, QShowEvent
from PySide6.QtWidgets import QComboBox, QLabel, QWidget

from handcal.core.geometry import transform
from handcal.core.types import Alignment, Eye, EyeShift, Float64
from handcal.register.results import Results
from handcal_gui.app.theme import SPACING_PX, follow_theme
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.parts.residual_scale import LARGEST_MM, OUTLIER, residual_ramp
from handcal_gui.widgets.layouts import vbox
from handcal_gui.widgets.plots import Plot
from handcal_gui.widgets.result_rows import EYE_NAMES

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


class ResidualsTab(QWidget):
    """Shows the residual map of one alignment and eye; drawn only while visible.

    Attributes
    ----------
    shown : Signal(int, str)
        The number of the alignment and the eye whose map is shown.
    """

    shown = Signal(int, str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("residuals")
        self._solved: dict[int, tuple[Alignment, Mapping[Eye, EyeShift]]] = {}
        self._choice = QComboBox()
        self._choice.setObjectName("residuals-choice")
        self._choice.setAccessibleName(tr("Alignment and eye"))
        self._choice.currentIndexChanged.connect(self._show_chosen)
        self._map = ResidualMap()
        note = QLabel(
            tr("The hand as seen from the eye; a magenta × is a point without a partner (outlier).")
        )
        note.setWordWrap(True)
        vbox(self._choice, (self._map, 1), note, on=self, spacing=SPACING_PX)

    def show_results(self, results: Results, alignments: Mapping[int, Alignment]) -> None:
        """Show the first alignment's map, and offer all alignments with available clouds."""
        self._solved = {
            number: (alignments[number], shifts)
            for number, shifts in results.alignments.items()
            if number in alignments
        }
        self._choice.clear()
        for number, (_, shifts) in self._solved.items():
            for eye in shifts:
                name = tr("Alignment {}, {}").format(number, EYE_NAMES[eye].lower())
                self._choice.addItem(name, (number, eye))

    def showEvent(self, event: QShowEvent) -> None:
        """Draw the map chosen while the tab was hidden."""
        super().showEvent(event)
        self._show_chosen()

    def _show_chosen(self) -> None:
        if not self.isVisible():
            return
        chosen = self._choice.currentData()
        if chosen is None:
            self._map.show_residuals(np.empty((0, 2)), np.empty(0))
            return
        number, eye = chosen
        alignment, shifts = self._solved[number]
        hand_E_m = transform(alignment.T_E_W[eye], alignment.hand_m)
        self._map.show_residuals(hand_E_m[:, :2], shifts[eye].residuals_m)
        self.shown.emit(number, eye)
