from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from handcal.core.types import EYES, Alignment, Eye, EyeDistance, EyeShift, Float64, Rig, Verdict
from handcal.register.benefit import expected_error_arcmin
from handcal.register.results import Results, SolveSettings, solve_session
from handcal.session.record import SessionRecord, eye_trials
from handcal.session.trial import EyeTrials, Trial, make_trial
from handcal_gui.widgets.result_rows import (
    NOTHING,
    PHI,
    another_text,
    comparison_rows,
    result_rows,
    single_alignment_rows,
    trial_row,
    verdict_color,
    verdict_rows,
)
from handcal_gui.widgets.sentence import sentence
from handcal_gui.widgets.table import Row
from tests.gui.views import VERIFIED


def cells(rows: Sequence[Row], label: str) -> tuple[str, ...]:
    return next(row.cells for row in rows if row.label == label)


@pytest.fixture(scope="module")
def left_only(rig: Rig, alignments: Sequence[Alignment]) -> Results:
    return solve_session([replace(alignments[0], eyes=("left",))], rig, SolveSettings())


def test_a_shift_is_shown_in_millimetres_with_its_sigma(rig: Rig) -> None:
    shift = EyeShift(
        shift_m=np.array([0.0012345, -0.0032, 0.0]),
        covariance_m2=np.diag([0.0005, 0.001, 0.02]) ** 2,
        rms_m=0.001,
        residuals_m=np.zeros(3),
        inlier_ratio=0.5,
        iterations=3,
        converged=True,
        stop_reason="",
        history_m2=np.zeros(3),
        method="fused",
    )
    texts = [q.text(shift) for q in PHI]
    assert texts == ["+1.23 ± 0.50", "−3.20 ± 1.00", "+0.00 ± 20.00"]


def test_each_eye_has_its_numbers(results: Results, rig: Rig) -> None:
    rows = result_rows(results)
    for column, eye in enumerate(EYES):
        shift = results.eyes[eye]
        error = expected_error_arcmin(rig.eyes[eye], shift)
        another = results.expected_after_another_arcmin[eye]
        assert cells(rows, "Expected error")[column] == f"{error:.1f}′"
        assert cells(rows, "One more alignment")[column] == f"{another:.1f}′"
        assert cells(rows, "Point RMS (mm)")[column] == f"{1e3 * shift.rms_m:.2f}"
        assert cells(rows, "Inliers")[column] == f"{100 * shift.inlier_ratio:.0f} %"
        assert cells(rows, "Iterations")[column] == str(shift.iterations)
        assert f"{eye} eye {error:.1f}′ → {another:.1f}′" in another_text(results)
    assert results.eye_distance_m is not None
    assert cells(rows, "Eye distance, solved") == (f"{1e3 * results.eye_distance_m:.1f} mm",)
    assert cells(rows, "Solved from") == ("2 alignments",)
    assert [row.cells[1] for row in verdict_rows(results)] == [
        sentence(results.verdicts[eye].reason) for eye in EYES
    ]


def test_what_was_known_before_is_shown_if_it_was_used(results: Results, rig: Rig) -> None:
    labels = {row.label for row in result_rows(results)}
    assert not labels & {"Eye distance measured", "Prior"}
    prior = replace(results.fused.prior, sessions=12)
    fused = replace(results.fused, prior=prior)
    known = replace(results, measured_eye_distance=EyeDistance(0.063), fused=fused)
    rows = result_rows(known)
    assert cells(rows, "Eye distance measured") == ("63.0 ± 1.0 mm",)
    assert cells(rows, "Prior") == ("learned from 12 sessions",)


def test_a_result_of_verifications_alone_has_no_numbers_of_a_registration(rig: Rig) -> None:
    verification = replace(VERIFIED, hand_E_m=(0.0, 0.0, 0.5))
    verified = solve_session([], rig, SolveSettings(), verified={"left": verification})
    prior = replace(verified.fused.prior, sessions=1)
    verified = replace(verified, fused=replace(verified.fused, prior=prior))
    rows = result_rows(verified)
    for label in ("Point RMS (mm)", "Inliers", "Iterations"):
        assert cells(rows, label) == (NOTHING, NOTHING)
    assert cells(rows, "Prior") == ("learned from 1 session",)
    assert cells(rows, "Solved from") == ("1 verified eye",)
    compared = {row.label: row.cells for row in comparison_rows(verified, verified)}
    assert compared["Point RMS (mm)"] == (NOTHING, NOTHING, NOTHING)
    assert compared["Expected error"][2] == "+0.0′"


