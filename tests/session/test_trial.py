"""Trials and blinded comparisons of the user test."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from math import comb
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handcal.core.display import TARGET_DEPTHS_M, arcmin_from_px, update_matrix
from handcal.core.types import EYES, Alignment, Eye, Float64
from handcal.register.results import Results, SolveSettings, results_json, solve_session
from handcal.rig.example import example_rig
from handcal.session.record import eye_trials
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import (
    COMPARED,
    Answer,
    Comparison,
    Drawing,
    EyeTrials,
    Trial,
    calibration_numbers,
    comparison_json,
    count_comparisons,
    is_doubted,
    make_trial,
    read_comparisons,
    read_trial,
    sign_test,
    summarise_trials,
    trial_errors_arcmin,
    trial_json,
)

RIG = example_rig()
CALIBRATED_M = np.array([0.003, -0.002, 0.004])
ADJUSTED_M = np.array([0.0035, -0.001, 0.002])


def trial(depth_m: float = 0.5, adjusted_m: Float64 = ADJUSTED_M) -> Trial:
    return make_trial(RIG.eyes["left"], "left", depth_m, CALIBRATED_M, adjusted_m)


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("depth_m", TARGET_DEPTHS_M)
def test_errors_are_what_the_model_says(eye: Any, depth_m: float) -> None:
    display = RIG.eyes[eye]
    made = make_trial(display, eye, depth_m, CALIBRATED_M, ADJUSTED_M)
    assert (made.eye, made.target_depth_m, made.time) == (eye, depth_m, "")
    assert {tuple(corner) for corner in made.corners_E_m} == {
        (x, y, depth_m) for x in (-0.04, 0.04) for y in (-0.04, 0.04)
    }
    for number, corner_m in enumerate(made.corners_E_m):
        pixels = []
        for shift_m in (CALIBRATED_M, ADJUSTED_M):
            UQ = update_matrix(shift_m, display.z_C0_S_m)
            image = display.K @ display.H0 @ UQ[:3] @ [*corner_m, 1.0]
            pixels.append(image[:2] / image[2])
        np.testing.assert_allclose([made.drawn_px[number], made.truth_px[number]], pixels)
        error_px = np.hypot(*(pixels[0] - pixels[1]))
        assert made.error_px[number] == pytest.approx(error_px)
        assert made.error_arcmin[number] == pytest.approx(float(arcmin_from_px(display, error_px)))


def test_a_shift_aside_by_hand() -> None:
    # An eye 1 mm aside sees a point at 0.4 m against the display at 2 m off by 4 mm there.
    made = make_trial(RIG.eyes["left"], "left", 0.4, np.zeros(3), [0.001, 0.0, 0.0])
    np.testing.assert_allclose(made.error_arcmin, 60 * np.degrees(0.004 / 2.0), rtol=0.02)


@pytest.mark.parametrize("depth_m", [0.0, -0.5, np.nan, np.inf])
def test_a_target_that_does_not_stand_before_the_eye(depth_m: float) -> None:
    with pytest.raises(ValueError, match="in front of the eye"):
        trial(depth_m)


def test_it_comes_back_from_json_bit_for_bit() -> None:
    made = trial(0.6)
    back = read_trial(json.loads(json.dumps(trial_json(made))), "noon")
    assert back.time == "noon"
    for name, value in trial_json(made).items():
        assert trial_json(back)[name] == value


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"eye": "middle"}, "left or right"),
        ({"eye": ["left"]}, "left or right"),
        ({"target_depth_m": "far"}, "convert string"),
        ({"target_depth_m": [0.5]}, "something other than numbers"),
        ({"truth_px": [[1.0, 2.0]]}, "truth_px: expected an array of shape 4×2, got 1×2"),
        ({"error_px": [1.0, 2.0, 3.0, None]}, "error_px"),
        ({"error_px": [1.0, 2.0, 3.0, float("nan")]}, "error_px: must be finite"),
        ({"adjusted_shift_m": [0.0, 1e308, 0.0]}, "adjusted_shift_m: must be finite and less"),
        ({"target_depth_m": -1e308}, "target_depth_m: must be finite and less"),
        ({"error_px": {"a": 1}}, "something other than numbers"),
        ({"adjusted_shift_m": [0, 0, 10**400]}, "something other than numbers"),
    ],
)
def test_what_is_no_trial_is_refused(change: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        read_trial(trial_json(trial()) | change, "")


def test_statistics_are_of_all_corners() -> None:
    trials = [trial(depth_m, ADJUSTED_M * factor) for depth_m in (0.6, 0.4) for factor in (1, 2)]
    trials.append(replace(trials[0], eye="right"))
    statistics = summarise_trials(trials)
    assert statistics.total is not None
    px = np.concatenate([made.error_px for made in trials])
    arcmin = np.concatenate([made.error_arcmin for made in trials])
    assert (statistics.total.trials, statistics.total.corners) == (5, 20)
    for spread, values in ((statistics.total.px, px), (statistics.total.arcmin, arcmin)):
        assert spread.mean == pytest.approx(np.mean(values))
        assert spread.sd == pytest.approx(np.sqrt(np.sum((values - values.mean()) ** 2) / 19))
        assert spread.median == pytest.approx((np.sort(values)[9] + np.sort(values)[10]) / 2)
        assert (spread.min, spread.max) == (values.min(), values.max())
    assert list(statistics.by_eye) == ["left", "right"]
    assert statistics.by_eye["right"].px.mean == pytest.approx(trials[0].error_px.mean())
    assert list(statistics.by_depth_m) == [0.4, 0.6]
    assert statistics.by_depth_m[0.6].trials == 3
    json.dumps(asdict(statistics), allow_nan=False)


def test_trials_of_one_calibration_are_told_from_others() -> None:
    trials = [
        make_trial(RIG.eyes[eye], eye, depth_m, calibrated_m, ADJUSTED_M)
        for calibrated_m in (CALIBRATED_M, CALIBRATED_M + 1e-9, CALIBRATED_M)
        for eye in EYES
        for depth_m in (0.4, 0.6)
    ]
    of_calibration = (1, 1, 1, 1, 2, 2, 2, 2, 1, 1, 1, 1)
    assert calibration_numbers(dict(enumerate(trials))) == dict(enumerate(of_calibration))
    assert calibration_numbers({}) == {}


def test_trials_of_another_shift_judge_nothing_of_this_one() -> None:
    def trial(eye: Eye, apart_m: float) -> Trial:
        return make_trial(RIG.eyes[eye], eye, 0.4, CALIBRATED_M + apart_m, ADJUSTED_M)

    trials = [trial("left", 0.0), trial("left", 1e-9), trial("left", 1e-3), trial("right", 1e-3)]
    errors = [float(trial.error_arcmin.mean()) for trial in trials]
    both = dict.fromkeys(EYES, CALIBRATED_M)
    assert trial_errors_arcmin(trials, both) == {"left": errors[:2]}
    assert trial_errors_arcmin(trials, {"right": CALIBRATED_M + 1e-3}) == {"right": errors[3:]}
    unknown = dict.fromkeys(EYES, np.full(3, np.nan))
    assert trial_errors_arcmin(trials, unknown) == {}
    assert trial_errors_arcmin(trials) == {}
    of_either = trial_errors_arcmin(trials, both, {"right": CALIBRATED_M + 1e-3})
    assert of_either == {"left": errors[:2], "right": errors[3:]}


FORMER_M = np.array([0.01, 0.0, 0.0])


@pytest.fixture
def results(simulated: Callable[..., Alignment]) -> Results:
    return solve_session([simulated(1, ("left",))], RIG, SolveSettings())


@pytest.fixture
def record(session: Session, results: Results) -> SessionRecord:
    """Return a session solved with another φ, of both eyes, and a trial of each."""
    eyes = results_json(results)["eyes"]
    stored = {eye: {**eyes["left"], "shift_m": FORMER_M.tolist()} for eye in EYES}
    trials = {
        number: make_trial(RIG.eyes[eye], eye, 0.4, FORMER_M, 2 * FORMER_M)
        for number, eye in enumerate(EYES, 1)
    }
    record = Session.open(session.path)
    return replace(record, results={"eyes": stored}, is_solved=True, trials=trials)


def test_trials_of_an_eye_that_is_not_solved_now_judge_nothing(
    results: Results, record: SessionRecord
) -> None:
    assert set(eye_trials(results, record, 8.0)) == {"left"}


def test_stored_results_of_other_alignments_do_not_count(
    results: Results, record: SessionRecord
) -> None:
    assert eye_trials(results, replace(record, is_solved=False), 8.0) == {}


SHIFT_M: dict[Eye, Float64] = {"left": np.array([1e-3, 2e-3, 3e-3])}


def made(first: Drawing, answer: Answer) -> Comparison:
    return Comparison(first, answer, SHIFT_M)


@pytest.mark.parametrize(
    ("first", "answer", "better"),
    [
        ("offline", "first", "offline"),
        ("offline", "second", "applied"),
        ("applied", "first", "applied"),
        ("applied", "second", "offline"),
        ("applied", "neither", None),
    ],
)
def test_the_better_one_follows_from_order_and_answer(
    first: Drawing, answer: Answer, better: Drawing | None
) -> None:
    assert made(first, answer).better == better


def test_a_session_keeps_comparisons_and_leaves_out_what_is_damaged(tmp_path: Path) -> None:
    with Session.create(tmp_path, example_rig(), {}) as session:
        session.record(COMPARED, **comparison_json(made("offline", "second")))
        session.record(COMPARED, first="offline", answer=["first"], applied_shift_m={})
        session.record(COMPARED, first="offline", answer="first", applied_shift_m={"nose": [0]})
        session.record(COMPARED, first="offline", answer="first")
        session.record(COMPARED, **comparison_json(made("applied", "neither")))
    kept = read_comparisons(Session.open(session.path).events)
    assert [(one.first, one.answer) for one in kept] == [
        ("offline", "second"),
        ("applied", "neither"),
    ]
    np.testing.assert_array_equal(kept[0].applied_shift_m["left"], SHIFT_M["left"])
    assert kept[0].time
    counts = count_comparisons(kept)
    assert (counts.applied, counts.offline, counts.neither, counts.p_value) == (1, 0, 1, 1.0)


def test_the_sign_test_is_that_of_the_binomial_distribution() -> None:
    assert sign_test(0, 0) == sign_test(5, 5) == 1.0
    assert sign_test(10, 0) == sign_test(0, 10) == 2 / 2**10
    assert sign_test(2000, 0) == 0.0
    assert sign_test(8, 2) == 2 * (1 + 10 + comb(10, 2)) / 2**10


@pytest.mark.parametrize(
    ("verdict", "mean_arcmin", "doubted"),
    [("accept", 8.1, True), ("accept", 8.0, False), ("repeat", 20.0, False)],
)
def test_trials_over_the_target_contradict_an_acceptance(
    verdict: str, mean_arcmin: float, doubted: bool
) -> None:
    assert is_doubted(verdict, EyeTrials(3, mean_arcmin, 8.0)) is doubted
    assert not is_doubted(verdict, None)
