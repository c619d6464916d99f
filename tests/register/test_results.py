"""Results of a session; solving it again gives the same results."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from handcal.calibration.states import CalibrationSettings
from handcal.core.display import reprojection_arcmin
from handcal.core.errors import CancelledError
from handcal.core.progress import Progress
from handcal.core.types import EYES, METHODS, Alignment, EyeDistance, Method
from handcal.io.files import write_json
from handcal.io.settings import read_settings, settings_json
from handcal.lab.study.wearers import align_hand, draw_wearer
from handcal.register.benefit import expected_error_arcmin
from handcal.register.results import SolveSettings, results_json, solve_session
from handcal.register.verdict import VerdictSettings
from handcal.rig.example import example_rig
from handcal.session.session import Session
from handcal.sim.wearer_settings import WearerSettings

RIG = example_rig()


@pytest.fixture(scope="module")
def both(simulated: Callable[..., Alignment]) -> Alignment:
    return simulated(1)


@pytest.fixture(scope="module")
def left(simulated: Callable[..., Alignment]) -> Alignment:
    return simulated(2, ("left",))


def test_what_another_alignment_would_buy_is_what_it_buys(left: Alignment) -> None:
    once, twice = (solve_session([left] * count, RIG, SolveSettings()) for count in (1, 2))
    now, after = (
        expected_error_arcmin(RIG.eyes["left"], results.eyes["left"]) for results in (once, twice)
    )
    assert set(once.expected_after_another_arcmin) == {"left"}
    predicted = once.expected_after_another_arcmin["left"]
    # Two that agree tell besides that the wearer is precise.
    assert 0.85 * predicted < after < 1.01 * predicted
    assert predicted < 0.9 * now


def test_the_settings_reach_the_verdict(left: Alignment) -> None:
    lenient = SolveSettings(verdict=VerdictSettings(target_arcmin=60.0))
    strict = SolveSettings(verdict=VerdictSettings(target_arcmin=0.1))
    assert solve_session([left], RIG, lenient).verdicts["left"].name == "keep"
    assert solve_session([left], RIG, strict).verdicts["left"].name == "repeat"


def test_it_reports_and_can_be_cancelled_between_alignments(left: Alignment) -> None:
    reports: list[tuple[str, float]] = []

    def solve(is_cancelled: Callable[[], bool]) -> None:
        solve_session(
            [left] * 2,
            RIG,
            SolveSettings(),
            Progress(lambda *said: reports.append(said), is_cancelled),
        )

    solve(lambda: False)
    assert reports == [("Solving alignment 1 of 2", 0.0), ("Solving alignment 2 of 2", 0.5)]
    reports.clear()
    with pytest.raises(CancelledError):
        solve(lambda: len(reports) == 1)
    assert len(reports) == 1


@pytest.mark.parametrize("method", ["paper", "linear", "icp"])
def test_a_slow_method_can_be_cancelled_in_the_middle(left: Alignment, method: Method) -> None:
    asked = 0

    def is_cancelled() -> bool:
        nonlocal asked
        asked += 1
        return asked > 3

    with pytest.raises(CancelledError):
        solve_session([left], RIG, SolveSettings(method), Progress(is_cancelled=is_cancelled))
    assert asked == 4  # before the alignment, and before three iterations


def test_a_measured_eye_distance_improves_one_alignment_of_both_eyes() -> None:
    usual = WearerSettings(eye_distance_sigma_m=0.004)
    still_m = {eye: np.zeros(3) for eye in EYES}
    arcmin: list[list[float]] = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        wearer = draw_wearer(rng, seed, usual)
        alignment = align_hand(wearer, rng, EYES, still_m, usual, 1500, 0.001)
        true_m = float(np.linalg.norm(wearer.eye_m("right") - wearer.eye_m("left")))
        measured = EyeDistance(true_m + rng.normal(0.0, 0.001))
        arcmin.append([])
        for known in (None, measured):
            results = solve_session([alignment], RIG, SolveSettings(), eye_distance=known)
            solved_m = {eye: shift.shift_m for eye, shift in results.eyes.items()}
            arcmin[-1].append(reprojection_arcmin(RIG, solved_m, wearer.true_shift_m))
            if known is not None:
                assert results.eye_distance_m == pytest.approx(true_m, abs=0.004)
    without, used = np.mean(arcmin, axis=0)
    assert used < 0.9 * without


def test_nothing_to_solve_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one alignment"):
        solve_session([], RIG, SolveSettings())


@pytest.mark.parametrize("method", METHODS)
def test_a_stored_session_is_solved_alike_to_the_last_bit(
    tmp_path: Path, both: Alignment, left: Alignment, method: Method
) -> None:
    settings = CalibrationSettings(solve=SolveSettings(method))
    alignments = [left] if method == "paper" else [left, both]
    results = results_json(solve_session(alignments, RIG, settings.solve))
    stored = {"calibration": settings_json(settings)}
    with Session.create(tmp_path, RIG, stored, name="one") as session:
        for each in alignments:
            session.save_alignment(each)
        session.save_results(results)
    record = Session.open(session.path)
    solve = read_settings(CalibrationSettings, record.settings["calibration"]).solve
    write_json(
        tmp_path / "again.json", results_json(solve_session(record.alignments, record.rig, solve))
    )
    assert (tmp_path / "again.json").read_bytes() == (session.path / "results.json").read_bytes()
