from __future__ import annotations

import os
import platform
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from PySide6.QtCore import QCoreApplication
from pytestqt.qtbot import QtBot

from handcal.bridge.bridges import Bridge, BridgeSettings
from handcal.calibration.states import ProcedureError
from handcal.core.errors import FileError
from handcal.io.closable import Closable
from handcal.station.station import Station
from handcal_gui.engine.engine_thread import EngineThread

LOCAL = "127.0.0.1"


class FakeStation(Closable):
    """Counts its steps in place of a station, which tests/test_station.py runs."""

    def __init__(self) -> None:
        self.steps = 0
        self.is_closed = False
        self.notes = ""
        self.breaks_at: int | None = None
        self.watchers: list[object] = []
        self.record: SimpleNamespace | None = None

    def step(self) -> Any:
        time.sleep(0.002)
        self.steps += 1
        if self.steps == self.breaks_at:
            raise ZeroDivisionError("oh")
        return SimpleNamespace(record=self.record) if self.record else self.steps

    def watch(self, watcher: object) -> None:
        self.watchers.append(watcher)

    def close(self) -> None:
        self.is_closed = True


def write_notes(station: FakeStation, text: str, _station: Station) -> None:
    station.notes = text


@contextmanager
def streaming(qtbot: QtBot, station: FakeStation) -> Iterator[EngineThread]:
    engine = EngineThread(lambda: cast(Station, station))
    with qtbot.waitSignal(engine.opened, timeout=5000):
        engine.start()
    yield engine
    engine.close()
    assert station.is_closed


def test_the_newest_snapshot_waits_and_no_old_one(qtbot: QtBot) -> None:
    station = FakeStation()
    with streaming(qtbot, station) as engine:
        qtbot.waitUntil(lambda: station.steps > 20)
        assert cast(int, engine.newest()[0]) >= 20


def test_a_new_snapshot_is_announced_once_until_it_is_taken(qtbot: QtBot) -> None:
    station = FakeStation()
    told: list[int] = []

    def take_and_step_on(engine: EngineThread) -> int:
        engine.newest()
        seen = station.steps
        qtbot.waitUntil(lambda: station.steps > seen + 20, timeout=20_000)
        QCoreApplication.processEvents()
        return len(told)

    with streaming(qtbot, station) as engine:
        engine.arrived.connect(lambda: told.append(station.steps))
        before = take_and_step_on(engine)
        assert take_and_step_on(engine) == before + 1


def test_it_tells_which_commands_the_newest_snapshot_shows(qtbot: QtBot) -> None:
    with streaming(qtbot, FakeStation()) as engine:
        assert engine.newest()[1] == 0
        numbers = [engine.submit("wait", lambda _station: time.sleep(0.01)) for _ in range(2)]
        assert numbers == [1, 2]
        qtbot.waitUntil(lambda: engine.newest()[1] == 2)


def test_closing_it_tells_all_that_it_had_to_say_at_once(qtbot: QtBot) -> None:
    def fail(_station: Station) -> None:
        raise ZeroDivisionError("oh")

    engine = EngineThread(lambda: cast(Station, FakeStation()))
    heard: list[str] = []
    engine.opened.connect(lambda _station: heard.append("opened"))
    engine.failed.connect(lambda _name, why: heard.append(why))
    engine.ended.connect(lambda why: heard.append(f"ended {why}"))
    engine.submit("fail", fail)
    engine.start()
    engine.close()
    assert heard == ["opened", "ZeroDivisionError: oh", "ended "]


def test_commands_run_in_the_engine_s_thread_and_answer_in_the_window_s(qtbot: QtBot) -> None:
    heard: list[threading.Thread] = []
    with streaming(qtbot, FakeStation()) as engine:
        engine.command_done.connect(lambda *_: heard.append(threading.current_thread()))
        with qtbot.waitSignal(engine.command_done, timeout=5000) as command_done:
            engine.submit("where", lambda _station: threading.current_thread().name)
    assert command_done.args == ["where", "handcal engine"]
    assert heard == [threading.main_thread()]


