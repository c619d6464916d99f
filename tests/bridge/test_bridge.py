"""A bridge sends in its own thread, and is dropped with one line when it cannot."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import pytest

from handcal.bridge.bridges import Bridge
from handcal.station.snapshot import Snapshot
from tests.helpers import eventually


class Spy:
    name = "Spy"
    capacity = 2

    def __init__(self) -> None:
        self.sent: list[int] = []
        self.go = threading.Event()
        self.go.set()
        self.fails = False
        self.is_closed = False

    def take(self, snapshot: Snapshot) -> int | None:
        return snapshot.number

    def send(self, item: int) -> None:
        self.go.wait()
        if self.fails:
            raise OSError("the cable is cut")
        self.sent.append(item)

    def close(self) -> None:
        self.is_closed = True


def test_what_waits_is_sent_before_the_end(snapshot: Snapshot) -> None:
    spy, said = Spy(), list[str]()
    with Bridge(spy, said.append) as bridge:
        bridge(snapshot)
    assert spy.sent == [1]
    assert spy.is_closed
    assert said == []
    bridge(snapshot)  # after the end nothing happens
    bridge.close()
    assert spy.sent == [1]


def test_one_that_fails_is_dropped_with_one_line(snapshot: Snapshot) -> None:
    spy, said = Spy(), list[str]()
    spy.fails = True
    with Bridge(spy, said.append) as bridge:
        bridge(snapshot)
        eventually(lambda: bridge.is_over)
        for _ in range(3):
            bridge(snapshot)
    assert said == ["Spy is off: the cable is cut"]
    assert spy.is_closed


def test_one_that_hangs_is_dropped_with_one_line(snapshot: Snapshot) -> None:
    spy, said = Spy(), list[str]()
    spy.go.clear()
    with Bridge(spy, said.append, patience_s=0.05) as bridge:
        begin_s = time.thread_time()
        bridge(snapshot)

        def is_dropped() -> bool:
            bridge(snapshot)
            return bridge.is_over

        eventually(is_dropped)
        assert said == ["Spy is off: nothing could be sent for 0.05 s"]
        for _ in range(1000):
            bridge(snapshot)
        assert time.thread_time() - begin_s < 1.0
    assert len(said) == 1
    spy.go.set()
    eventually(lambda: spy.is_closed)


def test_only_the_newest_wait(snapshot: Snapshot) -> None:
    spy = Spy()
    spy.go.clear()
    numbered = [snapshot]
    with Bridge(spy, pytest.fail) as bridge:
        bridge(numbered[0])
        eventually(lambda: bridge._sending_since_s is not None)
        for number in range(2, 6):
            bridge(replace(snapshot, number=number))
        spy.go.set()
    assert spy.sent == [1, 4, 5]
