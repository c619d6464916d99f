"""The benchmark of the window in a process of its own, as `handcal bench --gui` runs it."""

from __future__ import annotations

import subprocess
import sys

import pytest

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
