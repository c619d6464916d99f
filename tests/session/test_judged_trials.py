from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from handcal.core.types import EYES, Alignment
from handcal.register.results import Results, SolveSettings, results_json, solve_session
from handcal.rig.example import example_rig
from handcal.session.record import eye_trials
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import make_trial

RIG = example_rig()
FORMER_M = np.array([0.01, 0.0, 0.0])


@pytest.fixture
def results(simulated: Callable[..., Alignment]) -> Results:
    return solve_session([simulated(1, ("left",))], RIG, SolveSettings())


@pytest.fixture
def record(session: Session, results: Results) -> SessionRecord:
    """Return a session solved with another φ, of both eyes, and a trial of each."""
    eyes = results_json(results)["eyes"]
    stored = {eye: {**eyes["left"], "shift_m": FORMER_M.tolist()} for eye in EYES}
    trials = {
        number: make_trial(RIG.eyes[eye], eye, 0.4, FORMER_M, 2 * FORMER_M)
        for number, eye in enumerate(EYES, 1)
    }
    record = Session.open(session.path)
    return replace(record, results={"eyes": stored}, is_solved=True, trials=trials)


def test_trials_of_an_eye_that_is_not_solved_now_judge_nothing(
    results: Results, record: SessionRecord
) -> None:
    assert set(eye_trials(results, record, 8.0)) == {"left"}


def test_stored_results_of_other_alignments_do_not_count(
    results: Results, record: SessionRecord
) -> None:
    assert eye_trials(results, replace(record, is_solved=False), 8.0) == {}
