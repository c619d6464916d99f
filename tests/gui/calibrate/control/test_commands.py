"""Commands that depend on what was shown when a button was pressed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from handcal.calibration.plan import NextStep, StepName
from handcal.calibration.states import ProcedureError, State
from handcal_gui.calibrate.control.live import skipping
from tests.gui.views import NUDGED, Maker


@pytest.mark.parametrize("is_begun", [True, False])
def test_a_skip_is_of_the_eye_that_was_shown(snapshot: Maker, is_begun: bool) -> None:
    state = State.VERIFY if is_begun else State.APPLIED
    seen = snapshot(state, procedure={"verifying": NUDGED if is_begun else None})
    object.__setattr__(seen, "next_step", NextStep(StepName.VERIFY, ("left",), ""))
    skipped: list[str] = []

    def skip(eye: str) -> None:
        skipped.append(eye)
        raise ProcedureError("the wearer has just ended it")

    station: Any = SimpleNamespace(plan=SimpleNamespace(skip=skip))
    skipping(seen)(station)
    assert skipped == ["left"]
