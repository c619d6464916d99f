"""Alignments deleted and restored, and φ and the eye distance set by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.calibration.solve_again import solve
from handcal.calibration.states import ProcedureError, State
from handcal.core.display import projection_matrix
from handcal.core.errors import FileError
from handcal.core.types import Eye, EyeDistance, Float64, Projection
from handcal.link.client import HeadsetClient
from handcal.link.server import HeadsetServer
from handcal.register.results import SolveSettings, results_json, solve_session
from handcal.session.session import Session
from tests.calibration.stage import IDENTITY, RIG, T_D_HAND, Stage, shows, shows_offline_projections
from tests.helpers import eventually


def test_redo_gives_up_the_cursor_or_the_last_alignment(stage: Stage, session: Session) -> None:
    calibration = stage.calibration
    stage.calibrate()
    applied = calibration.results
    with pytest.raises(ProcedureError, match="nothing to redo"):
        calibration.redo()

    stage.make_cursor()
    calibration.redo()
    assert stage.state() is State.APPLIED
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


def test_redo_takes_back_a_projection_that_came_alone(stage: Stage, server: HeadsetServer) -> None:
    stage.align()
    shift_m = stage.calibration.solve().eyes["left"].shift_m
    P = projection_matrix(RIG.eyes["left"], shift_m)
    server.wait_acked(server.send_projection(Projection("left", P, 1268, 720)), 5.0)
    assert not shows_offline_projections(stage.shown())
    stage.calibration.redo()
    eventually(lambda: shows_offline_projections(stage.shown()))


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
    resumed = Stage(server, client, session)
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
