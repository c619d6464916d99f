"""A plan's next step, decided from the calibration's state, and done when the hand is still."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from handcal.calibration.plan import NextStep, Plan, PlanSettings, StepName
from handcal.calibration.states import ProcedureError, State
from handcal.calibration.verifying import skipped_eyes
from handcal.core.display import view_of_eye
from handcal.core.geometry import transform
from handcal.core.types import EYES, Eye, EyeDistance
from handcal.link.client import HeadsetClient
from handcal.link.nudges import NudgeSum
from handcal.link.server import HeadsetServer
from handcal.register.placement import PlacementSettings
from handcal.session.session import Session
from tests.calibration.stage import HEADSET_AHEAD_NS, RIG, Stage
from tests.helpers import eventually

RECOMMENDED = PlanSettings("recommended", is_automatic=True)
# The hand of these tests does not move, so no other place may be in the camera's range.
AT_THE_HAND = PlacementSettings(farthest_m=0.1, fewest=2, most=2, verifications=1)
ONCE = PlacementSettings(fewest=1, most=1, verifications=1)


class Planned:
    """A stage that follows a plan."""

    def __init__(self, stage: Stage, settings: PlanSettings, verifies_first: bool = False) -> None:
        self.stage = stage
        self.plan = Plan(stage.calibration, settings, verifies_first)

    def advance(self, frames: int = 1) -> NextStep:
        for _ in range(frames):
            self.plan.advance(self.stage.frame(), is_pressed=True)
        return self.step

    def follow(self) -> NextStep:
        """See a frame; the plan takes its step by itself once it is due."""
        self.plan.advance(self.stage.frame())
        return self.step

    @property
    def step(self) -> NextStep:
        assert self.plan.step is not None
        return self.plan.step

    def until(self, name: StepName, frames: int = 60) -> NextStep:
        for _ in range(frames):
            step = self.advance()
            if self.stage.state() is State.APPLYING:
                self.stage.calibration.wait_applied()
            if step.name is name:
                return step
            if step.name is StepName.WAIT:
                eventually(lambda: self.stage.calibration.is_applied)
        raise AssertionError(f"{name} was not reached; the plan is at {step}")

    def confirm(self) -> None:
        """Confirm on the display's cursor, with the hand as it is."""
        calibration = self.stage.calibration
        eventually(lambda: self.stage.shown().cursor_W_m is not None and calibration.is_applied)
        self.stage.press()

    def fits(self, eye: Eye) -> None:
        """Move the drawing by one press, and confirm that it fits."""
        self._say(eye, fits=False)
        self.stage.see()
        self._say(eye, fits=True)

    def _say(self, eye: Eye, fits: bool) -> None:
        eventually(lambda: self.stage.shown().verify is not None)
        eventually(lambda: self.stage.calibration.is_applied)
        shown = self.stage.shown()
        assert shown.verify is not None
        assert shown.verify.eye == eye
        t_ns = self.stage.t_ns + HEADSET_AHEAD_NS
        nudge = self.stage.client.nudge(t_ns, shown, NudgeSum(1.0), fits)
        self.stage.client.wait_acked(nudge, 5.0)
        self.stage.wait_checked()


@pytest.fixture
def make(server: HeadsetServer, client: HeadsetClient, session: Session) -> Callable[..., Planned]:
    def build(settings: PlanSettings = RECOMMENDED, verifies_first: bool = False) -> Planned:
        session.save_facts(plan=settings.name, usable_eyes=settings.usable_eyes)
        stage = Stage(server, client, session)
        return Planned(stage, settings, verifies_first)

    return build


