"""Whole calibrations by the C# link and the real station: the simulated wearer wears it."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from handcal.calibration.states import State
from handcal.core.progress import Progress
from handcal.core.types import EYES
from handcal.io.resources import resource_path
from handcal.lab.demo import DemoSettings, run_demo
from handcal.station.settings import StationSettings
from handcal.station.snapshot import Snapshot
from handcal.station.station import Station
from tests.headset.mono_client import command
from tests.helpers import Patience

pytestmark = [pytest.mark.process, pytest.mark.slow]
SEED = 3

Calibrate = Callable[[DemoSettings], dict[str, Any]]


@pytest.fixture
def calibrate(program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Calibrate:
    """Return a function that runs the demo with the C# link in the virtual headset."""
    monkeypatch.setattr("handcal.sim.simulation.program_command", lambda: command(program))
    rig = resource_path("example_rig.yaml")
    return lambda settings: run_demo(settings, rig, tmp_path, Progress())


@pytest.mark.parametrize("loss", [0.0, 0.3])
def test_a_calibration(calibrate: Calibrate, loss: float) -> None:
    result = calibrate(DemoSettings(seed=SEED, loss=loss, reorder=loss))
    error_arcmin = result["reprojection_arcmin"]
    assert error_arcmin["after"] < 0.5 * error_arcmin["before"]
    assert result["link"]["projection_acked"] == {"left": True, "right": True}
    assert all(result["eyes"][eye]["evidence"] == [] for eye in EYES)
    if loss:
        assert result["link"]["lost"] > 0.15 * result["link"]["sent"]


def test_the_recommended_plan_is_verified_by_nudges(calibrate: Calibrate) -> None:
    result = calibrate(DemoSettings(seed=SEED, plan="recommended"))
    error_arcmin = result["reprojection_arcmin"]
    assert error_arcmin["after"] < 0.5 * error_arcmin["before"]
    assert all(one["verified"] for one in result["eyes"].values())


def test_either_side_is_restarted_during_a_calibration(
    program: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    headset_of: Callable[[int], int],
) -> None:
    monkeypatch.setattr("handcal.sim.simulation.program_command", lambda: command(program))
    monkeypatch.setattr("handcal.calibration.hands.MATCH_NS", 2 * 10**9)
    settings = StationSettings(seed=SEED, sessions=str(tmp_path))
    with Station(settings, "Ada") as station:
        _step_until(
            station, lambda seen: seen.observation is not None and seen.observation.is_steady
        )
        station.calibration.make_cursor(EYES)
        os.kill(headset_of(os.getpid()), signal.SIGKILL)
        station.restart_headset()
        _step_until(station, lambda seen: seen.procedure.state is State.ALIGNED)
        path = station.session.path
    with Station(settings, resume=path) as station:  # the PC's program is restarted
        _step_until(station, lambda seen: seen.link.pose_rate_hz > 0)
        station.calibration.solve()
        station.calibration.apply()
        _step_until(station, lambda seen: seen.procedure.state is State.APPLIED)
        assert station.calibration.projection_acked == {"left": True, "right": True}


def _step_until(station: Station, condition: Callable[[Snapshot], bool]) -> None:
    patience = Patience(60.0)
    while not condition(station.step()):
        assert not patience.is_over(), "it did not come"
