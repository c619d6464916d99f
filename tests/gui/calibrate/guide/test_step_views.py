"""The views that the snapshot alone decides."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pytest

from handcal.calibration.states import CalibrationSettings, State
from handcal.calibration.verifying import VerifyingView
from handcal.core.errors import FileError
from handcal.core.types import EYES, Eye, VerdictName, Verification
from handcal.hand.settings import SegmentSettings
from handcal.link.nudges import NudgeSum
from handcal.register.results import results_json
from handcal.register.verdict_words import VERDICT_WORDS
from handcal.session.session import SessionRecord
from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.guide.steps import Wizard, connect_view, distance, hand_found, save_view
from handcal_gui.calibrate.guide.view import Action, ButtonSpec, Precondition, Step
from tests.gui.views import (
    NUDGED,
    VERIFIED,
    Maker,
    actions,
    begun,
    fine_tuned,
    judged,
    tried,
    with_target,
)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"camera": {"problem": "no camera is connected; plug one in"}}, "No image"),
        ({"link": {"connected": False}, "link_problem": "no headset is connected"}, "No headset"),
        ({"link": {"pose_rate_hz": 0.0}}, "No pose"),
        ({"link": {"pose_rate_hz": 59.0, "connected": False}}, "No pose"),
    ],
)
def test_connect_waits_for_camera_headset_and_poses(
    snapshot: Maker, changes: dict[str, Any], complaint: str
) -> None:
    view = Wizard().view(snapshot(State.SHOW_HAND, **changes))
    assert not view.main.is_enabled
    assert [check for check in view.preconditions if complaint in check.text and not check.holds]


def test_a_camera_against_which_there_is_evidence_is_not_ticked(snapshot: Maker) -> None:
    seen = replace(snapshot(State.SHOW_HAND), contradiction="the camera is not the rig's")
    camera = Wizard().view(seen).preconditions[0]
    assert (camera.text, camera.holds) == ("The camera is not the rig's", False)


def test_align_tells_which_eye_to_close_and_why_it_was_refused(snapshot: Maker) -> None:
    refusal = "Your hand is turned by 14.0°, more than 9°."
    seen = {"is_over_limit": True}
    view = begun().view(
        snapshot(procedure={"eyes": ("left",), "refusal": refusal}, observation=seen)
    )
    assert view.sentence.startswith("Close the right eye.")
    assert view.note == refusal
    assert not view.preconditions[1].holds
    lost = {"hand": None, "cloud": None, "problem": "hand cut by the image border"}
    assert not begun().view(snapshot(procedure={"refusal": refusal}, observation=lost)).note
    assert begun().view(snapshot()).preconditions[1].holds


def test_a_refusal_becomes_past_and_orders_nothing(snapshot: Maker) -> None:
    refused = {"refusal": "Tilt your hand.", "refused_for": "Your hand was turned by 18.6°"}
    view = begun().view(snapshot(procedure=refused))
    assert (view.note, view.fact) == ("", "Last refused: your hand was turned by 18.6°.")


@pytest.mark.parametrize(
    ("turned_deg", "has_changed", "text"),
    [
        (18.6, False, "Turned 18.6°: tilt your hand anticlockwise"),
        (-18.6, True, "Turned 18.6°: tilt your hand clockwise"),
        (7.7, True, "Thumb 10 mm further out than in the cursor"),
    ],
)
def test_align_says_how_the_hand_differs_from_the_cursor(
    snapshot: Maker, turned_deg: float, has_changed: bool, text: str
) -> None:
    seen = {
        "rotation_rad": np.radians([0.0, 0.0, turned_deg]),
        "is_over_limit": True,
        "has_changed": has_changed,
        "shape_text": "thumb 10 mm further out than in the cursor",
    }
    view = begun().view(snapshot(observation=seen))
    assert view.preconditions[1] == Precondition(text, False)


def test_a_second_press_does_not_confirm_the_hand_that_made_the_cursor(snapshot: Maker) -> None:
    now = snapshot()
    assert not begun().view(now).main.is_enabled
    later = replace(now, t_host_ns=now.t_host_ns + 2_000_000_000)
    assert begun().view(later).main.is_enabled


@pytest.mark.parametrize("seen", [{"is_over_limit": True}, {"problem": "no hand", "hand": None}])
@pytest.mark.parametrize("verifying", [None, NUDGED])
def test_no_confirmation_is_offered_beside_a_condition_that_is_not_met(
    snapshot: Maker, verifying: VerifyingView | None, seen: dict[str, Any]
) -> None:
    procedure = {"verifying": verifying}
    state = State.ALIGN if verifying is None else State.VERIFY
    for changes in ({}, seen):
        now = snapshot(state, procedure=procedure, observation=changes)
        for at_ns in (now.t_host_ns, now.t_host_ns + 2_000_000_000):
            view = begun().view(replace(now, t_host_ns=at_ns))
            assert view.main.is_enabled == all(one.holds for one in view.preconditions)


def test_solve_shows_the_verdicts_before_anything_is_sent(snapshot: Maker) -> None:
    view = begun().view(snapshot(State.SOLVED, not_stored="the disk is full; free some space"))
    assert [check.text.split(":")[0] for check in view.preconditions] == [
        "Left eye",
        "Right eye",
    ]
    assert not view.note, "the banner says it"
    assert actions(view) == [Action.REDO]
    assert not begun().view(snapshot(State.APPLYING)).main.is_enabled


def test_only_an_accepted_eye_is_ticked(snapshot: Maker) -> None:
    for name in get_args(VerdictName):
        checks = begun().view(judged(snapshot, name, "accept", State.SOLVED)).preconditions
        assert [(c.verdict, c.holds) for c in checks] == [
            (name, name == "accept"),
            ("accept", True),
        ]


NOT_USED: list[VerdictName] = ["implausible", "contradicted"]


@pytest.mark.parametrize("name", NOT_USED)
def test_of_a_result_that_must_not_be_used_the_offline_calibration_is_kept(
    snapshot: Maker, name: VerdictName
) -> None:
    view = begun(is_held=True).view(judged(snapshot, "accept", name, State.SOLVED))
    assert view.sentence == (
        "Send the left eye's projection; the right eye keeps the offline calibration: its result "
        f"is {VERDICT_WORDS[name].lower()}. The wearer may lower the hand."
    )
    assert view.main == ButtonSpec(Action.TAKE_STEP, "Send left eye")
    assert actions(view) == [Action.REDO]
    assert all(offer.discards for offer in view.others), "by a click or its letter only"
    none = begun(is_held=True).view(judged(snapshot, name, name, State.SOLVED))
    assert none.sentence.startswith("Do not use this result: keep the offline")
    assert "of both eyes" in none.sentence
    assert none.main == ButtonSpec(Action.TAKE_STEP, "Keep offline")


@pytest.mark.parametrize(
    ("name", "main"),
    [
        ("implausible", ButtonSpec(Action.ANOTHER, "Add alignment")),
        ("contradicted", ButtonSpec(Action.FINISH, "Finish")),
    ],
)
def test_after_one_eye_that_must_not_be_used_the_next_step_repeats_or_ends(
    snapshot: Maker, record: SessionRecord, name: VerdictName, main: ButtonSpec
) -> None:
    left = replace(next(iter(record.alignments.values())), eyes=("left",))
    one = replace(record, alignments={1: left})
    view = begun().view(judged(snapshot, name, name, State.APPLIED, record=one))
    assert view.sentence.startswith("Do not use this result.")
    assert view.main == main


@pytest.mark.parametrize(
    ("left", "right", "sentence", "label"),
    [
        ("keep", "keep", "Keep the offline calibration of both eyes.", "Keep offline"),
        (
            "keep",
            "accept",
            "Send the right eye's projection; the left eye keeps the offline calibration.",
            "Send right eye",
        ),
    ],
)
def test_solve_says_which_offline_calibration_is_kept(
    snapshot: Maker, left: VerdictName, right: VerdictName, sentence: str, label: str
) -> None:
    view = begun(is_held=True).view(judged(snapshot, left, right, State.SOLVED))
    assert view.sentence == f"{sentence} The wearer may lower the hand."
    assert view.main.label == label
    assert view.main.is_enabled


def test_a_verification_tells_how_far_the_outline_was_moved(snapshot: Maker) -> None:
    triple = (0.0, 0.0, 0.0)
    moved = VerifyingView("left", NudgeSum(-3.0, 4.0, -0.006), triple, triple, can_undo=True)
    seen = snapshot(
        State.VERIFY, procedure={"verifying": moved, "refusal": "Hold your hand still."}
    )
    view = begun().view(seen)
    assert view.step is Step.VERIFY
    assert view.sentence.startswith("Close the right eye.")
    assert view.fact == "Left eye's outline moved by 5.0′: 3.0′ left, 4.0′ down, size −0.6\u00a0%"
    assert view.note == "Hold your hand still."
    assert view.main.action is Action.VERIFIED
    assert actions(view) == [Action.UNDO_NUDGE, Action.SKIP]
    before: dict[Eye, Verification] = {"left": Verification(triple, (0.0, 0.0), triple)}
    facts = replace(seen.record.facts, verified=before)
    again = replace(seen, record=replace(seen.record, facts=facts))
    assert begun().view(again).sentence == f"Once more, to be sure. {view.sentence}"


def test_a_drawing_is_not_confirmed_before_anyone_can_have_looked(snapshot: Maker) -> None:
    def can_confirm(ago_s: float) -> bool:
        seen = snapshot(State.VERIFY, procedure={"verifying": NUDGED})
        began = replace(NUDGED, began_host_ns=seen.t_host_ns - round(1e9 * ago_s))
        seen = replace(seen, procedure=replace(seen.procedure, verifying=began))
        return begun().view(seen).main.is_enabled

    assert [can_confirm(ago_s) for ago_s in (0.1, 1.4, 1.6)] == [False, False, True]


def test_without_the_headset_nothing_is_confirmed(snapshot: Maker) -> None:
    for connected in (True, False):
        seen = snapshot(
            State.VERIFY, procedure={"verifying": NUDGED}, link={"connected": connected}
        )
        assert begun().view(seen).main.is_enabled == connected
        aligning = snapshot(
            State.ALIGN, link={"connected": connected}, t_host_ns=seen.t_host_ns + 2 * 10**9
        )
        assert begun().view(aligning).main.is_enabled == connected


def test_without_an_image_no_hand_is_said_to_be_missing(snapshot: Maker) -> None:
    for problem, text in (("", "No hand in view"), ("unplugged", "No image from the camera")):
        seen = snapshot(State.SHOW_HAND, observation=None, camera={"problem": problem})
        assert hand_found(seen) == Precondition(text, False)


def test_the_last_step_ticks_only_what_was_verified(snapshot: Maker) -> None:
    wizard = begun()
    accepted = judged(snapshot, "accept", "accept", State.APPLIED)
    repeat = judged(snapshot, "repeat", "accept", State.APPLIED)
    wizard.view(accepted)
    wizard.move(Action.NEXT)
    assert not wizard.view(accepted).unearned
    view = wizard.view(repeat)
    assert view.unearned == {Step.VERIFY}
    assert [check.holds for check in view.preconditions[1:]] == [False, True]


def test_a_full_disk_is_reported_at_the_last_step(snapshot: Maker) -> None:
    wizard = begun()
    full = snapshot(State.APPLIED, not_stored=str(FileError("the disk is full")))
    wizard.move(Action.NEXT)
    view = wizard.view(full)
    assert not view.preconditions[0].holds
    assert not view.note, "the banner says it"


def test_the_distance_of_the_hand_follows_from_the_depth_gate(snapshot: Maker) -> None:
    def said(near_m: float, far_m: float) -> str:
        gate = SegmentSettings(depth_min_m=near_m, depth_max_m=far_m)
        return distance(snapshot(State.SHOW_HAND, settings=CalibrationSettings(segment=gate)))

    assert said(0.35, 0.70) == "at forearm's length, 40 to 65 cm from the camera"
    assert said(0.55, 2.00) == "60 to 70 cm from the camera"


def test_a_result_that_trials_contradict_is_not_finished_at_once(snapshot: Maker) -> None:
    accepted = judged(snapshot, "accept", "accept", State.APPLIED)
    assert begun().view(accepted).main == ButtonSpec(Action.FINISH, "Finish")
    full = replace(accepted, not_stored="the disk is full")
    assert begun().view(full).main == ButtonSpec(Action.NEXT, "Finish")
    seen = tried(accepted)
    assert begun().view(seen).main == ButtonSpec(Action.FINISH, "Finish as it is")
    assert save_view(seen).sentence.startswith("Trials of the left eye are over the target. Go")
    finished = replace(seen, record=replace(seen.record, is_finished=True))
    said = save_view(finished).sentence
    assert said.startswith("The session is finished, but trials of the left eye are over")
    mild = replace(seen, settings=with_target(1e3))
    assert begun().view(mild).main.action is Action.FINISH
    assert save_view(mild).sentence.startswith("Everything is already saved.")


def test_a_result_no_better_than_before_can_be_used_anyway_or_verified_again(
    snapshot: Maker,
) -> None:
    kept = judged(snapshot, "accept", "keep", State.APPLIED)
    kept = replace(kept, record=applied_record(kept))
    view = begun().view(kept)
    assert actions(view) == [Action.USE_ANYWAY, Action.VERIFY_RIGHT, Action.ANOTHER]
    assert save_view(kept).unearned == {Step.VERIFY}, "not every eye is good"
    finished = replace(kept, record=replace(kept.record, is_finished=True))
    assert "not used for the right eye" in save_view(finished).sentence
    results = kept.procedure.results
    assert results is not None
    solved_m = {eye: shift.shift_m for eye, shift in results.eyes.items()}
    used = replace(kept, record=fine_tuned(kept.record, solved_m))
    used = replace(used, record=replace(used.record, applied_shift_m=solved_m))
    assert actions(begun().view(used))[0] is Action.KEEP_OFFLINE
    good = judged(snapshot, "accept", "accept", State.APPLIED)
    assert not {Action.USE_ANYWAY, Action.KEEP_OFFLINE} & {*actions(begun().view(good))}
    assert not save_view(good).unearned


def test_what_the_headset_draws_for_the_moment_is_said(snapshot: Maker) -> None:
    seen = judged(snapshot, "accept", "accept", State.APPLIED)
    seen = replace(seen, record=applied_record(seen))
    assert begun().view(seen).fact == ""
    moved_m = {**seen.procedure.applied_shift_m, "left": np.full(3, 0.009)}
    trial = replace(
        seen, trial_eye="left", procedure=replace(seen.procedure, applied_shift_m=moved_m)
    )
    assert begun().view(trial).fact == (
        "The headset draws the left eye with another φ for the moment: it is moved for a trial."
    )
    back_m = {eye: np.zeros(3) for eye in EYES}
    back = replace(
        seen,
        record=replace(seen.record, applied_shift_m=back_m, fine_tuned=back_m),
        procedure=replace(
            seen.procedure,
            applied_shift_m=back_m,
            former_shift_m=seen.procedure.applied_shift_m,
        ),
    )
    assert begun().view(back).fact == "Press G to return to the newest φ."


def applied_record(seen: Snapshot) -> SessionRecord:
    """Return the record of a session whose results were applied."""
    results = seen.procedure.results
    assert results is not None
    return replace(
        seen.record,
        results=results_json(results),
        is_solved=True,
        is_applied=True,
        applied_shift_m=results.rendered_shift_m,
    )


def test_begin_is_grey_on_a_failed_check(snapshot: Maker, record: SessionRecord) -> None:
    none = replace(record, alignments={})
    ready = connect_view(snapshot(State.SHOW_HAND, record=none))
    assert ready.main.is_enabled
    failed = connect_view(
        snapshot(State.SHOW_HAND, record=none, contradiction="the camera is not the rig's")
    )
    assert not failed.main.is_enabled
    assert failed.sentence.startswith("A check has failed.")
    # A result that is there can be looked at, whatever was found against it.
    found = snapshot(State.APPLIED, contradiction="the camera is not the rig's")
    assert connect_view(found).main.is_enabled


def test_a_confirmation_waits_for_enough_images_and_says_so(snapshot: Maker) -> None:
    for state, procedure in ((State.ALIGN, {}), (State.VERIFY, {"verifying": NUDGED})):
        few, enough = (
            begun().view(
                snapshot(
                    state,
                    procedure=procedure,
                    camera={"rate_hz": rate_hz},
                    t_host_ns=2_000_000_000_000,
                )
            )
            for rate_hz in (3.0, 4.0)
        )
        assert few.preconditions[0] == Precondition(
            "Images per second: 3 of the 4 needed. Close other programs.", False
        )
        assert not few.main.is_enabled
        assert enough.main.is_enabled


def test_a_verification_in_which_a_session_stopped_goes_on_at_once(snapshot: Maker) -> None:
    wizard, seen = Wizard(), snapshot(State.VERIFY, procedure={"verifying": NUDGED})
    assert wizard.view(seen).step is Step.VERIFY, "the wearer is asked, so the guide says it"
    wizard.move(Action.BACK)
    assert wizard.view(seen).step is Step.CONNECT


def test_a_resumed_session_says_that_it_continues(snapshot: Maker, record: SessionRecord) -> None:
    new = connect_view(snapshot(State.SHOW_HAND, record=replace(record, alignments={})))
    assert (new.main.label, new.fact) == ("Begin", "")
    resumed = connect_view(snapshot(State.APPLIED, verified={"left": VERIFIED}))
    count = len(record.alignments)
    assert resumed.main.label == "Continue"
    assert resumed.fact == (
        f"This session continues where it stopped, with {count} alignment{'s' * (count > 1)}, "
        "1 verified eye."
    )


def test_after_a_slip_the_earlier_result_is_said_to_be_used_again(
    snapshot: Maker, record: SessionRecord
) -> None:
    again = replace(record, facts=replace(record.facts, former="ada-1"), alignments={})
    view = connect_view(snapshot(State.SHOW_HAND, record=again))
    assert view.sentence.startswith("Make sure that the headset sits well")
    assert view.fact.startswith("The former result is used again (ada-1)")
