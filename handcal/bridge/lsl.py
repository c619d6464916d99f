"""Lab Streaming Layer: the calibration's events as markers, to line up with other recordings.

docs/bridges.md lists the events.
"""

from __future__ import annotations

import json
import time
from typing import Any

import numpy as np

from handcal.core.errors import HandcalError, extra_advice
from handcal.station.snapshot import Snapshot

STREAM_NAME = "handcal"
STREAM_TYPE = "Markers"
_MOST_WAITING = 1000

Marker = tuple[str, float]
"""JSON text, and its time on the host's monotonic clock in seconds."""


class LslOutput:
    """Sends each event as one JSON text on an irregular string stream; implements `Output`.

    Parameters
    ----------
    source_id : str
        Identity of the stream, so that a recorder finds it again after a restart.

    Raises
    ------
    HandcalError
        If pylsl or its library is not installed.
    """

    name = "Lab Streaming Layer"
    capacity = _MOST_WAITING

    def __init__(self, source_id: str = STREAM_NAME) -> None:
        try:
            import pylsl
        except (ImportError, RuntimeError) as error:  # the latter without the library liblsl
            raise HandcalError("Lab Streaming Layer needs pylsl", extra_advice("lsl")) from error
        self._clock = pylsl.local_clock
        info = pylsl.StreamInfo(STREAM_NAME, STREAM_TYPE, 1, 0.0, pylsl.cf_string, source_id)
        self._outlet: Any = pylsl.StreamOutlet(info)
        self._before: Snapshot | None = None

    def take(self, snapshot: Snapshot) -> list[Marker] | None:
        """Return the events between the last snapshot and this one; None if there are none."""
        before, self._before = self._before, snapshot
        return [
            (json.dumps(event, separators=(",", ":")), snapshot.t_host_ns * 1e-9)
            for event in events(before, snapshot)
        ] or None

    def send(self, item: list[Marker]) -> None:
        """Send markers with their times on LSL's clock."""
        ahead_s = self._clock() - time.monotonic()
        for text, t_host_s in item:
            self._outlet.push_sample([text], t_host_s + ahead_s)

    def close(self) -> None:
        """Close the stream."""
        self._outlet = None


def events(before: Snapshot | None, now: Snapshot) -> list[dict[str, object]]:
    """Return the JSON-able events that happened between two snapshots of a station."""
    found: list[dict[str, object]] = []
    new, old = now.procedure, None if before is None else before.procedure

    def add(event: str, **values: object) -> None:
        found.append({"event": event, **values})

    if before is None:
        add("session", name=now.session_path.name)
    if old is None or new.state is not old.state:
        add("state", state=new.state.value, eyes=list(new.eyes))
    step, last = now.next_step, None if before is None else before.next_step
    if step is not None and (last is None or (step.name, step.eyes) != (last.name, last.eyes)):
        add("step", step=step.name.value, eyes=list(step.eyes))
    if before is None or old is None:
        return found
    if now.record.refused > before.record.refused:
        add("refused", reason=new.refusal)
    for number in now.record.alignments.keys() - before.record.alignments.keys():
        alignment = now.record.alignments[number]
        add("confirmed", number=number, eyes=list(alignment.eyes))
    for eye, verification in now.record.facts.verified.items():
        if before.record.facts.verified.get(eye) is not verification:
            add("verified", eye=eye)
    if now.record is not before.record:
        for number in now.record.trials.keys() - before.record.trials.keys():
            trial = now.record.trials[number]
            add("trial", number=number, eye=trial.eye, depth_m=trial.target_depth_m)
    if new.results is not None and new.results is not old.results:
        for eye, shift in new.results.eyes.items():
            verdict = new.results.verdicts[eye].name
            add("solved", eye=eye, phi_m=shift.shift_m.tolist(), verdict=verdict)
    for eye, shift_m in new.applied_shift_m.items():
        was_m = old.applied_shift_m.get(eye)
        # Between two frames a φ may be both sent and acknowledged.
        is_same = was_m is not None and np.array_equal(shift_m, was_m)
        if new.is_applied and not (old.is_applied and is_same):
            add("applied", eye=eye, phi_m=shift_m.tolist())
    return found
