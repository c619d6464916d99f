"""The state of a session and its facts: what its events lead to, and what is refused."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from handcal.core.types import (
    CameraIdentity,
    EyeDistance,
    HeadsetIdentity,
    HeadsetView,
    Intrinsics,
    Verification,
)
from handcal.rig.example import example_rig
from handcal.session.journal import Event
from handcal.session.session import Session
from handcal.session.state import (
    AlignmentFacts,
    CameraUsed,
    NumberedItems,
    SessionEvent,
    SessionFacts,
    SessionState,
    facts_json,
)


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


CAMERA = CameraUsed(
    CameraIdentity("D415", "816612062327", "5.13"),
    Intrinsics(1280, 720, 1005.0, 1004.5, 639.5, 359.5, (0.1, 0.0, 0.0, 0.0, 0.0)),
    0.001,
)
VIEW = HeadsetView(np.eye(4) + 1e-17, np.array([-0.3, 0.3, 0.2, -0.2]), 1268, 720)
HEADSET = HeadsetIdentity("a1b2", "Lab 2", "OpenXR 1.1", "app 1.0", 2, {"left": VIEW}, 0.0631)
FACTS: dict[str, Any] = {
    "camera": CAMERA,
    "headset": HEADSET,
    "plan": "each",
    "usable_eyes": ("right",),
    "eye_distance": EyeDistance(0.0632, 0.002, "headset"),
    "verified": {"left": Verification((0.001, 0.0, 1 / 3), (1.5, -2.0), (0.002, 0.0, 0.0))},
    "evidence": ("digest", "picture"),
    "contradictions": (),
}


@pytest.mark.parametrize("name", FACTS)
def test_each_fact_comes_back_alone(tmp_path: Path, name: str) -> None:
    with Session.create(tmp_path, example_rig(), {}) as session:
        assert facts_json(Session.open(session.path).facts) == facts_json(SessionFacts())
        session.save_facts(**{name: FACTS[name]})
    found = Session.open(session.path).facts
    assert facts_json(getattr(found, name)) == facts_json(FACTS[name])
    others = {other: value for other, value in facts_json(found).items() if other != name}
    unknown = facts_json(SessionFacts())
    unknown.pop(name)
    assert others == unknown


def test_a_fact_replaces_an_earlier_one_and_each_eye_its_own(tmp_path: Path) -> None:
    zero = 0.0, 0.0, 0.0
    once = Verification(zero, (0.0, 0.0), zero, 0.01, (0.0, 0.1, 0.5))
    right = Verification(zero, (1.0, 0.0), zero).after(once)
    with Session.create(tmp_path, example_rig(), {}) as session:
        session.save_facts(**FACTS)
        session.save_facts(plan="both", verified={"right": right}, headset=None)
    found = Session.open(session.path).facts
    assert (found.plan, found.headset, found.camera) == ("both", None, CAMERA)
    assert found.verified == {**FACTS["verified"], "right": right}


@pytest.mark.parametrize(
    "wrong",
    [
        {"plan": "middle"},
        {"usable_eyes": ()},
        {"usable_eyes": ("left", "left")},
        {"plans": "each"},
        {"eye_distance": 0.063},
        {"evidence": (1,)},
        {"verified": {"middle": FACTS["verified"]["left"]}},
        {"headset": replace(HEADSET, views={"left": replace(VIEW, tangents=np.full(4, np.nan))})},
        {"camera": object()},
    ],
)
def test_what_is_no_fact_is_refused_and_nothing_written(
    tmp_path: Path, wrong: dict[str, Any]
) -> None:
    with Session.create(tmp_path, example_rig(), {}) as session:
        with pytest.raises((ValueError, TypeError)):
            session.save_facts(**wrong)
        assert len(Session.open(session.path).events) == 1


def test_impossible_values_are_refused() -> None:
    for make in (
        lambda: EyeDistance(0.063, 0.0),
        lambda: AlignmentFacts(match_age_s=-1.0),
        lambda: CameraUsed(CameraIdentity(), Intrinsics(1, 1, np.nan, 1.0, 0.0, 0.0), 0.001),
    ):
        with pytest.raises(ValueError, match="must"):
            make()


@pytest.mark.parametrize(
    ("facts", "is_kept"),
    [
        ({"plan": "both", "eye_distance": EyeDistance(0.063)}, True),
        ({"eye_distance": EyeDistance(0.064)}, False),
        ({"usable_eyes": ("left",)}, False),
        ({"verified": FACTS["verified"]}, False),
    ],
)
def test_results_go_with_a_fact_that_changes_them(
    tmp_path: Path, facts: dict[str, Any], is_kept: bool
) -> None:
    with Session.create(tmp_path, example_rig(), {}) as session:
        session.save_facts(eye_distance=EyeDistance(0.063))
        session.save_results({})
        session.save_applied({"left": [0.0, 0.0, 0.0]})
        session.save_facts(**facts)
        record = Session.open(session.path)
        held = record.is_solved, record.is_applied, record.results is not None
        assert held == (is_kept, is_kept, is_kept)
        assert (session.path / "results.json").exists() == is_kept
        assert not record.damaged
