"""Convergence of each alignment's registration."""

from __future__ import annotations

import numpy as np
from PySide6.QtWidgets import QWidget

from handcal.core.types import EyeShift
from handcal.register.results import Results
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.widgets.plots import Plot
from handcal_gui.widgets.result_rows import EYE_NAMES

_TO_POINTS, _TO_SURFACE = tr("Point RMS (mm)"), tr("Surface RMS (mm)")
_MEANINGS = {
    _TO_POINTS: tr(
        "Distance from the hand's points to their partners on the cursor at each iteration\n"
        "of each alignment, root mean square."
    ),
    _TO_SURFACE: tr(
        "Distance from the hand's points to the cursor's surface, along its normals, at each\n"
        "iteration of each alignment, root mean square. It is less than the Point RMS\n"
        "among the numbers of each eye, which is to single points of the cursor."
    ),
}
_SYMBOLS = {"left": "o", "right": "s"}
_MAX_SYMBOLS = 60
_MOST_FOR_NAMES = 0.6
"""Of the width."""
_TEXT_HEIGHT = 0.08
"""Of a name, as a share of the plot's height."""


class ConvergencePlot(Plot):
    """Shows the distance between hand and cursor by iteration, for each alignment and eye."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("convergence", tr("Convergence"), tr("Iteration"), _TO_POINTS, parent)
        self.show_legend()
        self._longest = 1
        self.item.vb.sigResized.connect(self._leave_room)

    def show_results(self, results: Results) -> None:
        """Replace the lines; each ends in its alignment's name."""
        self.clear()
        ends: list[tuple[float, int]] = []
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
                ends.append((float(rms_mm[-1]), number))
        solved = [shift for eyes in results.alignments.values() for shift in eyes.values()]
        measure = _TO_SURFACE if any(map(_is_to_surface, solved)) else _TO_POINTS
        self.item.setLabel("left", measure)
        self.setToolTip(_MEANINGS[measure])
        histories = [shift.history_m2 for shift in solved]
        self._longest = longest = max(map(len, histories), default=1)
        largest_mm = 1e3 * max((float(np.sqrt(max(one))) for one in histories), default=1e-3)
        self._name(sorted(ends), _TEXT_HEIGHT * largest_mm)
        self._leave_room()
        self.item.setYRange(0.0, 1.1 * largest_mm)
        spacing = max(1, longest // 5)
        self.item.getAxis("bottom").setTickSpacing(spacing, spacing)

    def _leave_room(self) -> None:
        """Show the iterations, with space for the longest name at their end."""
        room_px = self.item.vb.width()
        text_px = self.widest_text_px + 3 * SPACING_PX
        share = min(text_px / max(room_px, 1.0), _MOST_FOR_NAMES)
        self.item.setXRange(1, 1 + (self._longest - 1 or 1) / (1.0 - share), padding=0.03)

    def _name(self, ends: list[tuple[float, int]], height_mm: float) -> None:
        """Name the alignments beside the ends of their lines, in one text for those that adjoin."""
        while ends:
            beside = [one for one in ends if one[0] - ends[0][0] <= height_mm]
            text = _names(sorted({number for _, number in beside}))
            # Right of all lines, because one that goes on would cross the name.
            self.add_text(text, self._longest, float(np.mean([y_mm for y_mm, _ in beside])))
            ends = ends[len(beside) :]


def _is_to_surface(shift: EyeShift) -> bool:
    """Return whether an alignment's history was measured along normals, unlike its RMS."""
    is_rms = np.isclose(shift.history_m2[-1], shift.rms_m**2, rtol=1e-6, atol=0.0)
    return shift.method == "consistent" and not is_rms


def _names(numbers: list[int]) -> str:
    """Return *Alignment 1*, *Alignments 1, 2*, or *Alignments 1–5*."""
    if len(numbers) == 1:
        return tr("Alignment {}").format(numbers[0])
    is_row = len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1
    text = f"{numbers[0]}–{numbers[-1]}" if is_row else ", ".join(map(str, numbers))
    return tr("Alignments {}").format(text)
