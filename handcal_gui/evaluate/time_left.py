"""Remaining time, estimated from elapsed time and progress."""

from __future__ import annotations

import time
from collections.abc import Callable

from handcal_gui.app.translation import tr

_MINUTE_S = 60.0


class TimeLeft:
    """An estimate of the remaining time from the share done.

    Parameters
    ----------
    begun : float
        Share that was already complete at the start.
    clock : callable
        Returns the time in seconds.
    """

    def __init__(self, begun: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._begun = begun
        self._clock = clock
        self._start_s = clock()

    def at(self, share: float) -> str:
        """Return the remaining time in words; empty until there is progress."""
        if share <= self._begun:
            return ""
        elapsed_s = self._clock() - self._start_s
        left_s = elapsed_s * (1.0 - share) / (share - self._begun)
        if left_s < _MINUTE_S:
            return tr("less than a minute left")
        hours, minutes = divmod(round(left_s / _MINUTE_S), 60)
        if hours:
            return tr("about {} h {} min left").format(hours, minutes)
        return tr("about {} min left").format(minutes)
