"""The procedure, driven by rendered frames and by a headset over real datagrams."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from operator import methodcaller
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handcal.calibration.hands import MATCH_NS
from handcal.calibration.procedure import Calibration
from handcal.calibration.sight import FROZEN_FRAMES
from handcal.calibration.states import ProcedureError, State
from handcal.core.display import projection_matrix, update_matrix, view_of_eye
from handcal.core.errors import FileError
from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import EYES, Eye, Float64, Frame, HeadsetIdentity, HeadsetView
from handcal.link.client import HeadsetClient
from handcal.link.server import HeadsetServer
from handcal.register.results import results_json
from handcal.session.session import Session
from handcal.session.state import facts_json
from tests.calibration.stage import (
    CAMERA,
    CAMERA_AHEAD_NS,
    IDENTITY,
    PERIOD_NS,
    RIG,
    SENSOR,
    T_D_HAND,
    T_D_NEAR,
    T_W_H,
    Stage,
    depth_of,
    events,
)
from tests.helpers import eventually

TANGENTS = np.array([-0.3, 0.3, 0.2, -0.2])


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
    outline_W_m = transform(T_W_H @ RIG.T_H_D, seen.hand.cloud.outline_m)
    # Marks follow the outline: more points beside it, at the finger tips and the wrist.
    np.testing.assert_allclose(shown.cursor_W_m[: len(outline_W_m)], outline_W_m, atol=1e-3)
    assert len(outline_W_m) < len(shown.cursor_W_m) < 2 * len(outline_W_m)
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
        "created", "facts_saved", "facts_saved", "cursor_made", "alignment_saved", "solved",
        "applied",
    ]  # fmt: skip
    assert record.facts.camera is not None
    assert record.facts.camera.depth_intrinsics == CAMERA
    age_s = record.alignment_facts[1].match_age_s
    assert age_s is not None
    assert 0.0 <= 1e9 * age_s <= MATCH_NS


def introduce(stage: Stage, identity: HeadsetIdentity) -> None:
    """Have the headset introduce itself, and see some frames."""
    stage.client.set_identity(identity)
    eventually(lambda: facts_json(stage.server.device) == facts_json(identity))
    for _ in range(2):
        stage.see(None)


def test_the_headset_is_stored_when_it_is_another_and_not_when_its_eyes_move(
    server: HeadsetServer, client: HeadsetClient, session: Session
) -> None:
    views: dict[Eye, HeadsetView] = {
        eye: HeadsetView(rigid([0.0, 0.0, 0.0], [x_m, 0.0, 0.0]), TANGENTS, 1268, 720)
        for eye, x_m in zip(EYES, (0.0321, -0.0322), strict=True)
    }
    moved = views | {"left": replace(views["left"], T_V_H=np.eye(4))}
    told = [
        IDENTITY,
        replace(IDENTITY, views=views),
        replace(IDENTITY, views=views, eye_distance_m=0.0631),
        replace(IDENTITY, views=moved, eye_distance_m=0.0632),  # as the eyes are tracked
        replace(IDENTITY, views=moved, eye_distance_m=0.0632, app="app 2"),
    ]

    def stored() -> list[Any]:
        return [data["headset"] for name, data in events(session) if name == "facts_saved"]

    first = Stage(server, client, session)
    for identity in told:
        introduce(first, identity)
    assert stored() == [facts_json(told[number]) for number in (0, 1, 2, 4)]
    record = Session.open(session.path)
    assert facts_json(record.facts.headset) == facts_json(told[4])

    again = Stage(server, client, session)
    introduce(again, told[4])
    assert len(stored()) == 4
    introduce(again, replace(told[4], runtime="runtime 2"))
    assert stored()[4]["runtime"] == "runtime 2"


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
    assert stage.shown().eyes == stage.shown().cursor_eyes == ("right",)
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


@pytest.mark.parametrize(("slip_m", "left_over"), [(0.0, 0.95), (0.002, 0.7)])
def test_a_second_alignment_is_drawn_with_the_first_and_improves_on_it(
    stage: Stage, slip_m: float, left_over: float
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
    # Both are drawn towards the eye box's middle, the second less. What could be an error of the
    # whole sitting, as the drawn outline's, a second alignment does not make more certain.
    assert after_m < left_over * before_m
    if slip_m == 0.0:
        assert np.trace(fused.covariance_m2) < np.trace(first.covariance_m2)


def test_a_hand_held_before_a_slow_camera_is_steady(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tests.calibration.stage.PERIOD_NS", 350_000_000)
    assert not stage.hold(frames=1).is_steady
    assert stage.hold(frames=3).is_steady
    assert not stage.see(rigid([-0.2, 0.0, 0.0], [0.02, 0.0, 0.5])).is_steady


CALLS: dict[str, Callable[[Calibration], object]] = {
    "set_shift": lambda calibration: calibration.set_shift({"left": np.zeros(3)}),
    "delete_alignment": lambda calibration: calibration.delete_alignment(1),
    "restore_alignment": lambda calibration: calibration.restore_alignment(1),
}
OUT_OF_TURN = {
    State.SHOW_HAND: "make_cursor confirm solve apply wait_applied poll_applied redo",
    State.ALIGN: "solve apply wait_applied set_shift delete_alignment restore_alignment",
    State.ALIGNED: "make_cursor confirm apply wait_applied set_shift",
    State.SOLVED: "make_cursor confirm wait_applied set_shift",
    State.APPLYING: (
        "make_cursor confirm solve apply redo set_shift delete_alignment restore_alignment"
    ),
    State.APPLIED: "confirm apply wait_applied redo",
    State.VERIFY: (
        "make_cursor confirm solve apply redo set_shift delete_alignment restore_alignment"
    ),
}


def test_out_of_turn_every_call_is_refused_and_changes_nothing(stage: Stage) -> None:
    calibration = stage.calibration

    def align() -> None:
        stage.press()
        stage.see()

    def verify() -> None:
        stage.hold()
        eventually(lambda: calibration.is_applied)
        calibration.verify("left")

    steps: dict[State, Callable[[], object]] = {
        State.SHOW_HAND: lambda: None,
        State.ALIGN: stage.make_cursor,
        State.ALIGNED: align,
        State.SOLVED: calibration.solve,
        State.APPLYING: calibration.apply,
        State.APPLIED: calibration.wait_applied,
        State.VERIFY: verify,
    }
    for state, step in steps.items():
        step()
        for name in OUT_OF_TURN[state].split():
            with pytest.raises(ProcedureError):
                CALLS.get(name, methodcaller(name))(calibration)
            assert stage.state() is state


def test_what_the_disk_did_not_take_is_kept_and_stored_later(
    stage: Stage, session: Session, tmp_path: Path
) -> None:
    calibration, away = stage.calibration, tmp_path / "away"
    stage.make_cursor()
    stage.see(T_D_NEAR)
    stage.press()
    session.path.rename(away)
    assert stage.see(T_D_NEAR).hand is not None
    assert stage.state() is State.ALIGNED
    assert [event.name for event in session.contents.unwritten] == ["alignment_saved"]
    with pytest.raises(FileError, match="cannot write"):
        session.write_waiting()
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
    assert session.contents.unwritten == ()
    assert len(Session.open(session.path).alignments) == 2


def test_a_full_session_says_so_before_the_wearer_aligns(stage: Stage, session: Session) -> None:
    session._state.alignments.limit = 1
    stage.align()
    stage.calibration.redo()
    stage.calibration.restore_alignment(1)  # a deleted one would not count
    stage.hold()
    with pytest.raises(ProcedureError, match="full: no room for more than 1 alignments"):
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
        seen = stage.calibration.see(now)
    assert seen.contradiction is not None
    assert seen.contradiction.name == "frozen-camera"
    assert "does not change" in seen.problem
    with pytest.raises(ProcedureError, match="hold the hand still"):
        stage.calibration.make_cursor()
    stage.make_cursor()  # the camera is alive again
    assert stage.calibration.evidence.contradictions == ()


def test_a_headset_that_is_taken_off_leaves_a_finished_session_alone(
    stage: Stage, session: Session
) -> None:
    worn = replace(IDENTITY, eye_distance_m=0.063)
    introduce(stage, worn)
    introduce(stage, IDENTITY)
    assert len([name for name, _ in events(session) if name == "facts_saved"]) == 1
    session.finish()
    introduce(stage, replace(IDENTITY, app="app 2"))
    assert Session.open(session.path).is_finished
    session.record("cursor_made")  # the session goes on
    stage.see(None)
    found = Session.open(session.path).facts.headset
    assert found is not None
    assert found.app == "app 2"


def test_an_alignment_that_the_session_cannot_take_is_refused(
    stage: Stage, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as small:
        small.setattr("handcal.session.session.MAX_ALIGNMENT_BYTES", 10)
        stage.make_cursor()
        stage.hold()
        stage.press()
        eventually(lambda: stage.see() and stage.calibration.refusal)
    assert "too large" in stage.calibration.refusal
    assert stage.state() is State.ALIGN
    assert stage.calibration.alignments == {}
    stage.press()
    eventually(lambda: stage.see() and stage.state() is State.ALIGNED)
    assert list(Session.open(session.path).alignments) == [1]
