"""An engine that takes the panels' commands, for all tests of panels."""

from __future__ import annotations

from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from handcal.core.types import Eye, Rig
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import make_trial
from handcal_gui.engine.engine_thread import Command


class Engine:
    """Obeys commands at once, with a station that notes the calls."""

    def __init__(self) -> None:
        self.station: Any = MagicMock()
        self.names: list[str] = []

    def __call__(self, name: str, command: Command) -> int:
        command(self.station)
        self.names.append(name)
        return len(self.names)


@pytest.fixture
def engine() -> Engine:
    return Engine()


@pytest.fixture
def tried(record: SessionRecord, rig: Rig) -> SessionRecord:
    """Return a session with trials 1 (left, 0.4 m) and 3 (left, 0.6 m); 2 is deleted."""
    trials: list[tuple[Eye, float]] = [("left", 0.4), ("right", 0.5), ("left", 0.6)]
    with Session(record.path) as session:
        for eye, depth_m in trials:
            session.save_trial(make_trial(rig.eyes[eye], eye, depth_m, np.zeros(3), [1e-3, 0, 0]))
        session.delete("trial", 2)
    return Session.open(record.path)
