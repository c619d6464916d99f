"""The errors of one wearer's calibrations, one after the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PySide6.QtWidgets import QWidget

from handcal.core.types import EYES, Eye
from handcal.session.library import LibraryEntry
from handcal_gui.app.translation import tr
from handcal_gui.widgets.plots import Plot
from handcal_gui.widgets.result_rows import EYE_NAMES

_MOST_TICKS = 20
_SYMBOLS: dict[Eye, str] = {"left": "o", "right": "t1"}


class TrendPlot(Plot):
    """Shows the expected errors: filled symbols after a verification, hollow ones without it."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            "trend",
            tr("Trend"),
            tr("Calibration of this wearer, oldest first"),
            tr("Expected error (′)"),
            parent,
        )
        self.show_legend()
        self._target = self.add_line("muted", name=tr("Target"), dashed=True)
        self._verified = {
            eye: self.add_line(
                eye, name=tr("{}, verified").format(EYE_NAMES[eye]), symbol=_SYMBOLS[eye]
            )
            for eye in EYES
        }
        self._unverified = {
            eye: self.add_line(
                eye,
                name=tr("{}, not verified").format(EYE_NAMES[eye]),
                dashed=True,
                symbol=_SYMBOLS[eye],
            )
            for eye in EYES
        }

    def show_calibrations(self, entries: Sequence[LibraryEntry]) -> None:
        """Show the solved sessions of one wearer, the oldest first, and the newest target."""
        numbers, count = np.arange(1.0, len(entries) + 1.0), max(len(entries), 2)
        targets = [one.target_arcmin for one in entries if one.target_arcmin is not None][-1:]
        largest = max(1.0, *targets, 0.0)
        self._target.setData([0.8, count + 0.2][: 2 * len(targets)], 2 * targets)
        for eye in EYES:
            outcomes = [entry.eyes.get(eye) for entry in entries]
            verified = [None if one is None else one.remaining_arcmin for one in outcomes]
            unverified = [
                None if one is None or one.remaining_arcmin is not None else one.expected_arcmin
                for one in outcomes
            ]
            for line, errors in ((self._verified, verified), (self._unverified, unverified)):
                known = [np.nan if error is None else error for error in errors]
                largest = max(largest, *(error or 0.0 for error in errors))
                if any(error is not None for error in errors):
                    line[eye].setData(numbers, np.array(known, dtype=np.float64))
                else:
                    line[eye].clear()
        self.item.setYRange(0.0, 1.1 * largest, padding=0.0)
        self.item.setXRange(0.8, count + 0.2)
        ticks = [[(number, f"{number:g}") for number in numbers]]
        self.item.getAxis("bottom").setTicks(ticks if len(entries) <= _MOST_TICKS else None)


def trend_text(wearer: str, count: int) -> str:
    """Return what the plot shows, in a sentence."""
    return tr(
        "{}: {} calibrations, and the error expected after each, verified by the wearer or not"
    ).format(wearer, count)


def calibrations_of(wearer: str, entries: Sequence[LibraryEntry]) -> list[LibraryEntry]:
    """Return the solved sessions of a wearer, the oldest first; none of a wearer without a name.

    A repaired copy counts instead of the session that it was copied from.
    """
    found = [entry for entry in entries if wearer and entry.wearer == wearer and entry.eyes]
    copies = {entry.started: entry for entry in found if entry.is_repaired}
    found = [entry for entry in found if copies.get(entry.started, entry) is entry]
    return sorted(found, key=lambda entry: (entry.started, entry.path.name))
