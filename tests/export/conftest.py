from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from handcal.calibration.states import CalibrationSettings
from handcal.core.types import EYES, Alignment, Verification
from handcal.export.outcome import SessionOutcome, load_outcome
from handcal.io.settings import settings_json
from handcal.register.results import SolveSettings, results_json, solve_session
from handcal.rig.example import example_rig
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import make_trial

RIG = example_rig()
VERIFIED = Verification((0.0, 0.0, 0.0), (1.0, -2.0), (0.001, 0.0, 0.0), hand_E_m=(0.0, 0.0, 0.5))
SETTINGS = {"calibration": settings_json(CalibrationSettings())}


@pytest.fixture(scope="session")
def record(
    tmp_path_factory: pytest.TempPathFactory, simulated: Callable[..., Alignment]
) -> SessionRecord:
    """Return a session with alignments 1 and 3, trials, and a fine-tuned left eye."""
    parent = tmp_path_factory.mktemp("sessions")
    with Session.create(parent, RIG, SETTINGS, name="one", wearer="=P-07, $x_") as session:
        kept = [simulated(1), simulated(2, ("left",))]
        session.save_alignment(kept[0])
        session.save_alignment(simulated(3))
        session.delete("alignment", 2)
        session.save_alignment(kept[1])
        session.record("refused", reason="turned", angle_deg=12.0)
        results = solve_session(kept, RIG, SolveSettings())
        session.save_results(results_json(results))
        shifts_m = {eye: shift.shift_m for eye, shift in results.eyes.items()}
        session.save_applied(shifts_m)
        for depth_m in (0.4, 0.6):
            for eye, shift_m in shifts_m.items():
                truth_m = np.add(shift_m, [0.001, -0.002, 0.003])
                session.save_trial(make_trial(RIG.eyes[eye], eye, depth_m, shift_m, truth_m))
        session.save_fine_tuned({"left": shifts_m["left"] + [0.001, 0.0, 0.0]})
        session.save_notes("Glasses off.\n\n50 % humidity: $\\frac{1}{2")
        session.record("link", sent=1335, rejected={"corrupt": 0})
    return Session.open(session.path)


@pytest.fixture(scope="session")
def empty(tmp_path_factory: pytest.TempPathFactory) -> SessionRecord:
    """Return a session without alignments, results or trials."""
    with Session.create(tmp_path_factory.mktemp("sessions"), RIG, SETTINGS) as session:
        pass
    return Session.open(session.path)


@pytest.fixture(scope="session")
def verified(tmp_path_factory: pytest.TempPathFactory) -> SessionRecord:
    """Return a session as after a slipped headset: both eyes are verified, and nothing else."""
    with Session.create(tmp_path_factory.mktemp("sessions"), RIG, SETTINGS) as session:
        session.save_facts(verified=dict.fromkeys(EYES, VERIFIED))
    return Session.open(session.path)


@pytest.fixture(scope="session")
def outcome(record: SessionRecord) -> SessionOutcome:
    return load_outcome(record)
