"""Trials of the user test: they measure, and leave the calibration as it is."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from handcal.calibration.procedure import Calibration
from handcal.core.types import EYES, Eye, Float64
from handcal.link.server import HeadsetServer
from handcal.session.drawn import drawn_shifts
from handcal.session.session import Session
from handcal.station.user_test.trials import Trials
from tests.calibration.stage import RIG, Stage, shows
from tests.helpers import eventually

ASIDE_M = np.array([0.002, -0.001, 0.0])


@pytest.fixture
def trials(stage: Stage, server: HeadsetServer, session: Session) -> Trials:
    stage.calibrate()
    return Trials(stage.calibration, RIG, server, session)


def calibrated_m(stage: Stage) -> dict[Eye, Float64]:
    assert stage.calibration.results is not None
    return dict(stage.calibration.results.rendered_shift_m)


def adjust(stage: Stage, trials: Trials, eye: Eye) -> None:
    """Move φ as the window does: drawn at once, and recorded once it rests."""
    stage.calibration.set_shift({eye: stage.calibration.applied_shift_m[eye] + ASIDE_M})
    trials.record_shift()


@pytest.mark.parametrize("shows_target", [True, False])
def test_a_trial_does_not_move_the_calibration(
    stage: Stage, trials: Trials, session: Session, shows_target: bool
) -> None:
    before_m = calibrated_m(stage)
    for eye in (*EYES, *EYES):
        if shows_target:
            trials.show_target(eye, 0.5)
        adjust(stage, trials, eye)
        trials.save(eye, 0.5)
    trials.hide_target()
    eventually(lambda: all(shows(stage, eye, before_m[eye]) for eye in EYES))
    for eye in EYES:
        np.testing.assert_array_equal(session.contents.applied_shift_m[eye], before_m[eye])
    kept = {eye: one.kind for eye, one in drawn_shifts(session.contents).items()}
    assert set(kept.values()) == {"solved"}
    first, second, third, fourth = session.contents.trials.values()
    np.testing.assert_array_equal(first.error_px, third.error_px)  # independent of each other
    np.testing.assert_array_equal(second.error_px, fourth.error_px)
    assert first.error_px.min() > 0.0


def test_a_trial_that_is_interrupted_leaves_nothing(
    stage: Stage, trials: Trials, server: HeadsetServer, session: Session, tmp_path: Path
) -> None:
    before_m = calibrated_m(stage)["left"]
    trials.show_target("left", 0.4)
    adjust(stage, trials, "left")
    np.testing.assert_array_equal(session.contents.applied_shift_m["left"], before_m)
    session.close()
    with Session(session.path) as again:
        resumed = Calibration(again, server, stage.calibration.settings)
        np.testing.assert_array_equal(resumed.applied_shift_m["left"], before_m)


def test_phi_set_by_hand_outlasts_the_trials_of_the_other_eye(
    stage: Stage, trials: Trials, session: Session
) -> None:
    adjust(stage, trials, "right")
    by_hand_m = stage.calibration.applied_shift_m["right"]
    trials.show_target("left", 0.5)
    adjust(stage, trials, "left")
    trials.save("left", 0.5)
    trials.hide_target()
    np.testing.assert_array_equal(stage.calibration.applied_shift_m["right"], by_hand_m)
    assert drawn_shifts(session.contents)["right"].kind == "set by hand"


def test_each_trial_may_start_moved_aside_at_random(stage: Stage, trials: Trials) -> None:
    solved_m = calibrated_m(stage)["left"]
    starts = []
    trials.show_target("left", 0.5, starts_aside=True)
    for _ in range(3):
        starts.append(stage.calibration.applied_shift_m["left"] - solved_m)
        trials.save("left", 0.5)
    apart = [np.linalg.norm(one - other) for one, other in pairwise(starts)]
    assert min(apart) > 1e-4
    assert all(0.0005 < np.linalg.norm(start) < 0.006 for start in starts)
    trials.hide_target()
    np.testing.assert_array_equal(stage.calibration.applied_shift_m["left"], solved_m)


def test_a_cursor_waits_for_nothing_and_phi_returns_after_it(stage: Stage, trials: Trials) -> None:
    solved_m = calibrated_m(stage)["left"]
    trials.show_target("left", 0.5)
    adjust(stage, trials, "left")
    stage.make_cursor()
    trials.follow_procedure()
    assert not trials.target_E_m
    stage.calibration.redo()
    trials.follow_procedure()
    np.testing.assert_array_equal(stage.calibration.applied_shift_m["left"], solved_m)
