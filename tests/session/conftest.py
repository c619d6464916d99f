"""Sessions of known content."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from handcal.core.types import Alignment
from handcal.rig.example import example_rig
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import Trial, make_trial

SETTINGS = {"method": "consistent", "gate_m": [0.35, 0.7], "third": 1 / 3}
SHIFT_M = np.array([0.001, -0.002, 1e-17])
RESULTS = {"left": {"shift_m": [0.1 + 0.2, -1e-17, 3.0]}}


@pytest.fixture
def session(tmp_path: Path) -> Iterator[Session]:
    with Session.create(tmp_path, example_rig(), SETTINGS, name="one") as session:
        yield session


@pytest.fixture(scope="module")
def trial() -> Trial:
    return make_trial(example_rig().eyes["right"], "right", 0.4, np.zeros(3), np.full(3, 0.001))


@pytest.fixture(scope="module")
def finished(
    tmp_path_factory: pytest.TempPathFactory, alignment: Alignment, trial: Trial
) -> SessionRecord:
    parent = tmp_path_factory.mktemp("sessions")
    with Session.create(parent, example_rig(), SETTINGS, wearer="Ana") as session:
        session.record("cursor_made", points=5000)
        session.save_alignment(alignment)
        session.record("refused", angle_rad=0.2)
        session.save_alignment(alignment)
        session.delete("alignment", 1)
        session.restore("alignment", 1)
        session.save_results(RESULTS)
        session.save_applied({"left": SHIFT_M})
        session.save_trial(trial)
        session.save_fine_tuned({"right": 2 * SHIFT_M})
        session.finish()
    return Session.open(session.path)
