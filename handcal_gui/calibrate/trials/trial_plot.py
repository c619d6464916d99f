"""A plot of trial errors over the target's distance."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from PySide6.QtWidgets import QWidget

from handcal.core.display import TARGET_DEPTHS_M
from handcal.core.types import EYES, Eye, Float64
from handcal.session.trial import Trial, trial_spread
from handcal_gui.app.translation import tr
from handcal_gui.widgets.plots import Plot
from handcal_gui.widgets.result_rows import EYE_NAMES

_SIGNS: dict[Eye, tuple[str, float]] = {"left": ("o", -0.012), "right": ("t1", 0.012)}
"""Symbol, and an offset in metres so that the eyes do not hide each other."""
_MEAN_HALF_WIDTH_M = 0.025
_MARGIN_M = 0.05
_PADDING = 0.1
"""Room above and below what is drawn, as a share of its height."""


class TrialPlot(Plot):
    """Shows each trial, as in the table, and mean ± SD and number of the trials at a distance."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            "errors-of-trials",
            tr("Errors of trials"),
            tr("Distance of the target (m)"),
            tr("Error (′)"),
            parent,
        )
        self.setToolTip(
            tr(
                "The error of each trial, the mean over the target's four corners. At each\n"
                "distance: the mean of the n trials of both eyes, and one standard deviation (SD)\n"
                "of the trials above and below it, but not below 0. A single trial has no SD."
            )
        )
        self.item.setXRange(min(TARGET_DEPTHS_M) - _MARGIN_M, max(TARGET_DEPTHS_M) + _MARGIN_M)
        self.show_legend()
        self._mean = self.add_line("muted", name=tr("Mean ± SD (≥ 0)"))
        self._errors = {
            eye: self.add_line(eye, name=EYE_NAMES[eye], symbol=_SIGNS[eye][0]) for eye in EYES
        }
        self.show_trials({})

    def show_trials(self, trials: Mapping[int, Trial]) -> None:
        """Show a session's trials, by number."""
        for eye, line in self._errors.items():
            seen = [trial for trial in trials.values() if trial.eye == eye]
            at_m = [trial.target_depth_m + _SIGNS[eye][1] for trial in seen]
            errors = [float(trial.error_arcmin.mean()) for trial in seen]
            line.setData(*_unjoined(np.array(at_m), np.array(errors), 1))
        depths_m = sorted({*TARGET_DEPTHS_M, *(one.target_depth_m for one in trials.values())})
        ticks, marks, highest = [], [np.empty((0, 2))], 1.0
        for depth_m in depths_m:
            here = [number for number, one in trials.items() if one.target_depth_m == depth_m]
            name = tr("{:g} (n = {})").format(depth_m, len(here)) if trials else f"{depth_m:g}"
            ticks.append((depth_m, name))
            if here:
                spread = trial_spread(trials, here)
                mean, sd = spread.mean_arcmin, spread.trial_sd_arcmin or 0.0
                highest = max(highest, mean + sd, spread.max_arcmin)
                across = (-_MEAN_HALF_WIDTH_M, _MEAN_HALF_WIDTH_M, 0.0, 0.0)
                up = (mean, mean, max(mean - sd, 0.0), mean + sd)
                marks.append(np.column_stack([np.add(depth_m, across), up]))
        self.item.getAxis("bottom").setTicks([ticks])
        self.item.setYRange(0.0, highest, padding=_PADDING)  # no symbol is cut
        at_m, up_arcmin = np.vstack(marks).T
        self._mean.setData(*_unjoined(at_m, up_arcmin, 2))


def _unjoined(x: Float64, y: Float64, length: int) -> tuple[Float64, Float64]:
    """Insert NaN after every `length` points, where pyqtgraph interrupts the line."""
    after = np.arange(length, len(x) + 1, length)
    return np.insert(x, after, np.nan), np.insert(y, after, np.nan)
