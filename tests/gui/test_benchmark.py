"""The benchmark of the window in a process of its own, as `handcal bench --gui` runs it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from handcal.station.settings import StationSettings
from handcal_gui import benchmark

_BREAKING = """
from handcal_gui import benchmark
from handcal.station.station import Station
def step(_): raise ZeroDivisionError("oh")
Station.step = step
benchmark.main()
"""

pytestmark = pytest.mark.process


def test_a_breakdown_of_the_engine_ends_the_benchmark_with_its_reason() -> None:
    run = subprocess.run(
        [sys.executable, "-c", _BREAKING], capture_output=True, text=True, timeout=60.0
    )
    assert run.returncode == 1
    assert "(ZeroDivisionError: oh)" in run.stderr.splitlines()[-1]
    assert not run.stdout


def test_the_station_of_the_benchmark_sees_the_frames_in_memory(tmp_path: Path) -> None:
    settings = StationSettings(
        source="recording", headset="network", host="127.0.0.1", port=0, sessions=str(tmp_path)
    )
    replay = benchmark._ReplayFrames(30)
    with benchmark._ReplayStation(replay, settings) as station:
        frames = [station.step().frame for _ in range(3)]
    assert [frame is not None for frame in frames] == [True] * 3
    assert replay.taken == 3