def test_one_raise_serves_all_alignments_left_right_and_both(
    make: Callable[..., Planned],
) -> None:
    """The simulated hand stays where it was raised, and the cursors are that hand, moved."""
    planned = make(replace(RECOMMENDED, placement=PlacementSettings(fewest=3, most=3)))
    assert planned.advance().name is StepName.RAISE
    raised = None
    cursors = []
    for eyes in (("left",), ("right",), EYES):
        step = planned.until(StepName.CURSOR)
        assert set(step.eyes) == set(eyes)
        calibration = planned.stage.calibration
        assert raised is None or calibration.raised is raised
        raised, cursor = calibration.raised, calibration.cursor
        assert raised is not None
        assert cursor is not None
        moved_m = cursor.points_W_m - raised.points_W_m
        np.testing.assert_allclose(moved_m, np.broadcast_to(moved_m[0], moved_m.shape), atol=1e-12)
        cursors.append(cursor)
        assert planned.advance().name is StepName.ALIGN
        # The hand itself is the cursor's place for a wearer who need not move.
        planned.confirm()
        planned.until(StepName.SOLVE)
    assert [one.eyes for one in planned.stage.calibration.alignments.values()] == [
        ("left",),
        ("right",),
        ("left", "right"),
    ]
    assert raised is not None
    # Nearer than the raised hand, as near as the camera can see.
    T_E_W = view_of_eye(RIG.eyes["left"], planned.stage.calibration.T_W_H(raised))
    depths_m = [transform(T_E_W, one.points_W_m)[:, 2].mean() for one in (raised, cursors[0])]
    assert depths_m[1] < depths_m[0] + 1e-3


def test_every_eye_is_verified_and_then_the_hand_may_be_lowered(
    make: Callable[..., Planned], session: Session
) -> None:
    planned = make(replace(RECOMMENDED, placement=AT_THE_HAND))
    for _ in EYES:
        planned.until(StepName.CURSOR)
        planned.confirm()
        planned.until(StepName.SOLVE)
    for eye in EYES:
        assert planned.until(StepName.VERIFY).eyes == (eye,)
        assert planned.advance().name is StepName.NUDGE
        planned.fits(eye)
    step = planned.until(StepName.DONE)
    assert step.text
    assert set(Session.open(session.path).facts.verified) == set(EYES)
    eventually(lambda: planned.stage.shown().prompt == "")
    assert planned.stage.calibration.raised is None


def test_a_stored_calibration_is_verified_before_anything_else(
    make: Callable[..., Planned],
) -> None:
    planned = make(verifies_first=True)
    for eye in EYES:
        assert planned.until(StepName.VERIFY).eyes == (eye,)
        planned.fits(eye)
    # Good as it is: kept without an alignment. Otherwise alignments follow.
    step = planned.until(StepName.DONE)
    results = planned.stage.calibration.results
    assert results is not None
    assert {one.name for one in results.verdicts.values()} <= {"accept", "keep"}
    assert not planned.stage.calibration.alignments
    assert "verdict" in step.text


def test_the_whole_recommended_plan_with_one_usable_eye(make: Callable[..., Planned]) -> None:
    planned = make(replace(RECOMMENDED, placement=AT_THE_HAND, usable_eyes=("right",)))
    for _ in range(AT_THE_HAND.most):
        assert planned.until(StepName.CURSOR).eyes == ("right",)
        planned.confirm()
    assert planned.until(StepName.VERIFY).eyes == ("right",)
    planned.fits("right")
    planned.until(StepName.DONE)
    calibration = planned.stage.calibration
    assert [one.eyes for one in calibration.alignments.values()] == [("right",)] * 2
    assert calibration.results is not None
    assert set(calibration.results.eyes) == set(calibration.verifications) == {"right"}


def test_what_is_left_is_solved_again_after_an_alignment_was_deleted(
    make: Callable[..., Planned],
) -> None:
    planned = make(replace(RECOMMENDED, placement=AT_THE_HAND, verify=False))
    calibration = planned.stage.calibration
    for _ in range(AT_THE_HAND.most):
        planned.until(StepName.CURSOR)
        planned.confirm()
    planned.until(StepName.DONE)
    calibration.delete_alignment(2)
    assert planned.plan.next_step(is_steady=False).name is StepName.SOLVE
    assert planned.advance().name is StepName.SOLVE
    assert calibration.results is not None
    assert list(calibration.results.alignments) == [1]
    # The place that has become free is filled, with what is known from the rest.
    assert planned.until(StepName.CURSOR).eyes == ("right",)


