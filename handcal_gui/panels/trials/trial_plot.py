"""A plot of trial errors over the target's distance."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from PySide6.QtWidgets import QWidget

from handcal.display import TARGET_DEPTHS_M
from handcal.session.trial import Trial, TrialStatistics
from handcal.types import EYES, Eye, Float64
from handcal_gui.translation import tr
from handcal_gui.widgets.plots import Plot
from handcal_gui.widgets.result_rows import EYE_NAMES

_SIGNS: dict[Eye, tuple[str, float]] = {"left": ("o", -0.012), "right": ("t1", 0.012)}
"""Symbol, and an offset in metres so that the eyes do not hide each other."""
_MEDIAN_HALF_WIDTH_M = 0.025
_MARGIN_M = 0.05


class TrialPlot(Plot):
    """Shows each corner of each trial, and the median at each distance."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            "errors-of-trials",
            tr("Errors of trials"),
            tr("Distance of the target (m)"),
            tr("Error (′)"),
            parent,
        )
        self.item.getAxis("bottom").setTicks([[(m, f"{m:g}") for m in TARGET_DEPTHS_M]])
        self.item.setXRange(min(TARGET_DEPTHS_M) - _MARGIN_M, max(TARGET_DEPTHS_M) + _MARGIN_M)
        self.show_legend()
        self._median = self.add_line("muted", name=tr("Median"))
        self._errors = {
            eye: self.add_line(eye, name=EYE_NAMES[eye], symbol=_SIGNS[eye][0]) for eye in EYES
        }

    def show_trials(self, trials: Collection[Trial], statistics: TrialStatistics) -> None:
        """Show trials with their statistics."""
        for eye, line in self._errors.items():
            seen = [trial for trial in trials if trial.eye == eye]
            at_m = [np.full(4, trial.target_depth_m + _SIGNS[eye][1]) for trial in seen]
            line.setData(
                *_unjoined(np.ravel(at_m), np.ravel([trial.error_arcmin for trial in seen]), 1)
            )
        depths_m = np.array(list(statistics.by_depth_m))
        ends_m = np.add.outer(depths_m, (-_MEDIAN_HALF_WIDTH_M, _MEDIAN_HALF_WIDTH_M)).ravel()
        medians = [errors.arcmin.median for errors in statistics.by_depth_m.values()]
        largest = max((float(trial.error_arcmin.max()) for trial in trials), default=1.0)
        self.item.setYRange(0.0, 1.1 * max(largest, 1.0), padding=0.0)
        self._median.setData(*_unjoined(ends_m, np.repeat(medians, 2), 2))


def _unjoined(x: Float64, y: Float64, length: int) -> tuple[Float64, Float64]:
    """Insert NaN after every `length` points, where pyqtgraph interrupts the line."""
    after = np.arange(length, len(x) + 1, length)
    return np.insert(x, after, np.nan), np.insert(y, after, np.nan)
