"""The error expected at other distances than those of the verdict."""

from __future__ import annotations

import numpy as np
from PySide6.QtWidgets import QWidget

from handcal.register.benefit import DISTANCES_M
from handcal.register.results import Results
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import paragraph
from handcal_gui.widgets.layouts import vbox
from handcal_gui.widgets.plots import Plot
from handcal_gui.widgets.result_rows import EYE_NAMES
from handcal_gui.widgets.table import Row, Table

_MEANING = tr(
    "Expected error in arcminutes; bars and brackets hold 95 %. Dashed: without the calibration. "
    "Only the eye's place is uncertain here: an error of the rig itself comes on top, and matters "
    "most far away."
)
_SYMBOLS = {"left": "o", "right": "s"}
_BESIDE = {"left": -0.01, "right": 0.01}
"""Distance of an eye's bars from their place, so that the eyes' do not hide each other."""


class DistanceTab(QWidget):
    """Shows each eye's error against distance, without the calibration and with it."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.plot = Plot(
            "error-by-distance",
            tr("Error against distance"),
            tr("Distance (m)"),
            tr("Expected error (′)"),
        )
        self.plot.show_legend()
        ticks = [(float(np.log10(one)), f"{one:g}") for one in DISTANCES_M if one not in (0.4, 0.6)]
        self.plot.item.getAxis("bottom").setTicks([ticks])
        self.table = Table("error-by-distance-table", tr("Error against distance"))
        meaning = paragraph("", _MEANING)
        meaning.setContentsMargins(SPACING_PX, 0, SPACING_PX, SPACING_PX // 2)
        vbox((self.plot, 1), (self.table, 1), meaning, on=self, margins=0, spacing=0)

    def show_results(self, results: Results) -> None:
        """Replace the lines and the table."""
        self.plot.clear()
        x = np.log10(DISTANCES_M)
        columns: dict[str, tuple[str, ...]] = {}
        for eye, benefit in results.benefits.items():
            names = tr("{}, without").format(EYE_NAMES[eye]), tr("{}, with").format(EYE_NAMES[eye])
            texts = zip(*(one.texts for one in benefit.by_distance), strict=True)
            columns |= dict(zip(names, texts, strict=True))
            for which in ("without", "after"):
                error, low, high = (
                    [getattr(one, f"{which}{end}_arcmin") for one in benefit.by_distance]
                    for end in ("", "_low", "_high")
                )
                line = self.plot.add_line(
                    eye, name=EYE_NAMES[eye], dashed=which == "without", symbol=_SYMBOLS[eye]
                )
                line.setData(x + _BESIDE[eye], error)
                ends = np.column_stack([low, high, np.full(len(x), np.nan)])
                self.plot.add_line(eye).setData(np.repeat(x + _BESIDE[eye], 3), ends.ravel())
        rows = zip(*columns.values(), strict=True)
        self.table.show_rows(
            list(columns),
            [Row(f"{one:g} m", cells) for one, cells in zip(DISTANCES_M, rows, strict=True)],
        )
