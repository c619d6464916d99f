from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from handcal.register.verdict import Advice
from handcal.session.session import SessionRecord
from handcal.station.snapshot import Snapshot
from handcal.station.states import State
from handcal.types import EYES, Alignment, Eye, EyePlan, VerdictName
from handcal_gui.pages.wizard.planned import PlannedWizard
from handcal_gui.pages.wizard.steps import Wizard, is_complete, next_eyes
from handcal_gui.pages.wizard.view import STEPS, Action, Step
from tests.gui.views import VERIFIED, Maker, actions, judged, tried


def reach(wizard: Wizard, snapshot: Snapshot, step: Step) -> None:
    while wizard.step(snapshot) is not step:
        wizard.move(Action.NEXT, snapshot)


def aligned(record: SessionRecord, alignment: Alignment, *eyes: tuple[Eye, ...]) -> SessionRecord:
    return replace(
        record, alignments={n: replace(alignment, eyes=those) for n, those in enumerate(eyes, 1)}
    )


@pytest.fixture
def start(snapshot: Maker, record: SessionRecord) -> Snapshot:
    """Return a station just opened: everything connected, a hand held still, nothing aligned."""
    return snapshot(State.SHOW_HAND, record=replace(record, alignments={}))


@pytest.mark.parametrize(
    ("state", "step"),
    [
        (State.SHOW_HAND, Step.CONNECT),
        (State.ALIGN, Step.ALIGN),
        (State.ALIGNED, Step.SOLVE),
        (State.SOLVED, Step.SOLVE),
        (State.APPLYING, Step.SOLVE),
    ],
)
def test_the_engine_s_state_says_which_step_it_is(
    snapshot: Maker, state: State, step: Step
) -> None:
    wizard = Wizard()
    view = wizard.view(snapshot(state))
    assert view.step is step
    assert view.sentence.endswith(".")


def test_the_whole_way_of_one_eye_after_the_other(
    start: Snapshot, snapshot: Maker, record: SessionRecord, alignments: tuple[Alignment, ...]
) -> None:
    wizard = Wizard("each")
    way = []
    for step in (Step.CONNECT, Step.SHOW_HAND):
        view = wizard.view(start)
        way.append(view.main.action)
        assert (view.step, view.main.is_enabled) == (step, True)
        wizard.move(view.main.action, start)
    assert wizard.eyes(start) == ("left",)
    way.append(wizard.view(start).main.action)
    one = aligned(record, alignments[0], ("left",))
    states = (State.ALIGN, State.ALIGNED, State.SOLVED, State.APPLYING, State.APPLIED)
    way += [wizard.view(snapshot(state, record=one)).main.action for state in states]
    applied = snapshot(State.APPLIED, record=one)
    assert wizard.view(applied).main.label == "Align the right eye"
    wizard.move(Action.ANOTHER, applied)
    assert wizard.step(applied) is Step.SHOW_HAND
    assert wizard.eyes(applied) == ("right",)
    two = aligned(record, alignments[0], ("left",), ("right",))
    wizard.view(snapshot(State.ALIGN, record=two))
    applied = judged(snapshot, "accept", "accept", State.APPLIED, record=two)
    assert wizard.view(applied).main.label == "Finish"
    wizard.move(Action.NEXT, applied)
    way.append(wizard.view(applied).main.action)
    finished = snapshot(State.APPLIED, record=replace(two, is_finished=True))
    way.append(wizard.view(finished).main.action)
    assert way == [
        Action.NEXT,
        Action.NEXT,
        Action.MAKE_CURSOR,
        Action.CONFIRM,
        Action.SOLVE,
        Action.APPLY,
        Action.APPLY,
        Action.ANOTHER,
        Action.FINISH,
        Action.NEXT_WEARER,
    ]


def test_a_hand_is_needed_and_the_engine_s_reason_is_given(start: Snapshot) -> None:
    wizard = Wizard()
    reach(wizard, start, Step.SHOW_HAND)
    assert start.observation is not None
    lost = replace(start.observation, hand=None, problem="hand cut by the image border")
    view = wizard.view(replace(start, observation=lost))
    assert not view.main.is_enabled
    assert view.preconditions[0].text == "Hand cut by the image border"
    assert not wizard.view(replace(start, observation=None)).main.is_enabled


