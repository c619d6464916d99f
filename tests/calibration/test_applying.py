"""Projections sent to the headset and acknowledged, or not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.calibration.procedure import Calibration
from handcal.calibration.solve_again import solve
from handcal.calibration.states import ProcedureError, State
from handcal.core.display import projection_matrix
from handcal.core.errors import LinkError
from handcal.core.types import EYES, Eye, Float64, Verdict, VerdictName
from handcal.link.client import HeadsetClient
from handcal.link.server import HeadsetServer
from handcal.session.session import Session
from tests.calibration.stage import (
    RIG,
    T_D_HAND,
    T_D_NEAR,
    Stage,
    connect,
    shows_offline_projections,
)
from tests.helpers import eventually


def test_the_offline_projections_come_first(
    stage: Stage, server: HeadsetServer, tmp_path: Path
) -> None:
    stage.calibrate()
    with Session.create(tmp_path, RIG, {}, name="another") as another:
        Calibration(another, server)
    eventually(lambda: shows_offline_projections(stage.shown()))


@pytest.mark.parametrize("name", ["keep", "implausible", "contradicted"])
def test_a_result_not_used_leaves_the_offline_calibration_in_the_headset(
    stage: Stage, session: Session, name: VerdictName
) -> None:
    stage.align()
    solved = stage.calibration.solve()
    verdicts: dict[Eye, Verdict] = {
        "left": Verdict(name, "as told"),
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
    stage: Stage, server: HeadsetServer, client: HeadsetClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("handcal.calibration.procedure._APPLY_TIMEOUT_S", 0.2)
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
