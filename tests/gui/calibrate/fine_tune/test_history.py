from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.core.types import EYES, Eye
from handcal_gui.calibrate.fine_tune.history import ShiftHistory, Shifts, moved, same_shifts

LIMIT_M = 0.03
SHIFTS = st.builds(
    lambda values: {eye: np.array(values[3 * i : 3 * i + 3]) for i, eye in enumerate(EYES)},
    st.lists(st.floats(-LIMIT_M, LIMIT_M), min_size=6, max_size=6),
)


def shifts_of(value_m: float) -> Shifts:
    return {eye: np.full(3, value_m) for eye in EYES}


@given(st.lists(SHIFTS, min_size=2, max_size=8))
def test_undo_goes_back_to_the_start_and_redo_to_the_end(states: list[Shifts]) -> None:
    history = ShiftHistory(states[0])
    seen = [history.present]
    for shifts_m in states[1:]:
        history.change(shifts_m)
        if not same_shifts(history.present, seen[-1]):
            seen.append(history.present)
    for before in seen[-2::-1]:
        history.undo()
        assert same_shifts(history.present, before)
    assert not history.can_undo
    history.undo()
    assert same_shifts(history.present, seen[0])
    for after in seen[1:]:
        history.redo()
        assert same_shifts(history.present, after)
    assert not history.can_redo
    history.redo()
    assert same_shifts(history.present, states[-1])


def test_a_change_forgets_what_was_undone() -> None:
    history = ShiftHistory(shifts_of(0.0))
    history.change(shifts_of(0.001))
    history.undo()
    history.change(shifts_of(0.002))
    assert not history.can_redo
    history.undo()
    assert same_shifts(history.present, shifts_of(0.0))


def test_a_change_that_goes_on_is_undone_with_the_one_before() -> None:
    history = ShiftHistory(shifts_of(0.0))
    history.change(shifts_of(0.001), goes_on=True)  # the first change cannot go on with anything
    history.change(shifts_of(0.002), goes_on=True)
    history.change(shifts_of(0.003))
    history.undo()
    assert same_shifts(history.present, shifts_of(0.002))
    history.undo()
    assert same_shifts(history.present, shifts_of(0.0))


def test_no_change_is_no_step() -> None:
    history = ShiftHistory(shifts_of(0.0))
    history.change(shifts_of(0.0))
    assert not history.can_undo


def test_what_was_given_may_change_afterwards() -> None:
    given_m = {eye: np.zeros(3) for eye in EYES}
    history = ShiftHistory(given_m)
    given_m["left"][0] = 1.0
    assert history.present["left"][0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        history.present["left"][0] = 1.0


@given(SHIFTS, st.sampled_from(range(3)), st.floats(-0.1, 0.1))
def test_both_eyes_move_by_the_same_amount_within_the_limit(
    shifts_m: Shifts, axis: int, by_m: float
) -> None:
    after_m = moved(shifts_m, EYES, axis, by_m, LIMIT_M)
    step_m = [after_m[eye] - shifts_m[eye] for eye in EYES]
    np.testing.assert_allclose(step_m[0], step_m[1], atol=1e-15)
    assert np.delete(step_m[0], axis).tolist() == [0.0, 0.0]
    assert abs(step_m[0][axis]) <= abs(by_m) + 1e-15
    assert all(abs(after_m[eye][axis]) <= LIMIT_M for eye in EYES)


@given(SHIFTS, st.sampled_from(range(3)))
def test_one_eye_moves_alone(shifts_m: Shifts, axis: int) -> None:
    after_m = moved(shifts_m, ("left",), axis, -shifts_m["left"][axis], LIMIT_M)
    assert after_m["left"][axis] == 0.0
    assert after_m["right"] is shifts_m["right"]


def test_shifts_of_other_eyes_differ() -> None:
    assert not same_shifts(shifts_of(0.0), {"left": np.zeros(3)})


def test_an_undo_brings_back_only_the_eye_set_by_hand() -> None:
    history = ShiftHistory(shifts_of(0.0))
    by_hand_m = np.array([0.002, 0.0, 0.0])
    history.change({**shifts_of(0.0), "left": by_hand_m})
    for others_m in (0.001, 0.003):
        history.see(shifts_of(others_m))
        assert history.is_replaced
        assert same_shifts(history.present, shifts_of(others_m))
    history.undo()
    assert not history.is_replaced
    assert same_shifts(history.present, {**shifts_of(0.003), "left": by_hand_m})
    history.undo()
    assert same_shifts(history.present, shifts_of(0.003)), "nobody set the old right eye by hand"
    assert not history.can_undo


def test_what_others_set_again_as_it_was_set_by_hand_is_not_replaced() -> None:
    history = ShiftHistory(shifts_of(0.0))
    by_hand_m = {**shifts_of(0.0), "left": np.array([0.002, 0.0, 0.0])}
    history.change(by_hand_m)
    history.see(shifts_of(0.001))
    history.see(by_hand_m)  # a deleted alignment was restored
    assert not history.is_replaced
    history.undo()
    assert same_shifts(history.present, shifts_of(0.0)), "as it was before it was set by hand"


def test_an_eye_that_others_leave_as_it_was_set_is_not_replaced() -> None:
    history = ShiftHistory(shifts_of(0.0))
    right_m = np.full(3, 0.002)
    history.change({**shifts_of(0.0), "right": right_m})
    history.see({"left": np.full(3, 0.004), "right": right_m})
    assert not history.is_replaced
    history.undo()
    assert history.present["right"].tolist() == [0.0, 0.0, 0.0]
    assert history.present["left"][0] == 0.004


def test_what_was_set_by_hand_before_a_session_was_resumed_is_an_undo_away() -> None:
    by_hand_m = {**shifts_of(0.001), "left": np.array([0.002, 0.0, 0.0])}
    history = ShiftHistory(shifts_of(0.001), by_hand_m)
    assert same_shifts(history.present, by_hand_m)
    history.see(by_hand_m)
    assert not history.is_replaced
    history.see(shifts_of(0.003))
    assert history.is_replaced
    history.undo()
    assert same_shifts(history.present, {**shifts_of(0.003), "left": by_hand_m["left"]})


STEPS = st.one_of(
    st.tuples(st.just("hand"), st.sampled_from(EYES)),
    st.tuples(st.sampled_from(["others", "undo", "redo"]), st.none()),
)


@given(st.lists(STEPS, max_size=12))
def test_an_undo_sets_no_eye_that_nobody_touched(steps: list[tuple[str, Eye | None]]) -> None:
    history = ShiftHistory(shifts_of(0.0))
    by_hand: dict[Eye, set[float]] = {eye: set() for eye in EYES}
    others_m = 0.0
    for number, (step, eye) in enumerate(steps, 1):
        before_m = history.present
        if eye is not None:
            by_hand[eye].add(1e-3 * number)
            history.change({**before_m, eye: np.full(3, 1e-3 * number)})
        elif step == "others":
            others_m = -1e-3 * number
            history.see(shifts_of(others_m))
            lost = [one for one in EYES if before_m[one][0] in by_hand[one]]
            if lost:
                assert history.is_replaced
                history.undo()
                assert all(history.present[one][0] == before_m[one][0] for one in lost)
                history.redo()
        else:
            getattr(history, step)()
        for one in EYES:
            assert history.present[one][0] in {others_m, *by_hand[one]}