def test_a_cursor_needs_a_steady_hand(start: Snapshot) -> None:
    wizard = Wizard()
    reach(wizard, start, Step.MAKE_CURSOR)
    assert start.observation is not None
    waiting = replace(start.observation, is_steady=False, needs_delay=True)
    view = wizard.view(replace(start, observation=waiting))
    asked = view.preconditions[-1]
    assert "look slowly to the left" in view.sentence
    assert "looked slowly to the left" in asked.text
    assert not asked.holds
    restless = replace(start, observation=replace(start.observation, is_steady=False))
    assert not wizard.view(restless).main.is_enabled
    assert wizard.view(start).main.is_enabled


def test_verify_points_at_the_advice_while_an_eye_is_not_accepted(snapshot: Maker) -> None:
    wizard = Wizard("both")
    wizard.view(snapshot(State.SOLVED))
    repeat = wizard.view(judged(snapshot, "repeat", "accept", State.APPLIED))
    assert "Not accepted yet" in repeat.sentence
    accepted = wizard.view(judged(snapshot, "accept", "accept", State.APPLIED))
    assert "Not accepted yet" not in accepted.sentence


def advised(
    snapshot: Maker, advice: Mapping[Eye, tuple[tuple[Eye, ...], int]], **changes: Any
) -> Snapshot:
    """Return a snapshot in which eyes are to repeat, with the eyes and the number of alignments."""
    names: list[VerdictName] = ["repeat" if eye in advice else "accept" for eye in EYES]
    left, right = names
    seen = judged(snapshot, left, right, State.APPLIED, **changes)
    assert seen.procedure.results is not None
    given = {
        eye: Advice(eyes, count, 5.0, 0.97, meets_target=True, is_accepted=True)
        for eye, (eyes, count) in advice.items()
    }
    results = replace(seen.procedure.results, advice=given)
    return replace(seen, procedure=replace(seen.procedure, results=results))


@pytest.mark.parametrize(
    ("eyes", "label"),
    [(EYES, "Align both eyes"), (("right",), "Align the right eye"), ((), "Align both eyes")],
)
def test_an_eye_that_is_not_accepted_does_not_fit(
    snapshot: Maker, eyes: tuple[Eye, ...], label: str
) -> None:
    wizard = Wizard("both")
    wizard.view(snapshot(State.SOLVED))
    repeat = advised(snapshot, {"right": (eyes, 1)})
    view = wizard.view(repeat)
    assert (view.main.action, view.main.label) == (Action.ANOTHER, label)
    labels = [offer.label.replace("&", "") for offer in view.others]
    assert not any("fits" in one for one in labels)
    assert label.replace("the ", "") not in labels, "one action has one name"
    wizard.move(Action.ANOTHER, repeat)
    assert wizard.eyes(repeat) == (eyes or EYES)


def test_the_advice_for_the_worst_eye_comes_first(snapshot: Maker) -> None:
    wizard = Wizard("both")
    wizard.view(snapshot(State.SOLVED))
    both = advised(snapshot, {"left": (("left",), 1), "right": (("right",), 1)})
    results = both.procedure.results
    assert results is not None
    worst = max(EYES, key=lambda eye: results.benefits[eye].after_arcmin)
    assert wizard.view(both).main.label == f"Align the {worst} eye"


def test_a_result_that_must_not_be_used_does_not_fit_either(snapshot: Maker) -> None:
    wizard = Wizard("both")
    wizard.view(snapshot(State.SOLVED))
    view = wizard.view(judged(snapshot, "implausible", "accept", State.APPLIED))
    assert view.sentence.startswith("Do not use this result.")
    assert view.main.action is Action.ANOTHER
    view = wizard.view(judged(snapshot, "contradicted", "accept", State.APPLIED))
    assert view.sentence.startswith("Do not use this result.")
    assert view.main.action is Action.NEXT, "no alignment removes the evidence"


