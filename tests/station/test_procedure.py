"""The procedure, driven by rendered frames and by a headset over real datagrams."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.display import projection_matrix, update_matrix, view_of_eye
from handcal.errors import FileError, HandError, LinkError
from handcal.geometry import invert, rigid, transform
from handcal.link.client import HeadsetClient, HeadsetState
from handcal.link.server import HeadsetServer
from handcal.register.guard import RotationGuard
from handcal.register.results import SolveSettings, results_json, solve_session
from handcal.session.session import Session
from handcal.station.aligning import ADVISE_EVERY_NS, align_prompt
from handcal.station.evidence import FROZEN_FRAMES
from handcal.station.procedure import (
    Calibration,
    CalibrationSettings,
    ProcedureError,
    State,
)
from handcal.station.solve_again import solve
from handcal.types import (
    EYES,
    Alignment,
    Eye,
    EyeDistance,
    Float64,
    Frame,
    Projection,
    Verdict,
)
from tests.helpers import eventually
from tests.station.stage import (
    CAMERA,
    CAMERA_AHEAD_NS,
    IDENTITY,
    PERIOD_NS,
    RIG,
    SENSOR,
    SETTINGS,
    T_D_HAND,
    T_D_NEAR,
    T_D_TURNED,
    T_W_H,
    Stage,
    connect,
    depth_of,
    events,
    world,
)

# Opens a session with the alignment of another, and dies with it open.
KILLED = """
import os, sys
from pathlib import Path
from handcal.session.session import Session
record = Session.open(Path(sys.argv[1]))
session = Session.create(Path(sys.argv[2]), record.rig, record.settings, name="killed")
session.save_alignment(record.alignments[1])
os._exit(9)
"""


def cursor_for(
    eye: Eye, true_m: Float64, drawn_m: Float64, T_D_hand: Float64 = T_D_HAND
) -> Float64:
    """Return the pose of the hand as cursor that, drawn with a shift, `T_D_hand` overlays.

    Of one eye, in the middle of the hand: UQ(true) s and UQ(drawn) d lie on one pixel, at the same
    size.
    """
    display = RIG.eyes[eye]
    T_E_D = view_of_eye(display, np.eye(4)) @ RIG.T_H_D
    hand_E = transform(T_E_D, T_D_hand[:3, 3][None])[0]
    seen = update_matrix(true_m, display.z_C0_S_m) @ [*hand_E, 1.0]
    seen *= _factor(drawn_m, display.z_C0_S_m) / _factor(true_m, display.z_C0_S_m)
    seen[3] = 1.0
    cursor_E = (np.linalg.inv(update_matrix(drawn_m, display.z_C0_S_m)) @ seen)[:3]
    moved = T_D_hand.copy()
    moved[:3, 3] = transform(invert(T_E_D), cursor_E[None])[0]
    return moved


def _factor(shift_m: Float64, distance_m: float) -> float:
    return float(1.0 - shift_m[2] / distance_m)


def test_a_whole_calibration_reaches_the_displays(stage: Stage, session: Session) -> None:
    calibration = stage.calibration
    assert not stage.hold(frames=3).is_steady
    seen = stage.hold()
    assert seen.is_steady
    assert seen.state is State.SHOW_HAND
    assert seen.hand is not None
    stage.make_cursor()
    shown = stage.shown()
    assert shown.cursor_W_m is not None
    contour_W_m = transform(T_W_H @ RIG.T_H_D, seen.hand.cloud.contour_m)
    np.testing.assert_allclose(shown.cursor_W_m, contour_W_m, atol=1e-3)
    assert shown.eyes == EYES
    assert "both eyes" in shown.prompt

    seen = stage.see(T_D_NEAR)
    assert seen.state is State.ALIGN
    assert not seen.is_over_limit
    assert seen.rotation_rad is not None
    assert np.linalg.norm(seen.rotation_rad) < np.radians(1.0)
    eventually(lambda: stage.shown().live_W_m is not None)
    assert not stage.shown().is_over_limit
    stage.press()
    assert stage.see(T_D_NEAR).state is State.ALIGNED
    results = calibration.solve()
    assert stage.state() is State.SOLVED
    calibration.apply()
    assert stage.state() is State.APPLYING
    calibration.wait_applied()
    assert stage.state() is State.APPLIED

    for eye in EYES:
        projection = stage.shown().projections[eye]
        expected = projection_matrix(RIG.eyes[eye], results.eyes[eye].shift_m)
        np.testing.assert_array_equal(projection.P, expected)
        assert (projection.width_px, projection.height_px) == (1268, 720)
    eventually(lambda: stage.shown().cursor_W_m is None and not stage.shown().prompt)
    (alignment,) = calibration.alignments.values()
    np.testing.assert_allclose(
        np.mean(alignment.hand_m, 0) - np.mean(alignment.cursor_m, 0),
        (T_W_H @ RIG.T_H_D)[:3, :3] @ (T_D_NEAR - T_D_HAND)[:3, 3],
        atol=1.5e-3,
    )
    record = Session.open(session.path)
    assert record.results == results_json(results)
    assert record.alignments[1].hand_m.tobytes() == alignment.hand_m.tobytes()
    assert [name for name, _ in events(session)] == [
        "created", "facts_saved", "cursor_made", "alignment_saved", "solved", "applied",
    ]  # fmt: skip
    assert record.facts.camera is not None
    assert record.facts.camera.depth_intrinsics == CAMERA
    age_s = record.alignment_facts[1].match_age_s
    assert age_s is not None
    assert 0.0 <= age_s <= CalibrationSettings().match_tolerance_s


def test_a_hand_turned_by_more_than_three_degrees_is_advised_until_it_is_turned_back(
    stage: Stage,
) -> None:
    stage.make_cursor()
    stage.see(T_D_HAND @ rigid([0.0, 0.0, np.radians(2.2)]))
    assert stage.shown().prompt == align_prompt(EYES)
    turned = stage.see(T_D_HAND @ rigid([0.0, 0.0, np.radians(6.0)]))
    assert not turned.is_over_limit
    eventually(lambda: stage.shown().prompt == "Tilt your hand anticlockwise, then confirm.")
    stage.t_ns += ADVISE_EVERY_NS
    stage.see(T_D_HAND)
    eventually(lambda: stage.shown().prompt == align_prompt(EYES))


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
    assert stage.calibration.refused == 1
    assert stage.calibration.alignments == {}
    eventually(lambda: "turned by" in stage.shown().prompt)
    assert "more than 9°. Tilt your hand anticlockwise and confirm again." in stage.shown().prompt
    assert stage.calibration.refusal == stage.shown().prompt
    name, data = events(session)[-1]
    assert (name, data["reason"]) == ("refused", "turned")
    assert data["angle_deg"] == pytest.approx(15.0, abs=1.0)

    stage.see(T_D_NEAR)
    stage.press()
    assert stage.see(T_D_NEAR).state is State.ALIGNED
    assert stage.calibration.refused == 1
    assert stage.calibration.refusal == ""
    assert len(stage.calibration.alignments) == 1


def test_a_hand_of_another_shape_is_refused_and_told(stage: Stage, session: Session) -> None:
    stage.make_cursor()
    seen = [stage.see(thumb_out_rad=0.4) for _ in range(5)][-1]
    assert seen.is_over_limit
    assert seen.shape_change_m is not None
    assert seen.shape_change_m > SETTINGS.guard.shape_limit_m
    assert re.fullmatch("thumb .* further out than in the cursor", seen.shape_text)
    stage.press()
    assert stage.see(thumb_out_rad=0.4).state is State.ALIGN
    assert "changed its shape" in stage.calibration.refusal
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
    assert stage.calibration.refused == 0  # those count turned hands
    assert events(session)[-1][1]["reason"] == "no hand"


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
    server: HeadsetServer, client: HeadsetClient, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At 10 cm/s the hand of a frame a third of a period away is 3 mm off."""
    monkeypatch.setattr("tests.station.stage.SETTINGS", CalibrationSettings(camera_latency_s=0.0))
    stage = Stage(server, client, session)
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


