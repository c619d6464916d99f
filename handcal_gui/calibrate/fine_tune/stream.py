"""Rate-limited sending of eye shifts set by hand, with their arrival in the headset."""

from __future__ import annotations

import time
from collections.abc import Mapping
from enum import Enum
from typing import TypeAlias

import numpy as np
from PySide6.QtCore import QObject, QTimer, Signal

from handcal.calibration.states import State
from handcal.core.types import Eye, Float64
from handcal.station.snapshot import Snapshot
from handcal_gui.app.translation import tr

Shifts: TypeAlias = Mapping[Eye, Float64]
"""φ of each eye, (3,) float64, metres."""
PERIOD_MS = 33
SETTLE_MS = 700
_LATE_NS = 2_000_000_000
_OBSTACLES = {
    State.ALIGN: tr("Confirm the alignment, solve and apply it first."),
    State.ALIGNED: tr("Solve and apply the alignment first."),
    State.SOLVED: tr("Apply the solved projections first."),
    State.APPLYING: tr("The headset is receiving the solved projections."),
    State.VERIFY: tr("An eye is being verified; confirm or skip that first."),
}


class Arrival(Enum):
    """The state of the last φ sent to the headset."""

    SENDING = "sending"
    ARRIVED = "arrived"
    LATE = "late"


class ShiftStream(QObject):
    """Sends the newest shifts, and distinguishes them from shifts sent by others.

    Attributes
    ----------
    sent : Signal(object)
        Shifts to render with; at most 30 times a second.
    settled : Signal()
        The last shifts sent should be stored: unchanged for 0.7 s.
    arrival : Arrival
        As of the last snapshot seen.
    """

    sent = Signal(object)
    settled = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._pace = _timer(self, PERIOD_MS)
        self._pace.timeout.connect(self._send)
        self._calm = _timer(self, SETTLE_MS)
        self._calm.timeout.connect(self.settled)
        self.begin()

    def begin(self) -> None:
        """Begin with another session: its shifts were sent by others, also if they are the same."""
        self._pace.stop()
        self._calm.stop()
        self.arrival = Arrival.SENDING
        self._newest: Shifts = {}
        self._sent_ns = 0
        self._seen_since = 1  # nothing was sent that the first snapshot may not show yet

    def send(self, shifts_m: Shifts) -> None:
        """Send shifts to be stored, unless others follow soon."""
        self.preview(shifts_m)
        self._calm.start()

    def preview(self, shifts_m: Shifts) -> None:
        """Send shifts only for comparison."""
        self._newest = shifts_m
        if not self._pace.isActive():
            self._pace.start()

    def flush(self) -> None:
        """Send waiting shifts and store them now."""
        if self._pace.isActive():
            self._pace.stop()
            self._send()
        if self._calm.isActive():
            self._calm.stop()
            self.settled.emit()

    def see(self, snapshot: Snapshot) -> bool:
        """Process the headset's present shifts; return whether they were sent by others."""
        procedure = snapshot.procedure
        self._seen_since += snapshot.t_host_ns > self._sent_ns
        # The engine may have been processing the first of them when this was requested.
        is_answered = not self._pace.isActive() and self._seen_since > 1
        if is_answered and procedure.is_applied:
            self.arrival = Arrival.ARRIVED
        else:
            is_late = snapshot.t_host_ns - self._sent_ns > _LATE_NS
            self.arrival = Arrival.LATE if is_late else Arrival.SENDING
        if not is_answered or is_same_shifts(self._newest, procedure.applied_shift_m):
            return False
        self._newest = procedure.applied_shift_m
        self._calm.stop()
        return True

    def _send(self) -> None:
        self._sent_ns, self._seen_since = time.monotonic_ns(), 0
        self.sent.emit(self._newest)


def is_same_shifts(one: Shifts, other: Shifts) -> bool:
    """Return whether both hold the same eyes with the same φ."""
    return set(one) == set(other) and all(np.array_equal(one[eye], other[eye]) for eye in one)


def _timer(parent: QObject, interval_ms: int) -> QTimer:
    timer = QTimer(parent)
    timer.setSingleShot(True)
    timer.setInterval(interval_ms)
    return timer


def find_obstacle(snapshot: Snapshot) -> str:
    """Return the reason why φ cannot be set by hand now; empty if it can."""
    if not snapshot.link.connected:
        return tr("The headset is not connected; see Link.")
    if snapshot.comparing is not None:  # which a change would end
        return tr("The wearer compares two drawings: answer in Trials, or stop comparing.")
    return _OBSTACLES.get(snapshot.procedure.state, "")
