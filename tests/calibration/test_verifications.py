"""Verification of one eye: the wearer's and the technician's nudges, stored, fused and resumed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from handcal.calibration.states import ProcedureError, State
from handcal.calibration.verifying import (
    SET_ASIDE_PROMPT,
    UNMOVED_PROMPT,
    draw_offset,
    skipped_eyes,
)
from handcal.core.display import projection_matrix
from handcal.core.errors import FileError
from handcal.core.geometry import rigid
from handcal.core.types import EYES, Eye, Float64
from handcal.link.client import HeadsetClient
from handcal.link.nudges import MAX_NUDGE_ARCMIN, NudgeSum
from handcal.link.server import HeadsetServer
from handcal.register.model import nudged_shift_m
from handcal.session.session import Session
from tests.calibration.stage import (
    HEADSET_AHEAD_NS,
    RIG,
    Stage,
    connect,
    events,
)
from tests.helpers import eventually

STILL = NudgeSum()


def begin(stage: Stage, eye: Eye = "left") -> None:
    """Calibrate, hold the hand still and begin a verification."""
    stage.calibrate()
    stage.hold()
    verify(stage, eye)


def verify(stage: Stage, eye: Eye) -> None:
    eventually(lambda: stage.calibration.is_applied)
    stage.calibration.verify(eye)
    eventually(lambda: stage.shown().verify and stage.shown().eyes == (eye,))


def press(stage: Stage, moved: NudgeSum, fits: bool = False) -> None:
    """Send the wearer's nudge with what is drawn now, and step."""
    t_ns = stage.t_ns + HEADSET_AHEAD_NS
    stage.client.wait_acked(stage.client.nudge(t_ns, stage.shown(), moved, fits), 5.0)
    stage.wait_checked()
    stage.see()


def drawn_px(stage: Stage, eye: Eye) -> Float64:
    """Return the projection that the headset draws with, once all have arrived."""
    eventually(lambda: stage.calibration.is_applied)
    return stage.shown().drawn[eye].P


def fits(stage: Stage, moved: NudgeSum = STILL) -> None:
    drawn_px(stage, "left")
    press(stage, moved, fits=True)
    stage.calibration.wait_applied()


def nudged(stage: Stage) -> None:
    """Have the technician move the drawing, so that the wearer's word is evidence."""
    stage.calibration.nudge("left", 1.0, 1.0)
    eventually(lambda: stage.calibration.is_applied)
    stage.hold()


def set_aside(stage: Stage, eye: Eye = "left") -> NudgeSum:
    """Have the wearer confirm a drawing that nobody moved; return where it was moved then."""
    drawn_px(stage, eye)
    press(stage, STILL, fits=True)
    assert stage.state() is State.VERIFY
    eventually(lambda: stage.shown().prompt == SET_ASIDE_PROMPT)
    assert stage.calibration.verifying is not None
    return stage.calibration.verifying.offset


def whole(offset: NudgeSum) -> NudgeSum:
    """Return presses that bring a drawing back to within half a press."""
    return NudgeSum(
        float(-round(offset.right_arcmin)),
        float(-round(offset.down_arcmin)),
        -0.002 * round(offset.size / 0.002),
    )


def raising(error: BaseException) -> Callable[..., None]:
    def call(*_: object) -> None:
        raise error

    return call


def test_the_headset_verifies_one_eye_and_shows_the_outline(stage: Stage) -> None:
    begin(stage, "right")
    assert stage.state() is State.VERIFY
    stage.see()
    eventually(lambda: stage.shown().is_outline)
    shown = stage.shown()
    assert shown.verify is not None
    assert (shown.verify.eye, shown.live_eyes, shown.eyes) == ("right", ("right",), ("right",))
    assert "close your left eye" in shown.prompt
    stage.calibration.skip_verification()
    assert stage.state() is State.APPLIED
    eventually(lambda: stage.shown().verify is None and stage.shown().prompt == "")