def test_over_a_slow_link_the_newest_hand_with_a_pose_is_shown(stage: Stage) -> None:
    """Every frame's pose comes one frame late."""
    stage.hold()
    for _ in range(3):
        before_ns = stage.t_ns
        seen = stage.see(pose=False)
        if seen.hand is not None:
            assert seen.hand.t_host_ns == before_ns
        stage.send_poses()
    assert seen.hand is not None
    assert not seen.problem
    assert seen.is_steady


def test_one_eye_at_a_time_finds_each_eye(stage: Stage) -> None:
    true_m = {"left": np.array([0.004, -0.003, 0.002]), "right": np.array([0.002, -0.002, 0.001])}
    zero_m = np.zeros(3)
    stage.align(cursor_for("left", true_m["left"], zero_m), T_D_HAND, ("left",))
    stage.calibration.solve()
    stage.calibration.apply()
    stage.calibration.wait_applied()
    right = stage.shown().projections["right"].P
    np.testing.assert_array_equal(right, projection_matrix(RIG.eyes["right"]))
    stage.make_cursor(cursor_for("right", true_m["right"], zero_m), ("right",))
    assert stage.shown().eyes == ("right",)
    assert "Close your left eye" in stage.shown().prompt
    stage.see(T_D_HAND)
    stage.press()
    stage.see(T_D_HAND)
    results = stage.calibration.solve()
    for number, eye in enumerate(EYES, start=1):
        assert set(results.alignments[number]) == {eye}
        np.testing.assert_allclose(
            results.alignments[number][eye].shift_m, true_m[eye], atol=1.5e-3
        )
        assert np.linalg.norm(results.eyes[eye].shift_m - true_m[eye]) < 2e-3
    assert results.eye_distance_m is not None