def test_a_skipped_eye_is_not_verified_by_the_plan(
    make: Callable[..., Planned], session: Session
) -> None:
    planned = make(replace(RECOMMENDED, placement=ONCE, usable_eyes=("left",)))
    planned.until(StepName.ALIGN)
    planned.confirm()
    planned.until(StepName.NUDGE)
    planned.plan.skip("left")
    assert planned.stage.state() is State.APPLIED
    planned.until(StepName.DONE)
    assert planned.stage.calibration.verifications == {}
    assert skipped_eyes(Session.open(session.path).events) == {"left"}


PAPER = PlanSettings("paper", is_automatic=True, verify=False)


def test_the_paper_s_plan_makes_its_alignments_in_turn_and_ends(
    make: Callable[..., Planned], session: Session
) -> None:
    planned = make(replace(PAPER, in_turn=True, alignments=2))
    for eye in ("left", "right", "left", "right"):
        assert planned.until(StepName.CURSOR).eyes == (eye,)
        planned.confirm()
        planned.until(StepName.APPLY)
    assert planned.until(StepName.DONE).text == "every alignment is made"
    eyes = [one.eyes for one in session.contents.alignments.values()]
    assert eyes == [("left",), ("right",), ("left",), ("right",)]


def test_a_wearer_sees_what_comes_before_the_paper_s_plan_begins_it(
    make: Callable[..., Planned],
) -> None:
    planned = make(PAPER)
    began_ns, step = 0, planned.plan.next_step(is_steady=False)
    while planned.stage.state() is not State.ALIGN:
        step = planned.follow()
        if step.name is StepName.CURSOR:
            began_ns = began_ns or planned.stage.t_ns
    assert began_ns
    assert planned.stage.t_ns - began_ns >= 1_200_000_000
    held = make(replace(PAPER, is_automatic=False))
    for _ in range(30):
        step = held.follow()
    assert step.name is StepName.CURSOR
    assert held.stage.state() is State.SHOW_HAND


def test_one_more_alignment_is_made_when_a_person_asks_for_it(
    make: Callable[..., Planned],
) -> None:
    planned = make(PAPER)
    planned.until(StepName.CURSOR)
    planned.confirm()
    planned.until(StepName.DONE)
    planned.plan.request(("right",))
    step = planned.plan.next_step(is_steady=False)
    assert (step.name, step.eyes, step.is_requested) == (StepName.RAISE, ("right",), True)
    planned.plan.withdraw()
    assert planned.advance().name is StepName.DONE
    planned.plan.request()
    assert planned.until(StepName.CURSOR).eyes == EYES
    planned.stage.calibration.redo()
    assert planned.until(StepName.CURSOR).is_requested, "until it is made"
    planned.confirm()
    planned.until(StepName.DONE)
    assert len(planned.stage.calibration.alignments) == 2


def test_the_eyes_of_the_paper_s_plan_are_chosen_between_alignments(
    make: Callable[..., Planned], session: Session
) -> None:
    planned = make(PAPER)
    planned.until(StepName.CURSOR)
    with pytest.raises(ProcedureError, match="the eyes cannot be changed now"):
        planned.plan.choose("right")
    assert planned.plan.settings == PAPER
    planned.confirm()
    planned.until(StepName.DONE)
    planned.plan.choose("each")
    assert session.contents.facts.plan == "each"
    assert planned.stage.calibration.results is not None, "it is of the same eyes"
    planned.plan.choose("right")
    assert session.contents.facts.usable_eyes == ("right",)
    assert planned.advance().name is StepName.SOLVE, "the advice is for one eye only now"


def test_an_eye_may_be_skipped_before_its_verification_begins(
    make: Callable[..., Planned], session: Session
) -> None:
    planned = make(replace(PAPER, verify=True, placement=ONCE))
    planned.until(StepName.CURSOR)
    planned.confirm()
    for eye in EYES:
        while (step := planned.plan.next_step(is_steady=True)).name is not StepName.VERIFY:
            planned.advance()
            if planned.stage.state() is State.APPLYING:
                planned.stage.calibration.wait_applied()
        assert step.eyes == (eye,)
        planned.plan.skip(eye)
    planned.until(StepName.DONE)
    assert skipped_eyes(Session.open(session.path).events) == set(EYES)
    with pytest.raises(ProcedureError, match="no verification of the left eye"):
        planned.plan.skip("left")