def test_each_nudge_changes_the_projection_and_the_word_stores_and_fuses_it(
    stage: Stage, session: Session
) -> None:
    begin(stage)
    before_m = stage.calibration.applied_shift_m["left"]
    alone = stage.calibration.results
    verifying = stage.calibration.verifying
    assert verifying is not None
    hand_E_m = verifying.hand_E_m
    press(stage, NudgeSum(3.0, 0.0, 0.0))
    press(stage, NudgeSum(3.0, -2.0, 0.004))
    expected_m = nudged_shift_m(RIG.eyes["left"], before_m, hand_E_m, 3.0, -2.0, 0.004)
    np.testing.assert_allclose(
        drawn_px(stage, "left"), projection_matrix(RIG.eyes["left"], expected_m)
    )
    fits(stage, NudgeSum(3.0, -2.0, 0.004))
    assert stage.state() is State.APPLIED
    found = Session.open(session.path).facts.verified["left"]
    assert found == stage.calibration.verifications["left"]
    np.testing.assert_allclose(found.before_m, before_m)
    np.testing.assert_allclose(found.after_m, expected_m)
    assert found.nudge_arcmin == (3.0, -2.0)
    assert found.nudge_size == 0.004
    assert found.hand_E_m is not None
    assert np.linalg.norm(np.subtract(found.hand_E_m, hand_E_m)) < 0.005
    results = stage.calibration.results
    assert alone is not None
    assert results is not None
    # The observation pulls φ toward where the drawing covered the hand, and makes it surer.
    assert np.linalg.norm(results.eyes["left"].shift_m - expected_m) < np.linalg.norm(
        alone.eyes["left"].shift_m - expected_m
    )
    assert np.trace(results.eyes["left"].covariance_m2) < np.trace(alone.eyes["left"].covariance_m2)
    np.testing.assert_allclose(
        stage.calibration.applied_shift_m["left"], results.rendered_shift_m["left"]
    )
    assert Session.open(session.path).is_applied


def test_wearer_and_technician_add_up_and_the_technician_undoes(stage: Stage) -> None:
    begin(stage)
    calibration = stage.calibration
    press(stage, NudgeSum(2.0))
    calibration.nudge("left", 0.0, 5.0)
    press(stage, NudgeSum(1.0))
    assert calibration.verifying is not None
    assert calibration.verifying.moved == NudgeSum(1.0, 5.0)
    calibration.undo_nudge()
    assert calibration.verifying.moved == NudgeSum(2.0, 5.0)
    calibration.undo_nudge()
    calibration.undo_nudge()
    assert calibration.verifying.moved == NudgeSum()
    np.testing.assert_allclose(
        calibration.applied_shift_m["left"], calibration.verifying.before_m, atol=1e-12
    )
    with pytest.raises(ProcedureError, match="no nudge to undo"):
        calibration.undo_nudge()
    with pytest.raises(ProcedureError, match="right eye is not being verified"):
        calibration.nudge("right", 1.0, 0.0)
    with pytest.raises(ProcedureError, match="at most"):
        calibration.nudge("left", 2.0 * MAX_NUDGE_ARCMIN, 0.0)
    assert calibration.verifying.moved == NudgeSum()


def test_a_skipped_verification_leaves_no_trace_in_what_is_drawn(
    stage: Stage, session: Session
) -> None:
    begin(stage)
    before_m = stage.calibration.applied_shift_m["left"]
    press(stage, NudgeSum(9.0, 9.0))
    stage.calibration.skip_verification()
    np.testing.assert_allclose(stage.calibration.applied_shift_m["left"], before_m)
    np.testing.assert_allclose(
        drawn_px(stage, "left"), projection_matrix(RIG.eyes["left"], before_m)
    )
    record = Session.open(session.path)
    assert not record.facts.verified
    assert record.is_applied
    assert "verification_skipped" in dict(events(session))


def test_a_word_for_another_drawing_or_a_moving_hand_is_refused(
    stage: Stage, session: Session
) -> None:
    begin(stage)
    former = stage.shown()
    t_ns = stage.t_ns + HEADSET_AHEAD_NS
    stage.calibration.nudge("left", 4.0, 0.0)
    drawn_px(stage, "left")
    stage.client.wait_acked(stage.client.nudge(t_ns, former, NudgeSum(), True), 5.0)
    stage.see()
    assert stage.state() is State.VERIFY
    assert "drawing has changed" in stage.calibration.refusal
    stage.see(rigid([-0.2, 0.0, 0.0], [0.02, 0.0, 0.5]))
    press(stage, NudgeSum(), fits=True)
    assert stage.state() is State.VERIFY
    assert "still" in stage.calibration.refusal
    assert [name for name, _ in events(session)].count("verification_refused") == 2
    stage.hold()
    fits(stage)
    assert stage.state() is State.APPLIED
    assert not stage.calibration.evidence.contradictions


def test_a_word_with_a_last_nudge_counts_only_once_the_wearer_has_seen_it(stage: Stage) -> None:
    begin(stage)
    press(stage, NudgeSum(1.0), fits=True)
    assert stage.state() is State.VERIFY
    eventually(lambda: "Look and confirm again" in stage.shown().prompt)
    fits(stage, NudgeSum(1.0))
    assert stage.state() is State.APPLIED


