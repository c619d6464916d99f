from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from handcal.export.outcome import SessionOutcome, load_outcome
from handcal.io.settings import settings_json
from handcal.register.results import SolveSettings, results_json, solve_session
from handcal.rig.example import Z_E_S_M, example_rig
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import make_trial
from handcal.sim.alignments import AlignmentSettings, simulate_alignment
from handcal.sim.hand import make_hand
from handcal.station.procedure import CalibrationSettings
from handcal.types import EYES, Alignment, Eye

RIG = example_rig()
SETTINGS = {"calibration": settings_json(CalibrationSettings())}
SIMULATED = AlignmentSettings(
    count=600, display_distance_m=Z_E_S_M, shift_max_m=0.003, resample=True, depth_sigma_m=0.001
)


def make_alignment(seed: int, eyes: Sequence[Eye]) -> Alignment:
    one = simulate_alignment(np.random.default_rng(seed), make_hand(1), 0.05, SIMULATED)
    return Alignment(
        cursor_m=one.cursor_m,
        hand_m=one.hand_m,
        cursor_is_cut=one.cursor_cut,
        hand_is_cut=one.hand_cut,
        T_E_W=dict.fromkeys(EYES, one.T_E_W),
        eyes=tuple(eyes),
        rotation_rad=one.rotation_rad,
        t_a_ns=1,
        t_b_ns=2,
    )


@pytest.fixture(scope="session")
def record(tmp_path_factory: pytest.TempPathFactory) -> SessionRecord:
    """Return a session with everything: alignments 1 and 3, trials, and the left eye fine-tuned."""
    parent = tmp_path_factory.mktemp("sessions")
    with Session.create(parent, RIG, SETTINGS, name="one", wearer="=P-07, $x_") as session:
        kept = [make_alignment(1, EYES), make_alignment(2, ("left",))]
        session.save_alignment(kept[0])
        session.save_alignment(make_alignment(3, EYES))
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
    """Return a session in which nothing was done."""
    with Session.create(tmp_path_factory.mktemp("sessions"), RIG, SETTINGS) as session:
        pass
    return Session.open(session.path)


@pytest.fixture(scope="session")
def outcome(record: SessionRecord) -> SessionOutcome:
    return load_outcome(record)