def test_only_what_a_person_need_not_decide_runs_by_itself(
    snapshot: Maker, start: Snapshot, record: SessionRecord, alignments: tuple[Alignment, ...]
) -> None:
    wizard = Wizard("each")
    runs: dict[Step | State, float | None] = {}
    for step in (Step.CONNECT, Step.SHOW_HAND, Step.MAKE_CURSOR):
        reach(wizard, start, step)
        runs[step] = wizard.view(start).runs_after_s
    one = aligned(record, alignments[0], ("left",))
    for state in (State.ALIGN, State.ALIGNED, State.SOLVED, State.APPLIED):
        runs[state] = wizard.view(snapshot(state, record=one)).runs_after_s
    assert [what for what, after_s in runs.items() if after_s is None] == [
        Step.CONNECT,
        State.ALIGN,
    ]
    two = aligned(record, alignments[0], ("left",), ("right",))
    accepted = judged(snapshot, "accept", "accept", State.APPLIED, record=two)
    assert wizard.view(accepted).runs_after_s is None  # the wearer says if it fits
    few, many = (advised(snapshot, {"left": (("left",), count)}, record=two) for count in (1, 5))
    assert wizard.view(few).runs_after_s is not None
    assert wizard.view(many).runs_after_s is None
    wizard.move(Action.NEXT, accepted)
    assert wizard.view(accepted).runs_after_s is not None
    assert wizard.view(replace(accepted, problem="the disk is full")).runs_after_s is None
    assert wizard.view(many).runs_after_s is None, "it is not accepted"
    assert wizard.view(many).sentence.startswith("Not accepted. Go back")
    finished = replace(many, record=replace(many.record, is_finished=True))
    assert "not accepted" in wizard.view(finished).sentence
    unsolved = replace(many, procedure=replace(many.procedure, results=None))
    view = wizard.view(unsolved)
    assert (view.step, view.main.action) == (Step.VERIFY, Action.SOLVE)


def test_each_solved_eye_is_verified_before_anything_is_said_to_fit(snapshot: Maker) -> None:
    wizard = Wizard("both")
    wizard.view(snapshot(State.SOLVED))
    accepted = judged(snapshot, "accept", "accept", State.APPLIED)
    labels = []
    for eyes in ((), ("left",), EYES):
        verifications = dict.fromkeys(eyes, VERIFIED)
        procedure = replace(accepted.procedure, verifications=verifications)
        view = wizard.view(replace(accepted, procedure=procedure))
        labels.append(view.main.label)
        assert (view.runs_after_s is not None) == (eyes != EYES)
    assert labels == ["Verify the left eye", "Verify the right eye", "Finish"]
    unverified = replace(
        accepted,
        procedure=replace(accepted.procedure, verifications={}),
        record=replace(accepted.record, verified_now=frozenset()),
    )
    for _ in EYES:
        assert Action.SKIP in actions(wizard.view(unverified))
        wizard.move(Action.SKIP, unverified)
    assert wizard.view(unverified).main.label == "It fits"
    again = [Action.ANOTHER, Action.VERIFY_LEFT, Action.VERIFY_RIGHT]
    assert actions(wizard.view(unverified)) == again, "what was skipped can still be done"
    wizard.move(Action.NEXT, unverified)
    assert wizard.view(unverified).unearned == {Step.VERIFY}


def test_a_restless_hand_is_not_verified(snapshot: Maker) -> None:
    wizard = Wizard("both")
    wizard.view(snapshot(State.SOLVED))
    assert wizard.view(snapshot(State.APPLIED)).main.is_enabled
    restless = snapshot(State.APPLIED, observation={"is_steady": False})
    assert not wizard.view(restless).main.is_enabled


def test_what_a_verification_leads_to_is_sent_at_the_same_step(snapshot: Maker) -> None:
    verified = {"verifications": {"left": VERIFIED}}
    view = Wizard().view(snapshot(State.APPLYING, procedure=verified))
    assert view.step is Step.VERIFY
    assert not view.main.is_enabled


def test_verify_offers_another_alignment_and_each_eye_alone(snapshot: Maker) -> None:
    wizard = Wizard("both")
    wizard.view(snapshot(State.SOLVED))
    applied = judged(snapshot, "accept", "accept", State.APPLIED)
    assert actions(wizard.view(applied)) == [
        Action.ANOTHER,
        Action.REPEAT_LEFT,
        Action.REPEAT_RIGHT,
    ]
    assert wizard.view(applied).main.label == "Finish"
    doubted = wizard.view(tried(applied))
    assert doubted.sentence.startswith("Trials of the left eye are over the target.")
    assert doubted.main.label == "Finish as it is"
    wizard.move(Action.REPEAT_RIGHT, applied)
    assert wizard.step(applied) is Step.SHOW_HAND
    assert wizard.eyes(applied) == ("right",)
    wizard.move(Action.BACK, applied)
    assert wizard.step(applied) is Step.VERIFY
    assert wizard.eyes(applied) == EYES  # the plan again


def test_a_resumed_calibration_continues_where_it_was_interrupted(
    snapshot: Maker, record: SessionRecord, alignments: tuple[Alignment, ...]
) -> None:
    wizard = Wizard("each")
    resumed = snapshot(State.APPLIED, record=aligned(record, alignments[0], ("left",)))
    assert wizard.step(resumed) is Step.CONNECT
    wizard.move(Action.NEXT, resumed)
    assert wizard.view(resumed).main.label == "Align the right eye"


