"""Fixtures of the procedure's tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from handcal.link.client import HeadsetClient
from handcal.link.server import HeadsetServer
from handcal.session.session import Session
from tests.calibration.stage import HEADSET_AHEAD_NS, KEY, RIG, Stage, connect


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[HeadsetServer]:
    # The stage's time runs ahead of the real one, as it waits for nothing.
    monkeypatch.setattr("handcal.link.server._AHEAD_NS", 10**12)
    # Nor are its clocks measured: on a busy machine the drift between them would be, by a percent,
    # and carried on to the stage's times, seconds ahead, a press would be of another frame.
    clock = "handcal.link.poses.ClockEstimator."
    monkeypatch.setattr(f"{clock}to_headset_ns", lambda _, t_ns: t_ns + HEADSET_AHEAD_NS)
    monkeypatch.setattr(f"{clock}to_host_ns", lambda _, t_ns: t_ns - HEADSET_AHEAD_NS)
    monkeypatch.setattr(f"{clock}_step_ns", lambda *_: 0)
    # The stage's times are exact, so a hand may be followed while it moves.
    monkeypatch.setattr("handcal.calibration.sight.ASSUMED_LATENCY_S", 0.0)
    monkeypatch.setattr("handcal.calibration.delay.ASSUMED_SIGMA_S", 0.0)
    monkeypatch.setattr("handcal.calibration.aligning.MOVED_LIMIT_M", 0.01)
    monkeypatch.setattr("handcal.link.server._PING_PERIOD_S", 0.01)
    monkeypatch.setattr("handcal.link.client._HELLO_PERIOD_S", 0.01)
    with HeadsetServer(KEY) as server:
        yield server


@pytest.fixture
def client(server: HeadsetServer) -> Iterator[HeadsetClient]:
    with connect(server) as client:
        yield client


@pytest.fixture
def session(tmp_path: Path) -> Iterator[Session]:
    with Session.create(tmp_path, RIG, {}, name="session") as session:
        yield session


@pytest.fixture
def stage(server: HeadsetServer, client: HeadsetClient, session: Session) -> Stage:
    return Stage(server, client, session)
