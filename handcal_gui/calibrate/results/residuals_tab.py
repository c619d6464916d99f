"""The residuals tab: the residual map of a chosen alignment."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from PySide6.QtCore import Signal
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QComboBox, QLabel, QWidget

from handcal.core.geometry import transform
from handcal.core.types import Alignment, Eye, EyeShift
from handcal.register.results import Results
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.results.residual_map import ResidualMap
from handcal_gui.widgets.layouts import vbox
from handcal_gui.widgets.result_rows import EYE_NAMES


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
