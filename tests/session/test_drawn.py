"""The final φ, by what the headset was told, in one word."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from handcal.core.types import EYES, Eye, Float64
from handcal.session.drawn import drawn_shifts
from handcal.session.session import Session, SessionRecord
from handcal.session.state import WENT_BACK

SOLVED_M: dict[Eye, Float64] = {
    "left": np.array([0.001, 0.002, -0.003]),
    "right": np.array([-0.001, 0.0, 0.004]),
}
OFFLINE_M = np.zeros(3)


def results(left: str = "accept", right: str = "accept", times: float = 1.0) -> dict[str, Any]:
    verdicts = {"left": left, "right": right}
    return {
        "eyes": {
            eye: {"shift_m": (times * SOLVED_M[eye]).tolist(), "verdict": verdicts[eye]}
            for eye in EYES
        }
    }


def kinds(session: Session) -> list[str]:
    record = Session.open(session.path)
    drawn = drawn_shifts(record)
    for eye in EYES:
        if drawn[eye].is_drawn:
            applied_m = record.applied_shift_m.get(eye, OFFLINE_M)
            np.testing.assert_array_equal(drawn[eye].shift_m, applied_m)
    return [str(drawn[eye]) for eye in EYES]


@pytest.fixture
def solved(session: Session) -> Session:
    """Return a session whose right eye keeps the offline calibration, as sent to the headset."""
    session.save_results(results(right="keep"))
    session.save_applied({"left": SOLVED_M["left"], "right": OFFLINE_M})
    return session


def test_a_used_result_is_solved_and_one_that_is_kept_from_use_offline(solved: Session) -> None:
    assert kinds(solved) == ["solved", "offline"]


def test_setting_an_eye_that_keeps_offline_to_its_result_makes_it_solved(solved: Session) -> None:
    solved.save_fine_tuned(SOLVED_M)
    assert kinds(solved) == ["solved", "solved"]


def test_the_other_eye_is_set_by_hand_and_then_reset_to_offline(solved: Session) -> None:
    by_hand_m = SOLVED_M["left"] + [0.001, 0.0, 0.0]
    solved.save_fine_tuned({"left": by_hand_m, "right": OFFLINE_M})
    assert kinds(solved) == ["set by hand", "offline"]
    solved.save_fine_tuned(dict.fromkeys(EYES, OFFLINE_M))
    assert kinds(solved) == ["offline", "offline"]


def test_going_back_draws_an_earlier_shift(solved: Session) -> None:
    earlier: Mapping[Eye, Float64] = {eye: 0.5 * SOLVED_M[eye] for eye in EYES}
    solved.record(WENT_BACK)
    solved.save_fine_tuned(earlier)
    assert kinds(solved) == ["earlier", "earlier"]


def test_a_result_that_was_not_sent_is_not_drawn_yet(solved: Session) -> None:
    solved.save_results(results(times=2.0))
    assert kinds(solved) == ["solved, not in the headset yet"] * 2


@pytest.mark.parametrize("verdict", ["implausible", "contradicted"])
def test_a_faulty_result_leaves_the_offline_calibration(session: Session, verdict: str) -> None:
    session.save_results(results(left=verdict))
    session.save_applied({"left": OFFLINE_M, "right": SOLVED_M["right"]})
    assert kinds(session) == ["offline", "solved"]


def test_without_results_the_headset_goes_on_with_what_it_has(session: Session) -> None:
    assert kinds(session) == ["offline", "offline"]
    session.save_fine_tuned(SOLVED_M)
    assert kinds(session) == ["set by hand", "set by hand"]


def test_state_and_record_agree(finished: SessionRecord, session: Session) -> None:
    session.save_results(results())
    session.save_applied(SOLVED_M)
    live = drawn_shifts(session._state)
    stored = drawn_shifts(Session.open(session.path))
    assert [str(live[eye]) for eye in EYES] == [str(stored[eye]) for eye in EYES]
    assert drawn_shifts(finished)["right"].kind == "set by hand"