@pytest.mark.parametrize("slip_m", [0.0, 0.002])
def test_a_second_alignment_is_drawn_with_the_first_and_improves_on_it(
    stage: Stage, slip_m: float
) -> None:
    """The wearer misses the first cursor by `slip_m` to one side, the second to the other."""
    true_m = np.array([0.004, -0.003, 0.002])
    slip = rigid(translation_m=[slip_m, 0.0, 0.0])
    stage.calibrate(slip @ cursor_for("left", true_m, np.zeros(3)), T_D_HAND, ("left",))
    assert stage.calibration.results is not None
    first = stage.calibration.results.eyes["left"]
    stage.align(invert(slip) @ cursor_for("left", true_m, first.shift_m), T_D_HAND, ("left",))
    drawn_m = stage.calibration.alignments[2].drawn_shift_m
    np.testing.assert_array_equal(drawn_m["left"], first.shift_m)
    np.testing.assert_array_equal(drawn_m["right"], np.zeros(3))
    fused = stage.calibration.solve().eyes["left"]
    before_m, after_m = (float(np.linalg.norm(s.shift_m - true_m)) for s in (first, fused))
    # Both are drawn towards the eye box's middle, the second less.
    assert after_m < max(0.7 * before_m, 5e-4)
    if slip_m == 0.0:
        assert np.trace(fused.covariance_m2) < np.trace(first.covariance_m2)


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


def test_a_moving_or_absent_hand_is_not_steady(stage: Stage) -> None:
    for i in range(8):
        seen = stage.see(rigid([-0.2, 0.0, 0.0], [0.004 * (i % 2), 0.003 * (i % 4), 0.5]))
    assert seen.hand is not None
    assert not seen.is_steady
    with pytest.raises(ProcedureError, match="hold the hand still"):
        stage.calibration.make_cursor()
    assert stage.hold().is_steady
    for _ in range(6):
        seen = stage.see(None)
    assert not seen.is_steady