def test_a_result_names_all_that_it_was_solved_from(results: Results, rig: Rig) -> None:
    fused = replace(results.fused, verified={"left": ()})
    rows = result_rows(replace(results, fused=fused))
    assert cells(rows, "Solved from") == ("2 alignments, 1 verified eye",)


def test_an_eye_that_took_no_part_has_no_numbers(left_only: Results, rig: Rig) -> None:
    rows = result_rows(left_only)
    for label in ("φ1 (mm)", "Expected error", "One more alignment", "Iterations"):
        left, right = cells(rows, label)
        assert left != NOTHING
        assert right == NOTHING
    assert cells(rows, "Eye distance, solved") == (NOTHING,)
    assert [row.label for row in single_alignment_rows(left_only)] == ["1 left"]
    assert "right" not in another_text(left_only)


def test_each_alignment_is_shown_alone(results: Results, rig: Rig) -> None:
    rows = single_alignment_rows(results)
    assert [row.label for row in rows] == ["1 left", "1 right", "2 left", "2 right"]
    expected = PHI[2].text(results.alignments[2]["left"])
    assert rows[2].cells[2] == expected


def test_a_difference_is_the_other_less_this_one(results: Results, rig: Rig) -> None:
    shifts = {
        eye: replace(shift, shift_m=shift.shift_m + np.array([0.001, 0.0, -0.002]), iterations=0)
        for eye, shift in results.eyes.items()
    }
    other = replace(results, method="icp", eyes=shifts)
    rows = comparison_rows(results, other)
    assert cells(rows, "φ1 (mm)")[2] == "+1.00"
    assert cells(rows, "φ2 (mm)")[2] == "+0.00"
    assert cells(rows, "φ3 (mm)")[2] == "−2.00"
    assert cells(rows, "Iterations")[2] == f"−{results.eyes['left'].iterations}"
    assert cells(rows, "Eye distance")[2] == "+0.0 mm"
    assert [row.label for row in rows if not any(row.cells)] == ["Left eye", "Right eye"]


def test_only_eyes_that_both_solved_are_compared(
    results: Results, left_only: Results, rig: Rig
) -> None:
    labels = [row.label for row in comparison_rows(results, left_only)]
    assert "Left eye" in labels
    assert not {"Right eye", "Eye distance"} & set(labels)


def test_trials_over_the_target_are_marked(
    results: Results, rig: Rig, record: SessionRecord
) -> None:
    def trial(eye: Eye, phi1_mm: float, calibrated_m: Float64) -> Trial:
        adjusted_m = np.add(calibrated_m, [1e-3 * phi1_mm, 0.0, 0.0])
        return make_trial(rig.eyes[eye], eye, 0.4, calibrated_m, adjusted_m)

    shifts_m = results.rendered_shift_m
    trials = [trial("left", phi1_mm, shifts_m["left"]) for phi1_mm in (1.0, 2.0)]
    former = trial("right", 9.0, shifts_m["right"] + 1e-3)
    mean = float(np.mean([one.error_arcmin.mean() for one in trials]))

    shown = replace(record, trials=dict(enumerate([*trials, former])), results=None)

    def judged(target_arcmin: float) -> dict[Eye, EyeTrials]:
        return eye_trials(results, shown, target_arcmin)

    over = judged(mean - 0.1)
    assert trial_row(over, trials).cells == (f"⚠ {mean:.1f}′ n=2", "–")
    every = [*trials, former]
    assert trial_row(over, every).cells == (f"⚠ {mean:.1f}′ n=2", "1 of earlier φ")
    row = trial_row(judged(mean + 0.1), trials)
    assert row.cells == (f"{mean:.1f}′ n=2", "–")
    accepted = replace(results, verdicts=dict.fromkeys(EYES, Verdict("accept", "as told")))
    left, right = (row.cells for row in verdict_rows(accepted, over))
    assert left[0] == f"⚠ Trials over {mean - 0.1:g}′"
    assert f"{mean:.1f}′" in left[1]
    assert right == ("✓ Good", "As told")
    repeated = replace(results, verdicts=dict.fromkeys(EYES, Verdict("repeat", "as told")))
    assert verdict_rows(repeated, over)[0].cells == ("↻ Not yet", "As told")
    assert [verdict_color(name, over["left"]) for name in ("accept", "keep", "implausible")] == [
        "warning",
        "warning",
        "red",
    ]
    assert verdict_color("accept", None) == "good"
    stored = {"eyes": {"right": {"shift_m": list(former.calibrated_shift_m), "verdict": "accept"}}}
    held = eye_trials(results, replace(shown, results=stored), 8.0)
    assert held["right"].count == 1, "as stored by a version that solves otherwise"
    labels = [one.label for one in result_rows(results, row)]
    assert labels.index("Trials") == labels.index("One more alignment") + 1
