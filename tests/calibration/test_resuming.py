"""Sessions whose program was killed, and those that are damaged, continued."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.calibration.procedure import Calibration
from handcal.calibration.states import ProcedureError, State
from handcal.core.types import Alignment
from handcal.link.server import HeadsetServer
from handcal.register.results import SolveSettings, results_json, solve_session
from handcal.session.session import Session
from tests.calibration.stage import RIG, SETTINGS, Stage, shows, shows_offline_projections
from tests.helpers import eventually

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


def resumed(stage: Stage, session: Session) -> tuple[Stage, Session]:
    """Resume a session as after a crash: the old calibration receives no message."""
    session.close()
    again = Session(session.path)
    return Stage(stage.server, stage.client, again), again


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
    with Session.create(session.path.parent, RIG, {}, name="another") as another:
        Calibration(another, stage.server)  # has used the headset in between
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
    assert Session.open(session.path).is_applied, "of all that is left"
    stage.align()
    assert list(stage.calibration.alignments) == [1, 3]
    stage.calibration.delete_alignment(3)
    record = Session.open(session.path)
    assert (list(record.alignments), list(record.deleted_alignments)) == ([1], [3])
    session.close()


def test_a_session_that_can_no_longer_be_solved_is_not_resumed(
    server: HeadsetServer, session: Session, alignment: Alignment
) -> None:
    session.save_alignment(replace(alignment, hand_is_cut=np.ones_like(alignment.hand_is_cut)))
    session.save_results({})
    with pytest.raises(ProcedureError, match=r"cannot be resumed: .* beside cut edges"):
        Calibration(session, server, SETTINGS)