def test_a_repeated_eye_stays_when_its_alignment_is_discarded(
    snapshot: Maker, start: Snapshot
) -> None:
    wizard = Wizard("both")
    wizard.view(snapshot(State.SOLVED))
    wizard.move(Action.REPEAT_LEFT, snapshot(State.APPLIED))
    wizard.view(snapshot(State.ALIGNED))
    assert wizard.step(start) is Step.SHOW_HAND  # as after a redo
    assert wizard.eyes(start) == ("left",)


def test_giving_up_a_further_cursor_keeps_what_is_solved(snapshot: Maker) -> None:
    wizard = Wizard()
    wizard.view(snapshot(State.ALIGN))
    view = wizard.view(snapshot(State.SHOW_HAND))
    assert view.step is Step.SHOW_HAND
    assert actions(view) == [Action.SOLVE]


def test_changed_alignments_are_solved_again(snapshot: Maker) -> None:
    wizard = Wizard()
    wizard.view(snapshot(State.SOLVED))
    view = wizard.view(snapshot(State.APPLIED, procedure={"results": None}))
    assert view.main.action is Action.SOLVE


def test_back_leads_through_every_free_step(start: Snapshot) -> None:
    wizard = Wizard()
    reach(wizard, start, Step.MAKE_CURSOR)
    for step in (Step.SHOW_HAND, Step.CONNECT):
        wizard.move(Action.BACK, start)
        assert wizard.step(start) is step
    assert Action.BACK not in actions(wizard.view(start))


def test_after_the_end_one_may_go_back_and_on(snapshot: Maker, record: SessionRecord) -> None:
    wizard = Wizard()
    wizard.view(snapshot(State.SOLVED))
    finished = snapshot(State.APPLIED, record=replace(record, is_finished=True))
    wizard.move(Action.NEXT, finished)
    assert wizard.view(finished).main.action is Action.NEXT_WEARER
    wizard.move(Action.BACK, finished)
    assert wizard.step(finished) is Step.VERIFY
    wizard.move(Action.NEXT, finished)
    more = snapshot(State.APPLIED, record=replace(record, is_finished=False))
    assert wizard.view(more).main.action is Action.FINISH


def test_a_plan_of_one_eye_is_complete_with_it(
    snapshot: Maker, record: SessionRecord, alignments: tuple[Alignment, ...]
) -> None:
    wizard = Wizard("left")
    wizard.view(snapshot(State.SOLVED))
    one = aligned(record, alignments[0], ("left",))
    applied = judged(snapshot, "accept", "accept", State.APPLIED, record=one)
    assert wizard.view(applied).main.label == "Finish"


@pytest.mark.parametrize(
    ("plan", "done", "wanted"),
    [
        ("both", [], EYES),
        ("both", [EYES], EYES),
        ("each", [], ("left",)),
        ("each", [("left",)], ("right",)),
        ("each", [("left",), ("right",)], ("left",)),
        ("each", [EYES, ("left",)], ("right",)),
        ("left", [("left",)], ("left",)),
        ("right", [], ("right",)),
    ],
)
def test_the_plan_says_whose_turn_it_is(
    plan: EyePlan,
    done: list[tuple[Eye, ...]],
    wanted: tuple[Eye, ...],
    alignments: tuple[Alignment, ...],
) -> None:
    made = [replace(alignments[0], eyes=eyes) for eyes in done]
    assert next_eyes(plan, made) == wanted
    planned = {"left": ("left",), "right": ("right",)}.get(plan, EYES)
    assert is_complete(plan, made) == all(any(eye in eyes for eyes in done) for eye in planned)


def test_the_engine_s_actions_are_no_moves(start: Snapshot) -> None:
    with pytest.raises(ValueError, match="engine"):
        Wizard().move(Action.SOLVE, start)
    assert len(STEPS) == 7


def test_an_eye_of_the_plan_that_is_not_aligned_leaves_align_without_a_tick(
    snapshot: Maker, record: SessionRecord, alignments: tuple[Alignment, ...]
) -> None:
    left = aligned(record, alignments[0], ("left",))
    both = aligned(record, alignments[0], ("left",), ("right",))
    for wizard in (Wizard("each"), PlannedWizard()):
        seen = [wizard.view(snapshot(State.SOLVED, record=one)).is_aligned for one in (left, both)]
        assert seen == [False, True]