def test_a_hand_held_before_a_slow_camera_is_steady(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tests.station.stage.PERIOD_NS", 350_000_000)
    assert not stage.hold(frames=1).is_steady
    assert stage.hold(frames=3).is_steady
    assert not stage.see(rigid([-0.2, 0.0, 0.0], [0.02, 0.0, 0.5])).is_steady


def test_redo_gives_up_the_cursor_or_the_last_alignment(stage: Stage, session: Session) -> None:
    calibration = stage.calibration
    stage.calibrate()
    applied = calibration.results
    with pytest.raises(ProcedureError, match="nothing to redo"):
        calibration.redo()

    stage.make_cursor()
    calibration.redo()
    assert stage.state() is State.SHOW_HAND
    assert calibration.results is applied
    eventually(lambda: stage.shown().cursor_W_m is None)
    with pytest.raises(ProcedureError, match="nothing to redo"):
        calibration.redo()

    stage.align()
    calibration.redo()
    assert len(calibration.alignments) == 1

    stage.align()
    calibration.solve()
    calibration.redo()
    assert stage.state() is State.SHOW_HAND
    assert calibration.results is None
    record = Session.open(session.path)
    assert len(record.alignments) == 1
    assert record.results is None

    again = results_json(calibration.solve())
    assert again == results_json(solve_session(record.alignments, RIG, SolveSettings()))


def test_the_offline_projections_come_first(stage: Stage, server: HeadsetServer) -> None:
    stage.calibrate()
    Calibration(RIG, server)
    eventually(lambda: shows_offline_projections(stage.shown()))


def test_redo_takes_back_a_projection_that_came_alone(stage: Stage, server: HeadsetServer) -> None:
    stage.align()
    shift_m = stage.calibration.solve().eyes["left"].shift_m
    P = projection_matrix(RIG.eyes["left"], shift_m)
    server.wait_acked(server.send_projection(Projection("left", P, 1268, 720)), 5.0)
    assert not shows_offline_projections(stage.shown())
    stage.calibration.redo()
    eventually(lambda: shows_offline_projections(stage.shown()))


def shows_offline_projections(shown: HeadsetState) -> bool:
    return all(shows_projection(shown, eye, np.zeros(3)) for eye in EYES)


def shows_projection(shown: HeadsetState, eye: Eye, shift_m: Float64) -> bool:
    """Return whether the newest projection, if one has arrived, is that of a shift."""
    P = projection_matrix(RIG.eyes[eye], shift_m)
    return eye in shown.projections and np.array_equal(shown.projections[eye].P, P)


CALLS: dict[str, Callable[[Calibration], object]] = {
    "make_cursor": lambda calibration: calibration.make_cursor(),
    "confirm": lambda calibration: calibration.confirm(),
    "solve": lambda calibration: calibration.solve(),
    "apply": lambda calibration: calibration.apply(),
    "wait_applied": lambda calibration: calibration.wait_applied(),
    "poll_applied": lambda calibration: calibration.poll_applied(),
    "redo": lambda calibration: calibration.redo(),
    "set_shift": lambda calibration: calibration.set_shift({"left": np.zeros(3)}),
    "delete_alignment": lambda calibration: calibration.delete_alignment(1),
    "restore_alignment": lambda calibration: calibration.restore_alignment(1),
}
OUT_OF_TURN = {
    State.SHOW_HAND: {
        "make_cursor": "hold the hand still",
        "confirm": "no cursor to confirm",
        "solve": "align the hand with the cursor first",
        "apply": "solve first",
        "wait_applied": "apply first",
        "poll_applied": "apply first",
        "redo": "nothing to redo",
    },
    State.ALIGN: {
        "solve": "align the hand with the cursor first",
        "apply": "solve first",
        "wait_applied": "apply first",
        "set_shift": "cannot be set by hand now",
        "delete_alignment": "cannot be changed now",
        "restore_alignment": "cannot be changed now",
    },
    State.ALIGNED: {
        "make_cursor": "solve and apply",
        "confirm": "no cursor to confirm",
        "apply": "solve first",
        "wait_applied": "apply first",
        "set_shift": "cannot be set by hand now",
    },
    State.SOLVED: {
        "make_cursor": "solve and apply",
        "confirm": "no cursor to confirm",
        "wait_applied": "apply first",
        "set_shift": "cannot be set by hand now",
    },
    State.APPLYING: {
        "make_cursor": "cannot be made now",
        "confirm": "no cursor to confirm",
        "solve": "wait until the projections are applied",
        "apply": "solve first",
        "redo": "nothing to redo",
        "set_shift": "cannot be set by hand now",
        "delete_alignment": "cannot be changed now",
        "restore_alignment": "cannot be changed now",
    },
    State.APPLIED: {
        "confirm": "no cursor to confirm",
        "apply": "solve first",
        "wait_applied": "apply first",
        "redo": "nothing to redo",
    },
}


def test_out_of_turn_every_call_says_what_must_come_first(stage: Stage) -> None:
    calibration = stage.calibration

    def align() -> None:
        stage.press()
        stage.see()

    steps: dict[State, Callable[[], object]] = {
        State.SHOW_HAND: lambda: None,
        State.ALIGN: stage.make_cursor,
        State.ALIGNED: align,
        State.SOLVED: calibration.solve,
        State.APPLYING: calibration.apply,
        State.APPLIED: calibration.wait_applied,
    }
    for state, step in steps.items():
        step()
        for name, text in OUT_OF_TURN[state].items():
            with pytest.raises(ProcedureError, match=text):
                CALLS[name](calibration)
            assert stage.state() is state


def test_a_silent_headset_can_be_applied_to_again_when_it_is_back(
    stage: Stage, server: HeadsetServer, client: HeadsetClient
) -> None:
    stage.align()
    results = stage.calibration.solve()
    client.close()
    eventually(lambda: not server.connected)
    stage.calibration.apply()
    with pytest.raises(LinkError, match="not acknowledged"):
        stage.calibration.wait_applied(0.1)
    assert stage.state() is State.SOLVED
    with connect(server) as back:
        stage.calibration.apply()
        stage.calibration.wait_applied()
        for eye in EYES:
            expected = projection_matrix(RIG.eyes[eye], results.eyes[eye].shift_m)
            np.testing.assert_array_equal(back.state().projections[eye].P, expected)


def test_keep_leaves_the_offline_calibration_in_the_headset(stage: Stage, session: Session) -> None:
    stage.align()
    solved = stage.calibration.solve()
    verdicts: dict[Eye, Verdict] = {
        "left": Verdict("keep", "as told"),
        "right": Verdict("repeat", "as told"),
    }
    stage.calibration.results = replace(solved, verdicts=verdicts)
    stage.calibration.apply()
    stage.calibration.wait_applied()
    expected: dict[Eye, Float64] = {"left": np.zeros(3), "right": solved.eyes["right"].shift_m}
    for eye, shift_m in expected.items():
        shown = stage.shown().projections[eye].P
        np.testing.assert_array_equal(shown, projection_matrix(RIG.eyes[eye], shift_m))
        stored_m = Session.open(session.path).applied_shift_m[eye]
        np.testing.assert_array_equal(stored_m, shift_m)


def test_what_the_disk_did_not_take_is_kept_and_stored_later(
    stage: Stage, session: Session, tmp_path: Path
) -> None:
    calibration, away = stage.calibration, tmp_path / "away"
    stage.make_cursor()
    stage.see(T_D_NEAR)
    stage.press()
    session.path.rename(away)
    with pytest.raises(FileError, match="cannot write"):
        stage.see(T_D_NEAR)
    assert stage.state() is State.ALIGNED
    with pytest.raises(FileError, match="cannot write"):
        calibration.solve()
    assert stage.state() is State.SOLVED
    assert calibration.results is not None
    calibration.apply()
    with pytest.raises(FileError, match="cannot write"):
        calibration.wait_applied()
    assert stage.state() is State.APPLIED
    assert set(stage.shown().projections) == set(EYES)

    away.rename(session.path)
    stage.align()
    assert len(Session.open(session.path).alignments) == 2


@pytest.mark.process
def test_a_session_whose_program_was_killed_is_solved_alike(
    stage: Stage, session: Session, tmp_path: Path
) -> None:
    stage.align()
    results = stage.calibration.solve()
    killed = subprocess.run(
        [sys.executable, "-c", KILLED, session.path, tmp_path],
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    assert killed.returncode == 9
    record = Session.open(tmp_path / "killed")
    assert results_json(solve_session(record.alignments, record.rig, SolveSettings())) == (
        results_json(results)
    )


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


def test_it_runs_without_a_session(server: HeadsetServer, client: HeadsetClient) -> None:
    stage = Stage(server, client, None)
    stage.calibrate()
    assert stage.state() is State.APPLIED


def test_polling_never_waits_and_has_the_same_result(stage: Stage, session: Session) -> None:
    calibration = stage.calibration
    stage.align()
    results = calibration.solve()
    calibration.apply()
    eventually(calibration.poll_applied)
    assert stage.state() is State.APPLIED
    assert calibration.is_applied
    record = Session.open(session.path)
    assert record.is_applied
    for eye in EYES:
        solved_m = results.eyes[eye].shift_m
        np.testing.assert_array_equal(calibration.applied_shift_m[eye], solved_m)
        np.testing.assert_array_equal(record.applied_shift_m[eye], solved_m)
    with pytest.raises(ProcedureError, match="apply first"):
        calibration.poll_applied()


def test_polling_gives_up_when_the_time_is_over(
    server: HeadsetServer, client: HeadsetClient, session: Session
) -> None:
    stage = Stage(server, client, session)
    stage.calibration = Calibration(RIG, server, session, replace(SETTINGS, apply_timeout_s=0.2))
    stage.align()
    stage.calibration.solve()
    client.close()
    eventually(lambda: not server.connected)
    stage.calibration.apply()
    assert not stage.calibration.poll_applied()
    assert not stage.calibration.is_applied
    with pytest.raises(LinkError, match="not acknowledged"):
        eventually(stage.calibration.poll_applied)
    assert stage.state() is State.SOLVED
    with connect(server):
        stage.calibration.apply()
        eventually(stage.calibration.poll_applied)


def shows(stage: Stage, eye: Eye, shift_m: Float64) -> bool:
    return shows_projection(stage.shown(), eye, shift_m)


def test_a_shift_set_by_hand_reaches_the_display_and_the_next_cursor(
    stage: Stage, session: Session
) -> None:
    calibration = stage.calibration
    by_hand_m: dict[Eye, Float64] = {
        "left": np.array([0.001, 0.002, -0.003]),
        "right": np.array([0.0, 0.03, 0.0]),
    }
    for message in calibration.set_shift({"left": by_hand_m["left"]}):
        stage.server.wait_acked(message, 5.0)
    assert shows(stage, "left", by_hand_m["left"])
    eventually(lambda: shows(stage, "right", np.zeros(3)))
    assert stage.state() is State.SHOW_HAND

    stage.calibrate()
    assert (calibration.alignments[1].drawn_shift_m["left"] == by_hand_m["left"]).all()
    for message in calibration.set_shift(by_hand_m):
        stage.server.wait_acked(message, 5.0)
    assert calibration.is_applied
    assert shows(stage, "right", by_hand_m["right"])
    assert Session.open(session.path).fine_tuned is None
    calibration.record_shift()
    fine_tuned = Session.open(session.path).fine_tuned
    assert fine_tuned is not None

    stage.align()
    for eye, shift_m in by_hand_m.items():
        assert (calibration.applied_shift_m[eye] == shift_m).all()
        assert (fine_tuned[eye] == shift_m).all()
        assert (calibration.alignments[2].drawn_shift_m[eye] == shift_m).all()
    calibration.solve()
    assert Session.open(session.path).fine_tuned is None


@pytest.mark.parametrize(
    ("shift_m", "problem"),
    [
        ([0.0, 0.0, 0.0301], "within ±30 mm"),
        ([0.0, -0.0301, 0.0], "within ±30 mm"),
        ([0.0, np.nan, 0.0], "finite"),
        ([0.0, 0.0], "shape 3, got 2"),
    ],
)
def test_a_shift_beyond_reason_is_refused_and_changes_nothing(
    stage: Stage, shift_m: list[float], problem: str
) -> None:
    good_m = np.array([0.001, 0.0, 0.0])
    with pytest.raises(ValueError, match=problem):
        stage.calibration.set_shift({"left": good_m, "right": shift_m})
    assert not any(shift.any() for shift in stage.calibration.applied_shift_m.values())


def test_any_alignment_can_be_deleted_and_restored_and_the_rest_solved(
    stage: Stage, session: Session
) -> None:
    calibration = stage.calibration
    stage.calibrate()
    stage.calibrate(T_D_HAND, T_D_HAND)
    assert list(calibration.alignments) == [1, 2]
    first, second = calibration.alignments.values()

    calibration.delete_alignment(1)
    assert list(calibration.alignments.values()) == [second]
    assert calibration.results is None
    assert stage.state() is State.APPLIED  # the headset renders as before
    record = Session.open(session.path)
    assert (list(record.alignments), list(record.deleted_alignments)) == ([2], [1])
    assert record.results is None
    alone = results_json(calibration.solve())
    assert alone == results_json(solve_session([second], RIG, SolveSettings()))
    assert stage.state() is State.SOLVED

    calibration.restore_alignment(1)
    assert stage.state() is State.SHOW_HAND
    assert list(calibration.alignments.values()) == [first, second]
    with pytest.raises(ValueError, match="there is no deleted alignment 1"):
        calibration.restore_alignment(1)
    both = results_json(calibration.solve())
    assert both == results_json(solve_session([first, second], RIG, SolveSettings()))
    assert Session.open(session.path).results == both

    calibration.delete_alignment(2)
    calibration.delete_alignment(1)
    with pytest.raises(ProcedureError, match="align the hand"):
        calibration.solve()
    stage.align()
    assert list(calibration.alignments) == [3]
    assert list(Session.open(session.path).alignments) == [3]


def test_a_measured_eye_distance_is_used_stored_and_restored(
    stage: Stage, session: Session, server: HeadsetServer, client: HeadsetClient
) -> None:
    calibration, wide = stage.calibration, EyeDistance(0.070)
    stage.make_cursor()
    with pytest.raises(ProcedureError, match="the eye distance cannot be changed now"):
        calibration.set_eye_distance(wide)
    calibration.redo()
    stage.calibrate()
    without = calibration.results
    assert without is not None
    assert without.eye_distance_m is not None
    assert without.measured_eye_distance is None

    calibration.set_eye_distance(wide)
    assert calibration.results is None
    assert stage.state() is State.APPLIED
    assert Session.open(session.path).results is None
    results = calibration.solve()
    assert results.measured_eye_distance == wide
    assert results.eye_distance_m is not None
    assert abs(results.eye_distance_m - 0.070) < 0.5 * abs(without.eye_distance_m - 0.070)
    calibration.set_eye_distance(wide)  # nothing changes
    assert calibration.results is results

    record = Session.open(session.path)
    assert record.facts.eye_distance == wide
    assert record.is_solved
    assert results_json(solve(record)) == results_json(results) == record.results
    other = solve(record, eye_distance=EyeDistance(0.058))
    assert other.eye_distance_m is not None
    assert other.eye_distance_m < results.eye_distance_m
    resumed = Stage(server, client, session, resume=record)
    assert resumed.calibration.eye_distance == wide
    assert resumed.calibration.results is not None
    assert results_json(resumed.calibration.results) == results_json(results)

    calibration.set_eye_distance(None)
    assert Session.open(session.path).facts.eye_distance is None
    assert results_json(calibration.solve()) == results_json(without)


def test_the_headset_s_eye_distance_is_used_if_none_was_typed(
    stage: Stage, session: Session, server: HeadsetServer, client: HeadsetClient
) -> None:
    def tell(distance_m: float) -> None:
        client.set_identity(replace(IDENTITY, eye_distance_m=distance_m))
        eventually(lambda: server.device and server.device.eye_distance_m == distance_m)

    stage.align()
    for told_m, used in (
        (0.040, None),  # no person's
        (0.066, EyeDistance(0.066, source="headset")),
        (0.067, EyeDistance(0.067, source="headset")),
    ):
        tell(told_m)
        results = stage.calibration.solve()
        record = Session.open(session.path)
        assert results.measured_eye_distance == record.facts.eye_distance == used
        assert record.is_solved
        assert results_json(solve(record)) == results_json(results)
    stage.calibration.set_eye_distance(EyeDistance(0.060))
    assert stage.calibration.solve().measured_eye_distance == EyeDistance(0.060)


def test_redo_of_an_alignment_can_be_undone(stage: Stage, session: Session) -> None:
    stage.align()
    stage.calibration.redo()
    stage.calibration.restore_alignment(1)
    assert len(stage.calibration.alignments) == 1
    assert list(Session.open(session.path).alignments) == [1]


def test_what_is_deleted_while_the_disk_is_full_is_deleted_later(
    stage: Stage, session: Session, tmp_path: Path
) -> None:
    calibration, away = stage.calibration, tmp_path / "away"
    stage.calibrate()
    session.path.rename(away)
    with pytest.raises(FileError, match="cannot write"):
        calibration.delete_alignment(1)
    with pytest.raises(FileError, match="cannot write"):
        calibration.record_shift()
    assert calibration.alignments == {}
    away.rename(session.path)
    stage.align()
    record = Session.open(session.path)
    assert (list(record.alignments), list(record.deleted_alignments)) == ([2], [1])
    assert record.fine_tuned is not None


def resumed(stage: Stage, session: Session) -> tuple[Stage, Session]:
    """Resume a session as after a crash: the old calibration receives no message."""
    session.close()
    again = Session(session.path)
    return Stage(stage.server, stage.client, again, Session.open(session.path)), again


def test_a_calibration_goes_on_where_its_program_was_killed(stage: Stage, session: Session) -> None:
    stage, session = resumed(stage, session)
    assert stage.state() is State.SHOW_HAND
    eventually(lambda: shows_offline_projections(stage.shown()))

    stage.align()
    stage.calibration.redo()
    stage.align()
    made = stage.calibration.alignments
    stage, session = resumed(stage, session)
    assert stage.state() is State.ALIGNED
    assert list(stage.calibration.alignments) == [2]
    assert stage.calibration.alignments[2].hand_m.tobytes() == made[2].hand_m.tobytes()

    results = results_json(stage.calibration.solve())
    stage, session = resumed(stage, session)
    assert stage.state() is State.SOLVED
    assert stage.calibration.results is not None
    assert results_json(stage.calibration.results) == results

    stage.calibration.apply()
    stage.calibration.wait_applied()
    by_hand_m = np.array([0.004, 0.0, -0.001])
    stage.calibration.set_shift({"right": by_hand_m})
    stage.calibration.record_shift()
    solved_m = stage.calibration.applied_shift_m["left"]
    Calibration(RIG, stage.server)  # another has used the headset in between
    stage, session = resumed(stage, session)
    assert stage.state() is State.APPLIED
    eventually(lambda: shows(stage, "left", solved_m) and shows(stage, "right", by_hand_m))
    eventually(lambda: stage.calibration.is_applied)  # the acknowledgement is on its way back

    stage.calibration.restore_alignment(1)
    stage.align()
    assert list(stage.calibration.alignments) == [1, 2, 3]
    assert (stage.calibration.alignments[3].drawn_shift_m["right"] == by_hand_m).all()
    record = Session.open(session.path)
    assert list(record.alignments) == [1, 2, 3]
    session.close()


def test_a_calibration_goes_on_with_what_is_left_of_a_damaged_session(
    stage: Stage, session: Session
) -> None:
    for _ in range(2):
        stage.align()
        stage.calibration.solve()
        stage.calibration.apply()
        stage.calibration.wait_applied()
    (session.path / "alignments/2.npz").write_bytes(b"nothing")
    stage, session = resumed(stage, session)
    assert stage.state() is State.ALIGNED  # solved with an alignment that is lost
    stage.calibration.solve()
    stage.calibration.apply()
    stage.calibration.wait_applied()
    stage.align()
    assert list(stage.calibration.alignments) == [1, 3]
    stage.calibration.delete_alignment(3)
    record = Session.open(session.path)
    assert (list(record.alignments), list(record.deleted_alignments)) == ([1], [3])
    session.close()


def test_a_session_that_can_no_longer_be_solved_is_not_resumed(
    server: HeadsetServer, session: Session, alignment: Alignment
) -> None:
    session.save_alignment(alignment)  # of a few points
    session.save_results({})
    with pytest.raises(ProcedureError, match=r"cannot be resumed: .* points"):
        Calibration(RIG, server, session, SETTINGS, Session.open(session.path))


def test_a_full_session_says_so_before_the_wearer_aligns(
    server: HeadsetServer, client: HeadsetClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("handcal.station.alignments.MAX_ALIGNMENTS", 1)
    stage = Stage(server, client, None)
    stage.align()
    stage.calibration.redo()
    stage.calibration.restore_alignment(1)  # a deleted one would not count
    stage.hold()
    with pytest.raises(ProcedureError, match="no room for more than 1 alignments in a session"):
        stage.calibration.make_cursor()


@pytest.mark.parametrize("eyes", [(), ("left", "left"), ("middle",)])
def test_a_cursor_is_for_one_eye_or_both(stage: Stage, eyes: tuple[Eye, ...]) -> None:
    stage.hold()
    with pytest.raises(ValueError, match="one eye must be open, or both"):
        stage.calibration.make_cursor(eyes)
    assert stage.state() is State.SHOW_HAND


def test_a_frozen_picture_makes_no_cursor_and_no_alignment(stage: Stage) -> None:
    still = Frame(0, 0, 0, depth_of(T_D_HAND.tobytes()), SENSOR.depth_scale_m, CAMERA)
    for _ in range(FROZEN_FRAMES + 8):
        stage.t_ns += PERIOD_NS
        stage.send_poses()
        now = replace(still, t_camera_ns=stage.t_ns + CAMERA_AHEAD_NS, t_host_ns=stage.t_ns)
        seen = stage.calibration.step(now)
    assert seen.contradiction is not None
    assert seen.contradiction.name == "frozen-camera"
    assert "does not change" in seen.problem
    with pytest.raises(ProcedureError, match="hold the hand still"):
        stage.calibration.make_cursor()
    stage.make_cursor()  # the camera is alive again
    assert stage.calibration.evidence.contradictions == ()


def test_no_cursor_before_the_headset_has_the_projections(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage.hold()
    with monkeypatch.context() as patch:
        patch.setattr(Calibration, "is_applied", False)
        with pytest.raises(ProcedureError, match="has not acknowledged its projections"):
            stage.calibration.make_cursor()
    assert stage.calibration.state is State.SHOW_HAND


def test_a_headset_that_keeps_drawing_otherwise_contradicts_the_result(
    stage: Stage, session: Session
) -> None:
    stage.align(T_D_NEAR, T_D_HAND)
    stage.calibration.evidence.drawn_otherwise("other projections")
    assert stage.calibration.evidence.contradictions == ()
    stage.calibration.evidence.drawn_otherwise("other projections")
    results = stage.calibration.solve()
    assert {verdict.name for verdict in results.verdicts.values()} == {"contradicted"}
    record = Session.open(session.path)
    assert record.facts.evidence == ("stale-headset",)
    again = solve(record)
    assert {verdict.name for verdict in again.verdicts.values()} == {"contradicted"}
