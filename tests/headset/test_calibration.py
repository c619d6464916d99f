"""Whole calibrations by the C# link and the real station: the simulated wearer wears it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from handcal.cli.demo import DemoSettings, run_demo
from handcal.io.resources import resource_path
from handcal.progress import Progress
from handcal.types import EYES
from tests.headset.mono_client import command

pytestmark = [pytest.mark.process, pytest.mark.slow]
SEED = 3

Calibrate = Callable[[DemoSettings], dict[str, Any]]


@pytest.fixture
def calibrate(program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Calibrate:
    """Return a function that runs the demo with the C# link in the virtual headset."""
    monkeypatch.setattr("handcal.sim.process.program_command", lambda: command(program))
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
