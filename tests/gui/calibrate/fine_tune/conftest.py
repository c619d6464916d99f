"""Fixtures: the fine-tuning panel, snapshots that it shows, and the changes that it sends."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import pytest
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.core.types import Rig
from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.fine_tune.panel import FineTunePanel
from handcal_gui.calibrate.fine_tune.stream import Shifts
from tests.gui.calibrate.fine_tune.controls import Show


@pytest.fixture
def panel(qtbot: QtBot, rig: Rig) -> FineTunePanel:
    panel = FineTunePanel()
    qtbot.addWidget(panel)
    panel.set_rig(rig)
    panel.resize(430, 450)
    panel.show()
    return panel


@pytest.fixture
def show(panel: FineTunePanel, snapshot: Callable[..., Snapshot]) -> Show:
    """Show the panel, twice, what the headset renders with: by default as solved."""

    def show(
        state: State = State.APPLIED, procedure: Mapping[str, Any] = {}, **changes: Any
    ) -> None:
        for _ in range(2):
            now_ns = time.monotonic_ns()
            panel.show_snapshot(snapshot(state, procedure=procedure, t_host_ns=now_ns, **changes))

    return show


@pytest.fixture
def sent(panel: FineTunePanel) -> list[Shifts]:
    """Return what is sent, as it comes."""
    sent: list[Shifts] = []
    panel.shift_changed.connect(sent.append)
    return sent