def test_a_drawing_that_fits_at_once_is_moved_aside_and_counts_once_it_is_brought_back(
    stage: Stage, session: Session
) -> None:
    begin(stage)
    before_m = stage.calibration.applied_shift_m["left"]
    verifying = stage.calibration.verifying
    assert verifying is not None
    assert verifying.needs_proof
    offset = set_aside(stage)
    assert not verifying.needs_proof
    assert not verifying.is_moved
    assert verifying.view().is_set_aside
    aside_m = nudged_shift_m(
        RIG.eyes["left"],
        before_m,
        verifying.hand_E_m,
        offset.right_arcmin,
        offset.down_arcmin,
        offset.size,
    )
    np.testing.assert_allclose(
        drawn_px(stage, "left"), projection_matrix(RIG.eyes["left"], aside_m)
    )
    assert not stage.calibration.verifications
    back = whole(offset)
    press(stage, back)
    fits(stage, back)
    assert stage.state() is State.APPLIED
    found = Session.open(session.path).facts.verified["left"]
    assert found == stage.calibration.verifications["left"]
    assert found.was_moved
    assert found.nudge_arcmin == (back.right_arcmin, back.down_arcmin)
    assert found.nudge_size == back.size
    assert found.offset_arcmin == (offset.right_arcmin, offset.down_arcmin)
    assert found.offset_size == offset.size
    np.testing.assert_allclose(found.before_m, before_m)
    # At half a metre, half a press is a tenth of a millimetre across and 0.7 mm along.
    np.testing.assert_allclose(found.after_m[:2], before_m[:2], atol=3e-4)
    assert found.after_m[2] == pytest.approx(before_m[2], abs=1.5e-3)
    results = stage.calibration.results
    assert results is not None
    assert set(results.fused.verified) == {"left"}
    assert results.verified["left"].moved_arcmin < 1.0


def test_a_wearer_who_confirms_twice_without_moving_gives_no_evidence(
    stage: Stage, session: Session
) -> None:
    begin(stage)
    alone, before_m = stage.calibration.results, stage.calibration.applied_shift_m["left"]
    set_aside(stage)
    drawn_px(stage, "left")
    press(stage, STILL, fits=True)
    assert stage.state() is State.APPLIED
    eventually(lambda: stage.shown().prompt == UNMOVED_PROMPT)
    assert stage.calibration.unmoved == {"left"}
    assert not stage.calibration.verifications
    assert stage.calibration.results is alone
    # The drawing does not stay where the program moved it.
    np.testing.assert_array_equal(stage.calibration.applied_shift_m["left"], before_m)
    np.testing.assert_allclose(
        drawn_px(stage, "left"), projection_matrix(RIG.eyes["left"], before_m)
    )
    record = Session.open(session.path)
    assert not record.facts.verified
    assert skipped_eyes(record.events) == {"left"}
    # The technician may ask for it once more.
    stage.hold()
    verify(stage, "left")
    assert not stage.calibration.unmoved
    press(stage, NudgeSum(1.0))
    fits(stage, NudgeSum(1.0))
    assert set(stage.calibration.verifications) == {"left"}


def test_without_alignments_no_evidence_makes_no_result(stage: Stage, session: Session) -> None:
    stage.hold()
    verify(stage, "left")
    set_aside(stage)
    drawn_px(stage, "left")
    press(stage, STILL, fits=True)
    assert stage.state() is State.SHOW_HAND
    assert stage.calibration.results is None
    assert not Session.open(session.path).is_solvable
    with pytest.raises(ProcedureError, match="align the hand"):
        stage.calibration.solve()


def test_the_technician_s_word_for_a_drawing_that_nobody_moved_is_not_enough(stage: Stage) -> None:
    begin(stage)
    stage.hold()
    stage.calibration.verified()
    assert stage.state() is State.VERIFY
    eventually(lambda: stage.shown().prompt == SET_ASIDE_PROMPT)
    verifying = stage.calibration.verifying
    assert verifying is not None
    back = whole(verifying.offset)
    stage.calibration.nudge("left", back.right_arcmin, back.down_arcmin, back.size)
    drawn_px(stage, "left")
    stage.hold()
    stage.calibration.verified()
    stage.calibration.wait_applied()
    found = stage.calibration.verifications["left"]
    assert found.was_moved
    assert any(found.offset_arcmin)


def test_a_drawing_moved_there_and_back_is_still_unproven(stage: Stage) -> None:
    begin(stage)
    stage.calibration.nudge("left", 2.0, 0.0)
    stage.calibration.undo_nudge()
    assert stage.calibration.verifying is not None
    assert stage.calibration.verifying.needs_proof
    set_aside(stage)


