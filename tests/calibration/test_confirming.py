"""Confirmations: the frame that is taken, and the hands that are refused."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from handcal.calibration.aligning import ADVISE_EVERY_NS, align_prompt
from handcal.calibration.delay import MOVED_LIMIT_M
from handcal.calibration.states import ProcedureError, State
from handcal.core.display import view_of_eye
from handcal.core.errors import HandError
from handcal.core.geometry import rigid, transform
from handcal.core.types import EYES, Float64
from handcal.link.client import HeadsetClient
from handcal.register.guard import RotationGuard
from handcal.session.session import Session
from tests.calibration.stage import (
    CAMERA_AHEAD_NS,
    PERIOD_NS,
    RIG,
    SETTINGS,
    T_D_HAND,
    T_D_NEAR,
    T_D_TURNED,
    T_W_H,
    Stage,
    events,
    world,
)
from tests.helpers import eventually


def test_advice_begins_above_three_degrees_and_ends_clearly_below(stage: Stage) -> None:
    turn_back = "Tilt your hand anticlockwise, then confirm."
    stage.make_cursor()
    for angle_deg, prompt in (
        (2.2, align_prompt(EYES)),
        (6.0, turn_back),
        (2.6, turn_back),  # it does not come and go at its limit
        (0.0, align_prompt(EYES)),
    ):
        seen = stage.see(T_D_HAND @ rigid([0.0, 0.0, np.radians(angle_deg)]))
        assert not seen.is_over_limit
        eventually(partial(lambda text: stage.shown().prompt == text, prompt))
        stage.t_ns += ADVISE_EVERY_NS // 2
        stage.see(T_D_TURNED)  # too soon after the last advice
        assert stage.shown().prompt == prompt
        stage.t_ns += ADVISE_EVERY_NS


def test_a_turned_hand_is_refused_with_a_prompt_and_may_align_again(
    stage: Stage, session: Session
) -> None:
    stage.make_cursor()
    seen = stage.see(T_D_TURNED)
    assert seen.is_over_limit
    assert seen.rotation_rad is not None
    # About the camera's z axis, as the hand was turned about its own, which nearly is that.
    np.testing.assert_allclose(np.degrees(seen.rotation_rad), [0.0, 3.0, 14.7], atol=1.0)
    eventually(lambda: stage.shown().is_over_limit)
    stage.press()
    assert stage.see(T_D_TURNED).state is State.ALIGN
    assert Session.open(session.path).refused == 1
    assert stage.calibration.alignments == {}
    eventually(lambda: "turned by" in stage.shown().prompt)
    assert "more than 9°. Tilt your hand anticlockwise and confirm again." in stage.shown().prompt
    assert stage.calibration.refusal == stage.shown().prompt
    assert "hand was turned by" in stage.calibration.refused_for
    name, data = events(session)[-1]
    assert (name, data["reason"]) == ("refused", "turned")
    assert data["angle_deg"] == pytest.approx(15.0, abs=1.0)

    stage.see(T_D_NEAR)
    stage.press()
    assert stage.see(T_D_NEAR).state is State.ALIGNED
    assert Session.open(session.path).refused == 1
    assert stage.calibration.refusal == stage.calibration.refused_for == ""
    assert len(stage.calibration.alignments) == 1


def test_of_a_fast_camera_every_third_hand_is_followed_but_the_confirmed_one_is_judged(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage.make_cursor()
    monkeypatch.setattr("tests.calibration.stage.PERIOD_NS", 11_111_112)
    seen = [stage.see(T_D_NEAR) for _ in range(3)]
    assert [one.guard_ms is not None for one in seen] == [True, False, False]
    assert all(one.rotation_rad is seen[0].rotation_rad for one in seen)
    assert stage.see(T_D_TURNED).is_over_limit
    assert stage.see(T_D_NEAR).is_over_limit, "it shows the hand before"
    stage.press()
    assert stage.see(T_D_NEAR).state is State.ALIGNED


def test_a_hand_of_another_shape_is_refused_and_told(stage: Stage, session: Session) -> None:
    stage.make_cursor()
    seen = [stage.see(thumb_out_rad=0.4) for _ in range(5)][-1]
    assert seen.is_over_limit
    assert seen.shape_change_m is not None
    assert seen.shape_change_m > SETTINGS.guard.shape_limit_m
    assert re.fullmatch("thumb .* further out than in the cursor", seen.shape_text)
    stage.press()
    assert stage.see(thumb_out_rad=0.4).state is State.ALIGN
    assert "shape of your hand has changed" in stage.calibration.refusal
    assert stage.calibration.refused_for == "the shape of your hand had changed"
    assert events(session)[-1][1]["reason"] == "shape changed"
    seen = stage.hold()
    assert not seen.is_over_limit
    stage.press()
    assert stage.see().state is State.ALIGNED
    facts = Session.open(session.path).alignment_facts[1]
    assert facts.shape_change_m is not None
    assert facts.shape_change_m < 0.001
    assert facts.hand_moved_m is not None
    assert facts.hand_moved_m < 0.001


def test_a_confirmation_of_an_older_cursor_is_ignored(stage: Stage) -> None:
    stage.make_cursor()
    older = stage.shown().cursor_id
    stage.make_cursor()
    stage.see()
    stage.press(cursor_id=older)
    assert stage.see().state is State.ALIGN
    stage.press()
    assert stage.see().state is State.ALIGNED


def test_a_confirmation_without_a_hand_is_refused(stage: Stage, session: Session) -> None:
    stage.make_cursor()
    for _ in range(3):
        seen = stage.see(None)
    assert seen.hand is None
    assert seen.problem
    stage.press()
    assert stage.see(None).state is State.ALIGN
    eventually(lambda: "did not see your hand" in stage.shown().prompt)
    assert Session.open(session.path).refused == 1
    assert events(session)[-1][1]["reason"] == "no hand"


def test_a_cursor_that_leads_out_of_view_is_withdrawn(stage: Stage, session: Session) -> None:
    stage.make_cursor()
    for _ in range(3):
        seen = stage.see(rigid([-0.2, 0.0, 0.0], [0.26, 0.0, 0.5]))
    assert "cut by the image border" in seen.problem
    stage.press()
    assert stage.see(None).state is State.SHOW_HAND
    assert "only a part of your hand" in stage.calibration.refusal
    eventually(lambda: stage.calibration.refusal == stage.shown().prompt)
    assert events(session)[-1][1]["reason"] == "out of view"
    stage.align()
    assert stage.state() is State.ALIGNED
    assert not stage.calibration.refusal


def test_the_frame_nearest_the_confirmation_is_taken_at_its_own_pose(stage: Stage) -> None:
    """Hand and head both move; neither the newest frame nor the newest pose will do."""
    stage.make_cursor()
    moving = [rigid([-0.2, 0.0, 0.0], [0.004 * i, 0.0, 0.5]) for i in range(5)]
    turning = [T_W_H @ rigid([0.0, 0.01 * i, 0.0], [0.0, 0.002 * i, 0.0]) for i in range(5)]
    times_ns = []
    for T_D_hand, T in zip(moving, turning, strict=True):
        stage.see(T_D_hand, T)
        times_ns.append(stage.t_ns)
    stage.press(times_ns[2] + PERIOD_NS // 3)
    stage.see(moving[-1], turning[-1])
    (alignment,) = stage.calibration.alignments.values()
    assert alignment.t_b_ns == times_ns[2] + CAMERA_AHEAD_NS
    T_W_D = turning[2] @ RIG.T_H_D
    expected_W_m = np.mean(visible_m(T_W_D @ moving[2]), 0)
    still_W_m = np.mean(visible_m(T_W_H @ RIG.T_H_D @ T_D_HAND), 0)
    np.testing.assert_allclose(
        np.mean(alignment.hand_m, 0) - np.mean(alignment.cursor_m, 0),
        expected_W_m - still_W_m,
        atol=1e-3,
    )


def test_a_hand_that_moves_when_it_is_confirmed_is_refused(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At 10 cm/s the hand of a frame a third of a period away is 3 mm off."""
    monkeypatch.setattr("handcal.calibration.aligning.MOVED_LIMIT_M", MOVED_LIMIT_M)
    stage.make_cursor()
    for i in range(5):
        stage.see(rigid([-0.2, 0.0, 0.0], [0.008 * i, 0.0, 0.5]))
    stage.press(stage.t_ns + PERIOD_NS // 3)
    stage.see(rigid([-0.2, 0.0, 0.0], [0.04, 0.0, 0.5]))
    assert stage.state() is State.ALIGN
    assert "moved too fast" in stage.calibration.refusal


def visible_m(T_W_hand: Float64) -> Float64:
    return transform(T_W_hand, world().hand.vertices_m)


def test_a_confirmation_waits_for_the_pose_of_the_frame_nearest_it(stage: Stage) -> None:
    stage.make_cursor()
    stage.see(T_D_HAND)
    stage.see(T_D_NEAR, pose=False)
    nearest_ns = stage.t_ns
    stage.press()
    seen = stage.see(T_D_NEAR, pose=False)
    assert seen.state is State.ALIGN
    assert seen.hand is None
    assert "has not arrived yet" in seen.problem
    stage.send_poses(t_ns=nearest_ns)
    assert stage.see(T_D_NEAR).state is State.ALIGNED
    assert stage.calibration.alignments[1].t_b_ns == nearest_ns + CAMERA_AHEAD_NS


def test_the_pc_may_confirm_but_only_with_a_hand_in_view(stage: Stage) -> None:
    stage.make_cursor()
    stage.see(T_D_NEAR)
    for _ in range(3):
        stage.see(None)
    with pytest.raises(ProcedureError, match="in view of the camera"):
        stage.calibration.confirm()
    stage.see(T_D_NEAR)
    t_b_ns = stage.t_ns + CAMERA_AHEAD_NS
    stage.calibration.confirm()
    assert stage.see(T_D_NEAR).state is State.ALIGNED
    alignment = stage.calibration.alignments[1]
    assert alignment.t_b_ns == t_b_ns
    for eye in EYES:
        np.testing.assert_allclose(
            alignment.T_E_W[eye], view_of_eye(RIG.eyes[eye], T_W_H), atol=1e-9
        )


def test_a_headset_that_keeps_stale_projections_is_refused(stage: Stage, session: Session) -> None:
    stale = {eye: replace(one, P=one.P + 1e-3) for eye, one in stage.shown().projections.items()}
    stage.make_cursor()
    stage.see(T_D_NEAR)
    stage.press(shown=replace(stage.shown(), projections=stale))
    assert stage.see(T_D_NEAR).state is State.ALIGN
    assert stage.calibration.refusal.startswith("The headset does not show what it should.")
    assert events(session)[-1][1]["reason"] == "drawn otherwise"
    eventually(lambda: stage.shown().prompt == stage.calibration.refusal)
    stage.see(T_D_NEAR)
    eventually(lambda: stage.calibration.is_applied)
    with pytest.raises(ProcedureError, match="let the wearer confirm, or restart"):
        stage.calibration.confirm()
    stage.press()
    assert stage.see(T_D_NEAR).state is State.ALIGNED


def test_the_pc_confirms_nothing_that_the_headset_has_not_received(
    stage: Stage, client: HeadsetClient
) -> None:
    stage.make_cursor()
    stage.see(T_D_NEAR)
    eventually(lambda: stage.calibration.is_applied)
    client.close()
    stage.calibration._drawing.send(stage.calibration.applied_shift_m)
    with pytest.raises(ProcedureError, match="has not received the cursor and projections"):
        stage.calibration.confirm()


def test_a_hand_beside_cut_edges_counts_as_none(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage.make_cursor()

    def all_cut(*_: object) -> Float64:
        raise HandError("all of the hand lies beside cut edges")

    monkeypatch.setattr(RotationGuard, "_describe", all_cut)
    seen = stage.see()
    assert seen.hand is None
    assert "beside cut edges" in seen.problem
    stage.press()
    assert stage.see().state is State.ALIGN
    eventually(lambda: "beside cut edges. Align and confirm again" in stage.shown().prompt)


def test_a_cursor_is_made_again_after_a_step_of_the_headset_s_clock(
    stage: Stage, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage.make_cursor()
    monkeypatch.setattr(type(stage.server), "clock_step_s", 0.3)
    seen = stage.see()
    assert seen.state is State.SHOW_HAND
    assert "clock was set by +0.30 s" in seen.problem
    assert "clock was set" in stage.calibration.refusal
    assert stage.hold().hand is None
    monkeypatch.setattr(type(stage.server), "clock_step_s", 0.0)
    stage.align()
    assert stage.state() is State.ALIGNED
