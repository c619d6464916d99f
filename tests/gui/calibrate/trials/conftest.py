from __future__ import annotations

import itertools

import numpy as np
import pytest
from pytestqt.qtbot import QtBot

from handcal.core.types import Eye, Rig
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import make_trial
from handcal_gui.calibrate.trials.panel import TrialsPanel
from tests.gui.helpers import show


@pytest.fixture(autouse=True)
def presses_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let each press come two seconds after the one before."""
    times_s = itertools.count(0.0, 2.0)
    monkeypatch.setattr("handcal_gui.calibrate.trials.panel.monotonic", lambda: next(times_s))


@pytest.fixture
def panel(qtbot: QtBot) -> TrialsPanel:
    return show(qtbot, TrialsPanel(), 430, 450)


@pytest.fixture
def tried(record: SessionRecord, rig: Rig) -> SessionRecord:
    """Return a session with trials 1 (left, 0.4 m) and 3 (left, 0.6 m); 2 is deleted."""
    trials: list[tuple[Eye, float]] = [("left", 0.4), ("right", 0.5), ("left", 0.6)]
    with Session(record.path) as session:
        for eye, depth_m in trials:
            session.save_trial(make_trial(rig.eyes[eye], eye, depth_m, np.zeros(3), [1e-3, 0, 0]))
        session.delete("trial", 2)
    return Session.open(record.path)