def test_skipping_a_verification_that_has_just_ended_skips_no_other(
    make: Callable[..., Planned],
) -> None:
    planned = make(verifies_first=True)
    planned.until(StepName.VERIFY)
    planned.fits("left")
    while planned.stage.state() is State.VERIFY:
        planned.stage.see()
    assert planned.stage.state() is State.APPLYING
    with pytest.raises(ProcedureError, match="no verification of the left eye"):
        planned.plan.skip("left")
    assert planned.until(StepName.VERIFY).eyes == ("right",)
    with pytest.raises(ProcedureError, match="no verification of the left eye"):
        planned.plan.skip("left")
    assert planned.stage.state() is State.VERIFY
    assert planned.plan.skipped == set()


def test_a_contradicted_result_ends_the_plan(make: Callable[..., Planned]) -> None:
    planned = make(replace(PAPER, in_turn=True))
    for _ in range(2):
        planned.stage.calibration.evidence.drawn_otherwise("other projections")
    calibration = planned.stage.calibration
    planned.stage.align(eyes=("left",))
    for _ in range(2):  # as what the headset confirmed was drawn as sent
        calibration.evidence.drawn_otherwise("other projections")
    step = planned.until(StepName.DONE)
    assert "does not draw what was sent" in step.text
    assert len(calibration.alignments) == 1


def test_an_eye_that_is_no_longer_chosen_asks_for_nothing(make: Callable[..., Planned]) -> None:
    planned = make(PAPER)
    planned.until(StepName.CURSOR)
    planned.confirm()
    planned.until(StepName.DONE)
    planned.plan.choose("right")
    planned.until(StepName.DONE)
    calibration = planned.stage.calibration
    assert calibration.results is not None
    for name in ("implausible", "contradicted", "repeat"):
        left = replace(calibration.results.verdicts["left"], name=name, reason="of the tests")
        verdicts = {**calibration.results.verdicts, "left": left}
        calibration.results = replace(calibration.results, verdicts=verdicts)
        step = planned.plan.next_step(is_steady=True)
        assert step.name is StepName.DONE
        assert "of the tests" not in step.text
        planned.plan.request()
        assert planned.plan.next_step(is_steady=True).eyes == ("right",)
        planned.plan.withdraw()


def test_the_pause_begins_once_the_hand_is_placed(make: Callable[..., Planned]) -> None:
    planned = make(PAPER)
    planned.stage.hold(frames=10)
    for _ in range(3):
        planned.plan.advance(planned.stage.frame(pose=False))
        assert planned.step.name is StepName.CURSOR
        assert planned.stage.state() is State.SHOW_HAND
    planned.follow()
    assert planned.stage.state() is State.SHOW_HAND


def test_a_request_outlives_results_that_are_solved_for_another_reason(
    make: Callable[..., Planned],
) -> None:
    planned = make(PAPER)
    planned.until(StepName.CURSOR)
    planned.confirm()
    planned.until(StepName.DONE)
    planned.plan.request(("right",))
    planned.stage.calibration.set_eye_distance(EyeDistance(0.063))
    planned.until(StepName.SOLVE)
    assert planned.until(StepName.CURSOR).eyes == ("right",)


def test_a_cursor_that_was_withdrawn_makes_no_cursor_of_a_forgotten_hand(
    make: Callable[..., Planned],
) -> None:
    planned = make()
    planned.until(StepName.ALIGN)
    observation = planned.plan.observation
    assert observation is not None
    planned.stage.calibration.redo()
    planned.plan.observation = replace(observation, is_steady=True)
    planned.plan.advance(None, is_pressed=True)
    assert planned.step.name is StepName.RAISE
