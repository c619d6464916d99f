import contextlib

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from handcal.session.journal import Event
from handcal.session.state import NumberedItems, SessionEvent, SessionState


@given(st.lists(st.tuples(st.sampled_from(["save", "delete", "restore"]), st.integers(1, 6))))
@example(
    [*(("save", number) for number in range(1, 6)), ("delete", 1), ("save", 6), ("restore", 1)]
)
def test_items_are_kept_once_and_in_order(operations: list[tuple[str, int]]) -> None:
    items = NumberedItems[str]("trial", 5)
    saved = 0
    for operation, number in operations:
        with contextlib.suppress(ValueError):
            if operation == "save":
                items.save(number, f"trial {number}")
                saved += 1
            else:
                getattr(items, operation)(number)
        assert sorted([*items.active, *items.deleted]) == list(range(1, saved + 1))
        assert list(items.active) == sorted(items.active)
        assert all(item == f"trial {number}" for number, item in items.active.items())
        assert len(items.active) <= 5


def test_an_event_that_cannot_follow_is_refused_with_its_reason() -> None:
    state = SessionState()
    for name, data, problem in (
        (SessionEvent.ALIGNMENT_SAVED, {"number": 2, "sha256": "x"}, "alignment 2 is not the next"),
        (SessionEvent.ALIGNMENT_DELETED, {"number": 1}, "there is no alignment 1"),
        (SessionEvent.TRIAL_RESTORED, {"number": 1}, "there is no deleted trial 1"),
        (SessionEvent.TRIAL_SAVED, {"number": 1, "trial": {}}, "the trial has no 'target_depth_m'"),
        (SessionEvent.FINE_TUNED, {}, "fine_tuned lacks 'shift_m'"),
        (SessionEvent.APPLIED, {"eyes": ["left"]}, "applied lacks 'shift_m'"),
        (SessionEvent.CREATED, {"rig": "x", "settings": {}, "wearer": 3}, "contains invalid data"),
    ):
        with pytest.raises(ValueError, match=problem):
            state.apply(Event(1, "", name, data))


@pytest.mark.parametrize("number", [True, 1.0, "1", None])
@pytest.mark.parametrize("event", [SessionEvent.ALIGNMENT_SAVED, SessionEvent.ALIGNMENT_DELETED])
def test_what_equals_a_number_but_is_none_is_refused(number: object, event: SessionEvent) -> None:
    state = SessionState()
    if event == SessionEvent.ALIGNMENT_DELETED:
        state.apply(Event(1, "", SessionEvent.ALIGNMENT_SAVED, {"number": 1, "sha256": "x"}))
    with pytest.raises(ValueError, match="a number must be whole"):
        state.apply(Event(2, "", event, {"number": number, "sha256": "x"}))


def test_an_event_of_others_changes_nothing_but_that_it_goes_on() -> None:
    state = SessionState()
    state.apply(Event(1, "", SessionEvent.FINISHED, {}))
    assert state.is_finished
    state.apply(Event(2, "", "cursor_made", {"shift_m": "nonsense"}))
    assert not state.is_finished
