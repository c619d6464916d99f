"""A session that begins with a stored one, and the way back to what was drawn before."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from handcal.calibration.procedure import Calibration
from handcal.calibration.solve_again import (
    LONGEST_WORN,
    SLIP_M,
    end_former,
    may_still_be_worn,
    read_former,
)
from handcal.calibration.states import ProcedureError, State
from handcal.core.errors import FileError
from handcal.core.types import EYES, Eye, Float64
from handcal.session.library import unfinished_and_repaired
from handcal.session.session import Session
from tests.calibration.stage import RIG, SETTINGS, Stage, events
from tests.helpers import eventually


def test_the_stored_shift_and_its_widened_posterior(stage: Stage, session: Session) -> None:
    stage.calibrate()
    former = read_former(session.path, RIG)
    results = stage.calibration.results
    assert results is not None
    assert former.prior is not None
    covariance_m2 = np.reshape(former.prior.covariance_m2, (6, 6))
    for part, eye in enumerate(EYES):
        rendered_m = results.rendered_shift_m[eye]
        np.testing.assert_allclose(former.shift_m[eye], rendered_m)
        own = slice(3 * part, 3 * part + 3)
        widening_m2 = covariance_m2[own, own] - np.diag(np.square(SLIP_M))
        assert (np.linalg.eigvalsh(widening_m2) > 0.0).all()
    # The headset slips as a whole: the difference between the eyes stays as well known.
    apart = np.hstack([-np.eye(3), np.eye(3)])
    fused = results.fused
    assert np.trace(apart @ covariance_m2 @ apart.T) < 1.05 * np.trace(
        apart @ fused.prior.covariance_m2[:6, :6] @ apart.T
    )


def test_a_session_of_another_rig_or_without_an_alignment_is_refused(
    stage: Stage, session: Session, tmp_path: Path
) -> None:
    with pytest.raises(FileError, match="no alignment"):
        read_former(session.path, RIG)
    stage.calibrate()
    with pytest.raises(FileError, match="another rig"):
        read_former(session.path, replace(RIG, T_H_D=np.eye(4)))
    session.save_facts(evidence=("other-camera",), contradictions=("another camera",))
    with pytest.raises(FileError, match=r"to start from\. Another camera"):
        read_former(session.path, RIG)


def test_the_headset_begins_with_the_former_shift(stage: Stage, session: Session) -> None:
    former_m: dict[Eye, Float64] = {
        "left": np.array([0.001, 0.0, 0.002]),
        "right": np.array([-0.001, 0.0, 0.0]),
    }
    stage.calibration = Calibration(session, stage.server, SETTINGS, former_m)
    eventually(lambda: stage.calibration.is_applied)
    for eye in EYES:
        np.testing.assert_allclose(stage.calibration.applied_shift_m[eye], former_m[eye])
    stage.calibration.go_back("offline")
    np.testing.assert_allclose(stage.calibration.applied_shift_m["left"], 0.0)
    stage.calibration.go_back("former")
    np.testing.assert_allclose(stage.calibration.applied_shift_m["left"], former_m["left"])


def test_one_key_goes_back_and_forth_between_the_newest_two(stage: Stage, session: Session) -> None:
    stage.calibrate()
    solved_m = stage.calibration.applied_shift_m["left"]
    assert np.linalg.norm(solved_m) > 0.0
    stage.calibration.go_back("former")
    eventually(lambda: stage.calibration.is_applied)
    np.testing.assert_allclose(stage.calibration.applied_shift_m["left"], 0.0)
    np.testing.assert_allclose(Session.open(session.path).applied_shift_m["left"], 0.0)
    stage.calibration.go_back("former")
    np.testing.assert_allclose(stage.calibration.applied_shift_m["left"], solved_m)
    assert [name for name, _ in events(session)].count("went_back") == 2
    assert stage.state() is State.APPLIED


def test_going_back_gives_up_a_cursor_and_a_verification(stage: Stage) -> None:
    stage.make_cursor()
    stage.calibration.go_back("offline")
    assert stage.state() is State.SHOW_HAND
    eventually(lambda: stage.shown().cursor_W_m is None)
    stage.hold()
    eventually(lambda: stage.calibration.is_applied)
    stage.calibration.verify("left")
    stage.calibration.nudge("left", 5.0, 5.0)
    stage.calibration.go_back("offline")
    assert stage.calibration.verifying is None
    eventually(lambda: stage.shown().verify is None)
    np.testing.assert_allclose(stage.calibration.applied_shift_m["left"], 0.0)
    with pytest.raises(ProcedureError):
        stage.calibration.nudge("left", 1.0, 0.0)


def test_going_back_loses_no_alignment_and_no_result(stage: Stage, session: Session) -> None:
    calibration = stage.calibration
    stage.align()
    calibration.go_back("offline")
    assert stage.state() is State.ALIGNED
    calibration.solve()
    calibration.go_back("offline")
    assert stage.state() is State.SOLVED
    calibration.apply()
    calibration.go_back("offline")
    assert stage.state() is State.SOLVED
    calibration.apply()
    calibration.wait_applied()
    stage.make_cursor()
    calibration.go_back("offline")
    assert stage.state() is State.APPLIED
    session.finish()
    calibration.go_back("former")
    assert Session.open(session.path).is_finished


def test_a_headset_may_have_moved_hours_after_the_last_event(session: Session) -> None:
    record = session.contents
    last = datetime.fromisoformat(record.events[-1].time)
    assert may_still_be_worn(record, last + LONGEST_WORN)
    assert not may_still_be_worn(record, last + LONGEST_WORN + timedelta(seconds=1))


def test_a_session_from_which_another_began_is_over(stage: Stage, session: Session) -> None:
    stage.calibrate()
    session.close()
    end_former(session.path)
    assert Session.open(session.path).is_finished
    assert not unfinished_and_repaired(session.path.parent)[0]
