from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.core.types import EYES
from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.fine_tune.panel import (
    PERIOD_MS,
    SETTLE_MS,
    Shifts,
    ShiftStream,
    is_same_shifts,
)

MakeSnapshot = Callable[..., Snapshot]


def shifts_of(value_m: float) -> Shifts:
    return {eye: np.full(3, value_m) for eye in EYES}


@dataclass
class Engine:
    """Takes what the stream sends."""

    sent: list[Shifts] = field(default_factory=list)
    events: list[str] = field(default_factory=list)

    def send(self, shifts_m: Shifts) -> None:
        self.sent.append(shifts_m)
        self.events.append("sent")

    def store(self) -> None:
        self.events.append("settled")


@pytest.fixture
def engine() -> Engine:
    return Engine()


@pytest.fixture
def stream(qtbot: QtBot, engine: Engine) -> ShiftStream:
    return ShiftStream(engine.send, engine.store)


def arrival(stream: ShiftStream) -> str:
    return stream.arrival


@pytest.fixture
def see(stream: ShiftStream, snapshot: MakeSnapshot) -> Callable[..., bool]:
    """Show the stream a snapshot of now: what the headset renders with, and whether it has it."""

    def see(applied_m: Shifts, *, is_applied: bool = True, after_s: float = 0.0) -> bool:
        procedure = {"applied_shift_m": applied_m, "is_applied": is_applied}
        now_ns = time.monotonic_ns() + round(1e9 * after_s)
        return stream.see(snapshot(State.APPLIED, procedure=procedure, t_host_ns=now_ns))

    return see


def test_many_changes_are_sent_as_few(qtbot: QtBot, stream: ShiftStream, engine: Engine) -> None:
    started_s = time.monotonic()
    for step in range(200):
        stream.send(shifts_of(1e-5 * step))
        qtbot.wait(1)
    stream.flush()
    periods = (time.monotonic() - started_s) / (1e-3 * PERIOD_MS)
    # One at the start, one for each period, and the last one by `flush`.
    assert 1 < len(engine.sent) <= periods + 2
    assert is_same_shifts(engine.sent[-1], shifts_of(1e-5 * 199))


def test_settles_once_after_the_last_change(
    qtbot: QtBot, stream: ShiftStream, engine: Engine
) -> None:
    stream.send(shifts_of(0.001))
    qtbot.wait(2 * PERIOD_MS)
    assert engine.events == ["sent"]
    stream.send(shifts_of(0.002))
    qtbot.waitUntil(lambda: "settled" in engine.events, timeout=5 * SETTLE_MS)
    assert engine.events == ["sent", "sent", "settled"]


def test_flush_sends_before_it_settles(stream: ShiftStream, engine: Engine) -> None:
    stream.flush()
    assert engine.events == []
    stream.send(shifts_of(0.001))
    stream.flush()
    stream.flush()
    assert engine.events == ["sent", "settled"]


def test_what_is_only_looked_at_does_not_settle(
    qtbot: QtBot, stream: ShiftStream, engine: Engine
) -> None:
    stream.preview(shifts_of(0.001))
    stream.flush()
    qtbot.wait(SETTLE_MS + 5 * PERIOD_MS)
    assert engine.events == ["sent"]


def test_own_shifts_are_told_from_others(stream: ShiftStream, see: Callable[..., bool]) -> None:
    assert see(shifts_of(0.0))  # where it begins is news once
    assert not see(shifts_of(0.0))
    stream.send(shifts_of(0.001))
    assert not see(shifts_of(0.0)), "not even sent"
    stream.flush()
    assert not see(shifts_of(0.0)), "maybe taken before the engine obeyed"
    assert arrival(stream) == "sending"
    assert not see(shifts_of(0.001))
    assert arrival(stream) == "arrived"
    assert see(shifts_of(0.002)), "solved again and applied, for instance"


def test_others_do_not_settle(
    qtbot: QtBot, stream: ShiftStream, engine: Engine, see: Callable[..., bool]
) -> None:
    stream.send(shifts_of(0.001))
    qtbot.wait(2 * PERIOD_MS)
    see(shifts_of(0.001))
    assert see(shifts_of(0.002))
    qtbot.wait(SETTLE_MS + 5 * PERIOD_MS)
    assert engine.events == ["sent"]


def test_a_silent_headset_is_distinguished_from_a_slow_one(
    stream: ShiftStream, see: Callable[..., bool]
) -> None:
    stream.send(shifts_of(0.001))
    stream.flush()
    for _ in range(2):
        see(shifts_of(0.001), is_applied=False, after_s=0.1)
    assert arrival(stream) == "sending"
    see(shifts_of(0.001), is_applied=False, after_s=2.5)
    assert arrival(stream) == "late"
    see(shifts_of(0.001), after_s=2.6)
    assert arrival(stream) == "arrived"
