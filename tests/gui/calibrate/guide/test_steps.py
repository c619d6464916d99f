"""The guide shows the plan's next step, and takes it only while the plan is held."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from handcal.calibration.plan import PlanSettings, StepName
from handcal.calibration.states import State
from handcal.core.types import EYES, Eye, EyeShift, Verdict, VerdictName, Verification
from handcal.register.verdict import Advice
from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.guide.steps import Wizard
from handcal_gui.calibrate.guide.view import Action, ButtonSpec, Step
from tests.gui.views import (
    RECOMMENDED,
    VERIFIED,
    actions,
    begun,
    judged,
    planned_snapshot,
    tried,
    with_next,
)

Maker = Callable[..., Snapshot]
PAPER = PlanSettings("paper", in_turn=True, is_automatic=True)
BOTH = dict.fromkeys(EYES, VERIFIED)


def with_verdicts(seen: Snapshot, *names: VerdictName) -> Snapshot:
    assert seen.procedure.results is not None
    verdicts = {eye: Verdict(name, "as told") for eye, name in zip(EYES, names, strict=True)}
    results = replace(seen.procedure.results, verdicts=verdicts)
    return replace(seen, procedure=replace(seen.procedure, results=results))


@pytest.mark.parametrize(
    ("name", "step"),
    [
        (StepName.RAISE, Step.SHOW_HAND),
        (StepName.CURSOR, Step.MAKE_CURSOR),
        (StepName.ALIGN, Step.ALIGN),
        (StepName.SOLVE, Step.SOLVE),
        (StepName.APPLY, Step.SOLVE),
        (StepName.WAIT, Step.SOLVE),
        (StepName.VERIFY, Step.VERIFY),
        (StepName.NUDGE, Step.VERIFY),
        (StepName.DONE, Step.VERIFY),
    ],
)
def test_the_plan_s_next_step_is_shown(snapshot: Maker, name: StepName, step: Step) -> None:
    wizard = begun()
    for is_held in (False, True):
        wizard.is_held = is_held
        view = wizard.view(planned_snapshot(snapshot, name))
        assert view.step is step
        assert view.sentence.endswith(".")


@pytest.mark.parametrize("name", [StepName.CURSOR, StepName.SOLVE, StepName.APPLY, StepName.VERIFY])
def test_a_person_takes_a_step_only_of_a_held_plan(snapshot: Maker, name: StepName) -> None:
    wizard = begun()
    main = wizard.view(planned_snapshot(snapshot, name)).main
    assert (main.action, main.is_enabled) == (Action.TAKE_STEP, False)
    assert main.label.endswith("…")  # an activity, not an offer
    wizard.is_held = True
    held = wizard.view(planned_snapshot(snapshot, name)).main
    assert (held.action, held.is_enabled) == (Action.TAKE_STEP, True)
    assert not held.label.endswith("…")


@pytest.mark.parametrize(
    ("left", "label", "doing", "says"),
    [
        ("accept", "Send left eye", "Sending…", "the right eye keeps the offline calibration"),
        ("contradicted", "Keep offline", "Keeping offline…", "Do not use this result"),
    ],
)
def test_a_plan_says_what_is_sent_as_the_paper_s_guide_does(
    snapshot: Maker, left: VerdictName, label: str, doing: str, says: str
) -> None:
    wizard = begun()
    solved = with_verdicts(planned_snapshot(snapshot, StepName.APPLY), left, "implausible")
    assert wizard.view(solved).main.label == doing
    wizard.is_held = True
    view = wizard.view(solved)
    assert view.main.label == label
    assert says in view.sentence
    assert view.sentence.endswith(". The hand stays up.")


def test_the_plan_is_held_before_it_begins_and_after_it_ends(snapshot: Maker) -> None:
    wizard = Wizard()
    done = planned_snapshot(snapshot, StepName.DONE)
    holds = []
    for action in (Action.NEXT, Action.NEXT, Action.BACK, Action.BACK):
        holds.append(wizard.holds_plan)
        wizard.move(action)
    assert holds == [True, False, True, False]
    assert wizard.step(done) is Step.CONNECT
    wizard.move(Action.NEXT)
    wizard.is_held = True
    assert wizard.holds_plan


def test_the_state_counts_if_the_plan_s_step_is_older(snapshot: Maker) -> None:
    wizard = begun()
    cursor = planned_snapshot(snapshot, StepName.CURSOR)
    aligning = replace(cursor, procedure=replace(cursor.procedure, state=State.ALIGN))
    assert wizard.view(aligning).main.action is Action.CONFIRM


def test_the_wearer_looks_around_first_where_that_is_needed(snapshot: Maker) -> None:
    raising = planned_snapshot(snapshot, StepName.RAISE)
    assert raising.observation is not None
    waiting = replace(raising.observation, is_steady=False, needs_delay=True)
    assert begun().view(raising).sentence.startswith("Raise one bare hand")
    view = begun().view(replace(raising, observation=waiting))
    assert "look slowly to the left" in view.sentence


def test_the_wearer_keeps_the_hand_up(snapshot: Maker) -> None:
    wizard = begun()
    assert wizard.view(planned_snapshot(snapshot, StepName.ALIGN)).sentence.endswith("stays up.")
    assert wizard.view(planned_snapshot(snapshot, StepName.CURSOR)).sentence.startswith("Keep the")
    none = replace(planned_snapshot(snapshot, StepName.CURSOR).record, alignments={})
    first = planned_snapshot(snapshot, StepName.CURSOR, record=none)
    assert wizard.view(first).sentence.startswith("Hold the hand still")


@pytest.mark.parametrize(
    ("name", "is_verified", "action", "label", "says"),
    [
        ("accept", True, Action.FINISH, "Finish", "has verified"),
        ("keep", True, Action.FINISH, "Finish", "not used for every eye"),
        ("accept", False, Action.FINISH, "Finish as it is", "Not every eye has been verified"),
        ("repeat", True, Action.ANOTHER, "Add alignment", "Not good yet. Add an"),
        ("implausible", True, Action.ANOTHER, "Add alignment", "Do not use"),
        ("contradicted", True, Action.FINISH, "Finish", "Do not use this result. Finish"),
    ],
)
def test_the_end_says_what_was_reached(
    snapshot: Maker, name: VerdictName, is_verified: bool, action: Action, label: str, says: str
) -> None:
    done = planned_snapshot(snapshot, StepName.DONE, verified=BOTH if is_verified else {})
    view = begun().view(with_verdicts(done, name, name))
    assert says in view.sentence
    assert (view.main.action, view.main.label) == (action, label)
    other = Action.FINISH if action is Action.ANOTHER else Action.ANOTHER
    others = [one.action for one in view.others]
    verify = [Action.VERIFY_LEFT, Action.VERIFY_RIGHT] if name != "contradicted" else []
    use = [Action.USE_ANYWAY] if name == "keep" else []
    assert sorted(others) == sorted([other, *verify, *use])


def test_a_verification_before_the_last_alignment_is_not_of_the_result(snapshot: Maker) -> None:
    done = planned_snapshot(snapshot, StepName.DONE, verified=BOTH)
    done = with_verdicts(done, "accept", "accept")
    assert begun().view(done).sentence.startswith("The wearer has verified and")
    aligned = replace(done, record=replace(done.record, verified_now=frozenset()))
    view = begun().view(aligned)
    assert view.sentence.startswith("Verified before the alignments changed.")
    doubted = tried(done)
    view = begun().view(doubted)
    assert view.sentence.startswith("Trials of the left eye are over the target. Add an alignment")
    assert view.main.label == "Finish as it is"
    shifted = replace(doubted.record.trials[1], calibrated_shift_m=np.full(3, 0.01))
    record = replace(doubted.record, trials={1: shifted}, verified_now=frozenset())
    view = begun().view(replace(doubted, record=record))
    assert view.sentence.startswith("Verified, and tested in trials, before the alignments")
    solving = planned_snapshot(snapshot, StepName.SOLVE, verified=BOTH)
    assert begun().view(solving).step is Step.VERIFY
    solving = replace(solving, record=aligned.record)
    assert begun().view(solving).step is Step.SOLVE


def test_the_end_says_which_eye_to_verify_again(snapshot: Maker) -> None:
    done = planned_snapshot(snapshot, StepName.DONE, verified=BOTH)
    assert done.procedure.results is not None
    again = Advice((), 0, 3.0, 0.98, meets_target=True, is_accepted=False, verify=True)
    results = replace(
        done.procedure.results,
        verdicts={"left": Verdict("accept", "as told"), "right": Verdict("repeat", "as told")},
        advice={"right": again},
    )
    done = replace(done, procedure=replace(done.procedure, results=results))
    view = begun().view(done)
    assert view.sentence == (
        "Not good yet: verify the right eye again. Another alignment would change little."
    )
    assert (view.main.action, view.main.label) == (Action.VERIFY_RIGHT, "Verify the right eye")
    others = [one.action for one in view.others]
    assert others == [Action.ANOTHER, Action.VERIFY_LEFT, Action.FINISH]
    sure = replace(results.benefits["right"], after_arcmin=3.0, probability_better=0.98)
    hardly = replace(results, benefits=dict(results.benefits) | {"right": sure})
    view = begun().view(replace(done, procedure=replace(done.procedure, results=hardly)))
    assert view.sentence.startswith("Not good yet: the right eye. More would hardly change that.")
    assert view.main.action is Action.FINISH, "no step that its own forecast calls useless"
    worse = replace(results.benefits["right"], after_arcmin=20.0)
    results = replace(
        results,
        verdicts=dict.fromkeys(EYES, Verdict("repeat", "as told")),
        advice=dict.fromkeys(EYES, again),
        benefits=dict(results.benefits) | {"right": worse},
    )
    both = replace(done, procedure=replace(done.procedure, results=results))
    view = begun().view(both)
    assert "verify both eyes again" in view.sentence
    assert view.main.action is Action.VERIFY_RIGHT, "the one with the larger error first"


def test_one_usable_eye_is_the_only_one_offered(snapshot: Maker) -> None:
    for plan in (RECOMMENDED, PAPER):
        right = replace(plan, usable_eyes=("right",))
        done = planned_snapshot(snapshot, StepName.DONE, plan=right)
        assert Action.VERIFY_LEFT not in actions(begun().view(done))


def test_images_are_needed_between_begin_and_the_end(snapshot: Maker) -> None:
    wizard = Wizard()
    aligning, done = (planned_snapshot(snapshot, name) for name in (StepName.ALIGN, StepName.DONE))
    assert not wizard.needs_frames(aligning)
    wizard.move(Action.NEXT)
    assert wizard.needs_frames(aligning)
    assert not wizard.needs_frames(done)


def test_every_other_action_is_the_engine_s() -> None:
    with pytest.raises(ValueError, match="engine"):
        begun().move(Action.TAKE_STEP)


@pytest.mark.parametrize("state", [State.SHOW_HAND, State.APPLIED])
def test_alignments_without_a_result_are_solved_again_also_from_save(
    snapshot: Maker, state: State
) -> None:
    wizard = begun()
    done = planned_snapshot(snapshot, StepName.DONE, verified=BOTH)
    wizard.move(Action.NEXT)
    assert wizard.step(done) is Step.SAVE
    changed = planned_snapshot(snapshot, StepName.SOLVE, results=None)
    changed = replace(changed, procedure=replace(changed.procedure, state=state))
    assert wizard.step(changed) is Step.SOLVE
    assert not wizard.holds_plan, "the station solves by itself"
    wizard.is_held = True
    view = wizard.view(changed)
    assert view.sentence == "The alignments have changed. Solve again."
    assert (view.main.action, view.main.label) == (Action.TAKE_STEP, "Solve")
    assert view.main.is_enabled


def test_a_held_plan_does_not_say_that_the_next_cursor_follows(snapshot: Maker) -> None:
    wizard = begun()
    cursor = planned_snapshot(snapshot, StepName.CURSOR)
    assert wizard.view(cursor).sentence.endswith("follows at once.")
    wizard.is_held = True
    assert wizard.view(cursor).sentence.startswith("Keep the hand up, and make the next cursor")


def test_the_first_verification_says_that_the_other_eye_follows(snapshot: Maker) -> None:
    wizard = begun()
    some: list[dict[Eye, Verification]] = [{}, {"left": VERIFIED}]
    texts = [
        wizard.view(
            planned_snapshot(snapshot, StepName.VERIFY, verified=verified)
        ).sentence.partition("error of ")[2]
        for verified in some
    ]
    assert texts == ["each eye, the left first.", "the left eye."]


def test_in_the_paper_s_plan_the_hand_may_be_lowered(snapshot: Maker) -> None:
    for name in (StepName.ALIGN, StepName.SOLVE, StepName.APPLY, StepName.WAIT, StepName.CURSOR):
        says = begun().view(planned_snapshot(snapshot, name, plan=PAPER)).sentence
        assert "stays up" not in says
        assert "Keep the hand up" not in says
    solving = planned_snapshot(snapshot, StepName.SOLVE, plan=PAPER)
    assert begun().view(solving).sentence.endswith("The wearer may lower the hand.")
    asking = planned_snapshot(snapshot, StepName.VERIFY, plan=PAPER)
    assert begun().view(asking).sentence.startswith("Raise the hand and hold it still to measure")


def test_the_plan_names_the_eyes_of_the_next_alignment(snapshot: Maker) -> None:
    raising = planned_snapshot(snapshot, StepName.RAISE, plan=PAPER)
    raising = with_next(raising, eyes=("right",), awaited=StepName.CURSOR)
    view = begun().view(raising)
    assert view.sentence.startswith("For the right eye: raise one bare hand")
    first = replace(raising, record=replace(raising.record, alignments={}))
    assert begun().view(first).sentence.startswith("Raise one bare hand")


def test_a_hand_is_waited_for_at_the_step_that_needs_it(snapshot: Maker) -> None:
    raising = planned_snapshot(snapshot, StepName.RAISE, plan=PAPER)
    assert raising.observation is not None
    lost = replace(raising.observation, hand=None, is_steady=False, problem="hand cut")
    waiting = replace(with_next(raising, awaited=StepName.VERIFY), observation=lost)
    view = begun(is_held=True).view(waiting)
    assert (view.step, view.main.is_enabled) == (Step.VERIFY, False)
    assert view.main.label == "Verify the left eye"
    assert view.preconditions[0].text == "Hand cut"
    assert Action.SKIP in actions(view), "a wearer who cannot verify is not waited for"


def test_a_step_that_is_refused_does_not_pretend_to_send(snapshot: Maker) -> None:
    waiting = planned_snapshot(snapshot, StepName.WAIT, plan=PAPER)
    why = "the session is full; start another session"
    refused = with_next(waiting, text=why, is_requested=True)
    procedure = replace(refused.procedure, state=State.APPLIED, is_applied=True)
    view = begun().view(replace(refused, procedure=procedure))
    assert view.sentence == "The session is full; start another session."
    assert view.main.label == "Waiting…"
    assert actions(view) == [Action.WITHDRAW]


def test_a_requested_alignment_can_be_withdrawn_and_a_half_done_plan_ended(
    snapshot: Maker,
) -> None:
    cursor = planned_snapshot(snapshot, StepName.CURSOR, plan=PAPER)
    assert actions(begun().view(with_next(cursor, is_requested=True))) == [Action.WITHDRAW]
    assert cursor.procedure.results is not None
    left: dict[Eye, EyeShift] = {"left": cursor.procedure.results.eyes["left"]}
    results = replace(cursor.procedure.results, eyes=left)
    one = replace(cursor, procedure=replace(cursor.procedure, results=results))
    view = begun().view(one)
    assert view.others[0] == ButtonSpec(Action.FINISH, "Fini&sh with one eye")
    before = replace(cursor, procedure=replace(cursor.procedure, results=None))
    assert actions(begun().view(before)) == [Action.BACK]


def test_the_paper_s_plan_offers_each_eye_alone_at_its_end(snapshot: Maker) -> None:
    done = judged(snapshot, "accept", "accept", State.APPLIED, plan=PAPER)
    assert actions(begun().view(done)) == [
        Action.ANOTHER,
        Action.REPEAT_LEFT,
        Action.REPEAT_RIGHT,
    ]
    skipped = replace(done, record=replace(done.record, verified_now=frozenset({"left"})))
    assert actions(begun().view(skipped)) == [Action.ANOTHER, Action.VERIFY_RIGHT]


def test_finish_leads_to_the_last_page_and_back_again(snapshot: Maker) -> None:
    wizard = begun()
    done = judged(snapshot, "accept", "accept", State.APPLIED)
    wizard.move(Action.FINISH)
    assert wizard.step(done) is Step.SAVE
    wizard.move(Action.FINISH)  # of a session that was continued
    assert wizard.step(done) is Step.SAVE
    finished = replace(done, record=replace(done.record, is_finished=True))
    view = wizard.view(finished)
    assert view.main.action is Action.NEXT_WEARER
    assert Action.SLIPPED in actions(view)
    wizard.move(Action.BACK)
    assert wizard.step(finished) is Step.VERIFY


def test_an_eye_of_the_plan_that_is_not_aligned_leaves_align_without_a_tick(
    snapshot: Maker,
) -> None:
    solving = planned_snapshot(snapshot, StepName.APPLY)
    left = replace(next(iter(solving.record.alignments.values())), eyes=("left",))
    half = replace(solving, record=replace(solving.record, alignments={1: left}))
    assert [begun().view(one).is_aligned for one in (half, solving)] == [False, True]
    alone = replace(half, plan=replace(half.plan, usable_eyes=("left",)))
    assert begun().view(alone).is_aligned