@pytest.mark.parametrize("error", [ProcedureError("solve first"), ValueError("solve first")])
def test_a_command_that_fails_is_reported_and_the_engine_goes_on(
    qtbot: QtBot, error: Exception
) -> None:
    def fail(_station: Station) -> None:
        raise error

    station = FakeStation()
    with streaming(qtbot, station) as engine:
        with qtbot.waitSignal(engine.failed, timeout=5000) as failed:
            engine.submit("apply", fail)
        steps = station.steps
        qtbot.waitUntil(lambda: station.steps > steps + 3)
    assert failed.args == ["apply", "solve first"]


def test_what_was_asked_for_just_before_the_end_is_done(qtbot: QtBot) -> None:
    station = FakeStation()
    with streaming(qtbot, station) as engine:
        for text in ("a", "ab", "abc"):
            engine.submit("notes", partial(write_notes, station, text))
    assert station.notes == "abc"


def test_a_station_that_cannot_be_opened_says_why(qtbot: QtBot) -> None:
    def fail() -> Station:
        raise FileError("there is no rig file")

    engine = EngineThread(fail)
    with qtbot.waitSignal(engine.ended, timeout=5000) as ended:
        engine.start()
    engine.close()
    assert ended.args == ["there is no rig file"]


@pytest.mark.parametrize(
    ("is_worth_resuming", "advice"),
    [
        (False, "nothing was recorded: start again"),
        (True, "the session is kept: resume it"),
    ],
)
def test_an_engine_that_breaks_down_closes_the_station_and_says_so(
    qtbot: QtBot, is_worth_resuming: bool, advice: str
) -> None:
    station = FakeStation()
    station.record = SimpleNamespace(is_worth_resuming=is_worth_resuming)
    station.breaks_at = 5
    engine = EngineThread(lambda: cast(Station, station))
    with qtbot.waitSignal(engine.ended, timeout=5000) as ended:
        engine.start()
    engine.close()
    assert ended.args == [f"handcal hit an unexpected error (ZeroDivisionError: oh); {advice}"]
    assert station.is_closed


def test_bridges_watch_the_station_and_end_before_it(qtbot: QtBot) -> None:
    pytest.importorskip("pyigtl")
    station, port = FakeStation(), free_tcp_port()
    engine = EngineThread(lambda: cast(Station, station), bridges=BridgeSettings(LOCAL, port))
    with qtbot.waitSignal(engine.opened, timeout=5000):
        engine.start()
    (bridge,) = station.watchers
    assert isinstance(bridge, Bridge)
    assert not bridge.is_over
    engine.close()
    assert bridge.is_over
    socket.create_server((LOCAL, port)).close()  # the port is free again


def test_a_calibration_goes_on_without_a_bridge_that_cannot_be_opened(qtbot: QtBot) -> None:
    pytest.importorskip("pyigtl")
    station = FakeStation()
    with socket.create_server((LOCAL, 0)) as taken:
        bridges = BridgeSettings(LOCAL, taken.getsockname()[1])
        engine = EngineThread(lambda: cast(Station, station), bridges=bridges)
        told: list[str] = []
        engine.told.connect(told.append)
        with qtbot.waitSignal(engine.opened, timeout=5000):
            engine.start()
        qtbot.waitUntil(lambda: station.steps > 2)
        engine.close()
    assert ["cannot listen" in line for line in told] == [True]


def free_tcp_port() -> int:
    with socket.create_server((LOCAL, 0)) as server:
        return int(server.getsockname()[1])


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries keep nothing")
def test_a_session_begins_with_the_memory_that_others_freed_given_back(qtbot: QtBot) -> None:
    blocks = [np.ones(12_000) for _ in range(2_000)]  # 96 kB each: less gets no pages of its own
    full = _memory_mb()
    kept = blocks[::50]
    del blocks
    assert full - _memory_mb() < 100.0
    station = FakeStation()
    with streaming(qtbot, station):
        qtbot.waitUntil(lambda: station.steps > 0)
        given_back_mb = full - _memory_mb()
    assert given_back_mb > 100.0
    assert len(kept) == 40


def _memory_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20
