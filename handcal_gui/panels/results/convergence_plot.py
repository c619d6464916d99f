"""Convergence of each alignment's registration."""

from __future__ import annotations

import numpy as np
from PySide6.QtWidgets import QWidget

from handcal.register.results import Results
from handcal_gui.translation import tr
from handcal_gui.widgets.plots import Plot
from handcal_gui.widgets.result_rows import EYE_NAMES

_SYMBOLS = {"left": "o", "right": "s"}
_MAX_SYMBOLS = 60
_TEXT_HEIGHT = 0.08
"""Of a number, as a share of the plot's height."""


class ConvergencePlot(Plot):
    """Shows the distance between hand and cursor by iteration, for each alignment and eye."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            "convergence", tr("Convergence"), tr("Iteration"), tr("RMS distance (mm)"), parent
        )
        self.setToolTip(
            tr(
                "RMS distance between matched points of hand and cursor at each iteration\n"
                "of each alignment (1, 2, …). “consistent” measures it along the surface's "
                "normals,\nwhich is less than the RMS in the table."
            )
        )
        self.show_legend()

    def show_results(self, results: Results) -> None:
        """Replace the lines; each ends in its alignment's number."""
        self.clear()
        ends: list[tuple[int, float, int]] = []
        for number, shifts in results.alignments.items():
            for eye, shift in shifts.items():
                rms_mm = 1e3 * np.sqrt(shift.history_m2)
                line = self.add_line(
                    eye,
                    name=EYE_NAMES[eye],
                    dashed=eye == "right",
                    symbol=_SYMBOLS[eye] if len(rms_mm) <= _MAX_SYMBOLS else None,
                )
                line.setData(np.arange(1, len(rms_mm) + 1), rms_mm)
                ends.append((len(rms_mm), float(rms_mm[-1]), number))
        histories = [s.history_m2 for eyes in results.alignments.values() for s in eyes.values()]
        longest = max(map(len, histories), default=1)
        largest_mm = 1e3 * max((float(np.sqrt(max(one))) for one in histories), default=1e-3)
        self._number(sorted(ends), _TEXT_HEIGHT * largest_mm)
        self.item.setXRange(1, 1.1 * longest)  # with space for the numbers
        self.item.setYRange(0.0, 1.1 * largest_mm)
        spacing = max(1, longest // 5)
        self.item.getAxis("bottom").setTickSpacing(spacing, spacing)

    def _number(self, ends: list[tuple[int, float, int]], height_mm: float) -> None:
        """Write the alignments' numbers at the ends of lines, one text for those that adjoin."""
        while ends:
            last, rms_mm, _ = ends[0]
            beside = [one for one in ends if one[0] == last and one[1] - rms_mm <= height_mm]
            numbers = sorted({number for _, _, number in beside})
            self.add_text(
                ", ".join(map(str, numbers)), last, float(np.mean([y for _, y, _ in beside]))
            )
            ends = ends[len(beside) :]