def test_drawings_are_moved_farther_than_a_wearer_overlooks_in_every_direction() -> None:
    rng = np.random.default_rng(0)
    offsets = [draw_offset(rng) for _ in range(400)]
    right, down, size = np.array([[o.right_arcmin, o.down_arcmin, o.size] for o in offsets]).T
    distance = np.hypot(right, down)
    assert 8.0 <= distance.min() < 8.2
    assert 11.8 < distance.max() <= 12.0
    assert np.abs(size).min() >= 0.015
    assert np.abs(size).max() <= 0.025
    assert abs(np.mean(right)) < 1.5
    assert abs(np.mean(down)) < 1.5
    assert 0.4 < np.mean(size > 0.0) < 0.6


@pytest.mark.parametrize("is_aside", [False, True])
def test_a_session_is_resumed_during_a_verification(
    stage: Stage, server: HeadsetServer, client: HeadsetClient, session: Session, is_aside: bool
) -> None:
    begin(stage, "right")
    offset = set_aside(stage, "right") if is_aside else STILL
    moved = STILL if is_aside else NudgeSum(2.0, 1.0, 0.002)
    if not is_aside:
        press(stage, moved)
    drawn_m = stage.calibration.applied_shift_m["right"]
    again = Stage(server, client, session)
    assert again.state() is State.VERIFY
    verifying = again.calibration.verifying
    assert verifying is not None
    assert (verifying.offset, verifying.moved) == (offset, moved)
    assert not verifying.needs_proof
    np.testing.assert_allclose(again.calibration.applied_shift_m["right"], drawn_m)
    again.hold()
    eventually(lambda: again.calibration.is_applied and again.shown().verify)
    again.calibration.nudge("right", 1.0, 0.0, -0.002)
    again.hold()
    again.calibration.verified()
    again.calibration.wait_applied()
    found = again.calibration.verifications["right"]
    assert found.nudge_arcmin == (moved.right_arcmin + 1.0, moved.down_arcmin)
    assert found.offset_arcmin == (offset.right_arcmin, offset.down_arcmin)
    assert found.offset_size == offset.size
    # Once it has ended, it is not resumed again.
    last = Stage(server, client, session)
    assert last.state() is State.APPLIED
    assert last.calibration.verifying is None
    assert last.calibration.verifications == again.calibration.verifications


def test_a_verification_that_cannot_be_written_is_sent_all_the_same(
    stage: Stage, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin(stage)
    nudged(stage)
    with monkeypatch.context() as full:
        full.setattr("handcal.session.journal.JournalWriter.append", raising(FileError("full")))
        with pytest.raises(FileError):
            stage.calibration.verified()
    assert stage.state() is State.APPLYING
    session.write_waiting()
    assert set(Session.open(session.path).facts.verified) == {"left"}


def test_a_verification_stored_by_a_killed_program_is_not_resumed(
    stage: Stage,
    server: HeadsetServer,
    client: HeadsetClient,
    session: Session,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    begin(stage)
    nudged(stage)
    with monkeypatch.context() as solving:
        killed = raising(KeyboardInterrupt())
        solving.setattr("handcal.calibration.procedure.solve_contents", killed)
        with pytest.raises(KeyboardInterrupt):
            stage.calibration.verified()
    again = Stage(server, client, session)
    assert again.state() is State.ALIGNED
    assert again.calibration.verifying is None
    assert set(again.calibration.verifications) == {"left"}


@pytest.mark.parametrize(
    "damage", [{"eye": "left"}, {"nudge_arcmin": ["a", 1.0]}, {"hand_E_m": [0.0, 0.0, -1.0]}]
)
def test_a_damaged_verification_is_not_resumed(
    stage: Stage,
    server: HeadsetServer,
    client: HeadsetClient,
    session: Session,
    damage: dict[str, Any],
) -> None:
    begin(stage)
    whole = {"before_m": [0.0] * 3, "hand_E_m": [0.0, 0.0, 0.5], "nudge_arcmin": [1.0, 1.0]}
    session.record("verifying", **({} if damage == {"eye": "left"} else whole) | damage)
    again = Stage(server, client, session)
    assert again.state() is State.APPLIED


def test_verifications_alone_make_a_result(stage: Stage) -> None:
    """With a stored φ, or the offline calibration, no alignment is needed."""
    for eye in EYES:
        stage.hold()
        verify(stage, eye)
        stage.calibration.nudge(eye, 1.0, -1.0)
        stage.hold(frames=2)
        eventually(lambda: stage.calibration.is_applied)
        stage.calibration.verified()
        stage.calibration.wait_applied()
    results = stage.calibration.results
    assert results is not None
    assert set(results.eyes) == set(EYES)
    assert not stage.calibration.alignments
    assert stage.state() is State.APPLIED


def test_a_headset_that_reconnects_is_asked_again(
    stage: Stage, server: HeadsetServer, client: HeadsetClient
) -> None:
    begin(stage)
    client.close()
    with connect(server) as other:
        eventually(lambda: other.state().verify)
        assert other.state().eyes == ("left",)
