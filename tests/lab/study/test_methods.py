from dataclasses import replace

import numpy as np
import pytest

from handcal.core.errors import HandcalError
from handcal.core.geometry import project
from handcal.core.progress import Progress
from handcal.core.types import EYES
from handcal.lab.methods import solve_spaam
from handcal.lab.study import methods
from handcal.lab.study.methods import (
    HANDCAL_EACH,
    PAPER,
    PAPER_MEAN_ARCMIN,
    MethodCalibration,
    MethodSettings,
    compare_methods,
    fit_noise,
    method_rows,
    methods_study,
    rendered,
    study_wearer,
    target_errors,
)
from handcal.lab.study.methods_report import ARCMIN_COLUMNS, methods_report, predicted_cost_arcmin
from handcal.lab.study.run import Case
from handcal.lab.study.store import StudyRow
from handcal.lab.study.wearers import align_cube, align_points

ERRORLESS = MethodSettings(
    wearers=1,
    noise_scale=0.0,
    points=300,
    depth_sigma_m=0.0,
    pointing_sigma_arcmin=0.0,
    fingertip_sigma_m=0.0,
    corner_sigma_m=0.0,
    eye_tracker_sigma_m=(0.0, 0.0, 0.0),
)
CASE: Case = {"eye_distance_sigma_mm": 2.0, "wearer": 3}


@pytest.fixture(scope="module")
def errorless_rows() -> list[StudyRow]:
    return compare_methods(ERRORLESS, CASE)


def mean_arcmin(rows: list[StudyRow], method: str) -> float:
    of = [row for row in rows if row["method"] == method]
    assert len(of) == 3, method
    return float(np.mean([[float(row[name] or 0.0) for name in ARCMIN_COLUMNS] for row in of]))


def test_wearers_who_err_nowhere_are_calibrated_exactly(errorless_rows: list[StudyRow]) -> None:
    """By every method whose equations are exact and which needs no depth camera."""
    for method in (
        *("SPAAM, 6", "SPAAM, 12", "SPAAM, 25", "Stereo-SPAAM, 12", "Stereo-SPAAM, 25"),
        *("fingertip SPAAM, 25", "fingertip, eye only, 8", "INDICA, recycled"),
    ):
        assert mean_arcmin(errorless_rows, method) < 1e-6


def test_depth_clouds_alone_cost_little(errorless_rows: list[StudyRow]) -> None:
    assert mean_arcmin(errorless_rows, f"{HANDCAL_EACH} 5") < 4.5
    assert mean_arcmin(errorless_rows, "no calibration") > 5.0


def test_every_method_has_a_row_at_each_distance(errorless_rows: list[StudyRow]) -> None:
    methods = {row["method"] for row in errorless_rows}
    assert len(errorless_rows) == 3 * len(methods)
    assert PAPER in methods
    for row in errorless_rows:
        assert row["refused"] is False
        assert row.items() >= CASE.items()
        assert all(float(row[f"{axis}_mm"] or 0.0) >= 0.0 for axis in "xyz")


def test_both_populations_have_the_same_wearers() -> None:
    study = methods_study(replace(ERRORLESS, wearers=2))
    assert [case["wearer"] for case in study.cases] == [0, 0, 1, 1]
    (first, _), (second, _) = (study_wearer(ERRORLESS, case) for case in study.cases[2:])
    before_m, after_m = (
        np.mean([wearer.true_shift_m[eye] for eye in EYES], axis=0) for wearer in (first, second)
    )
    np.testing.assert_allclose(before_m, after_m, atol=1e-12)
    assert not np.allclose(first.true_shift_m["left"], second.true_shift_m["left"])


def test_target_errors_of_a_known_shift() -> None:
    """Both eyes taken 1 mm too far right: drawn too far left, by less for the display's depth."""
    wearer, _ = study_wearer(ERRORLESS, CASE)
    wrong = {eye: wearer.true_shift_m[eye] + [0.001, 0.0, 0.0] for eye in EYES}
    errors = target_errors(wearer, rendered(wearer, wrong), 0.5)
    arcmin = 60.0 * np.degrees(0.001 * (1.0 / 0.5 - 1.0 / 2.0))
    assert np.mean([errors[name] for name in ARCMIN_COLUMNS]) == pytest.approx(arcmin, rel=0.05)
    assert errors["x_mm"] == pytest.approx(1.0 - 0.5 / 2.0, rel=0.05)
    assert errors["y_mm"] < 0.05


def test_a_projection_that_puts_the_target_behind_the_eye_counts_as_refused() -> None:
    wearer, _ = study_wearer(ERRORLESS, CASE)
    behind = MethodCalibration(
        "behind", 1, 1.0, {eye: -wearer.true_projection(eye) for eye in EYES}
    )
    rows = method_rows(wearer, behind, CASE)
    assert [row["refused"] for row in rows] == [True] * 3


def test_points_are_on_the_displays_and_err_as_told() -> None:
    wearer, _ = study_wearer(ERRORLESS, CASE)
    rng = np.random.default_rng(1)
    points_m, pixels = align_points(wearer, rng, 400, EYES, 6.0, 0.0)
    for eye in EYES:
        off_px = pixels[eye] - project(wearer.true_projection(eye), points_m)
        sigma_arcmin = 60.0 * np.degrees(off_px.std() / wearer.rig.eyes[eye].K[0, 0])
        assert sigma_arcmin == pytest.approx(6.0, rel=0.1)
    assert np.linalg.norm(solve_spaam(points_m, pixels["left"])) == pytest.approx(1.0)


def test_a_cube_covers_its_counterpart() -> None:
    wearer, placement = study_wearer(ERRORLESS, CASE)
    tracked_m, shown_m = align_cube(wearer, np.random.default_rng(1), placement, 0.0)
    offline = rendered(wearer, dict.fromkeys(EYES, np.zeros(3)))
    for eye in EYES:
        seen_px = project(wearer.true_projection(eye), tracked_m)
        drawn_px = project(offline[eye], shown_m)
        # A cube cannot cover both eyes' images: the eye distance is not the rig's.
        assert np.linalg.norm(seen_px - drawn_px, axis=1).mean() < 25.0
    np.testing.assert_allclose(
        np.linalg.norm(tracked_m[0] - tracked_m[1:], axis=1),
        np.linalg.norm(shown_m[0] - shown_m[1:], axis=1),
    )


def test_the_noise_is_searched_for(monkeypatch: pytest.MonkeyPatch) -> None:
    def grows(settings: MethodSettings, wearer: int) -> dict[str, np.ndarray]:
        published = np.array([5.0 + 4.0 * settings.noise_scale + wearer])
        return {"paper": published, "paper, best iterate": published - 4.0}

    monkeypatch.setattr(methods, "_errors_arcmin", grows)
    told: list[str] = []
    found = fit_noise(MethodSettings(), 3, Progress(lambda what, _share: told.append(what)))
    assert found.scale == pytest.approx((PAPER_MEAN_ARCMIN - 6.0) / 4.0, abs=0.02)
    assert found.mean_arcmin == pytest.approx(PAPER_MEAN_ARCMIN, abs=0.1)
    assert found.sd_arcmin == pytest.approx(1.0)
    shown = [
        f"Noise {scale:.2f} by paper: {mean:.1f}′" for scale, mean in found.mean_by_scale.items()
    ]
    assert sorted(told) == sorted(shown)
    best = fit_noise(MethodSettings(), 3, method="paper, best iterate")
    assert best.scale == pytest.approx(found.scale + 1.0, abs=0.04)


def test_noise_that_cannot_explain_the_paper_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(methods, "_errors_arcmin", lambda *_: {"paper": np.array([20.0])})
    with pytest.raises(HandcalError, match=r"no noise gives the paper's 10.79′ \(20.0′ at 0"):
        fit_noise(MethodSettings(), 2)


def test_the_report_tells_every_method(errorless_rows: list[StudyRow]) -> None:
    settings = MethodSettings(wearers=2)
    rows = [
        row | {"eye_distance_sigma_mm": 1e3 * sigma_m, "wearer": wearer}
        for sigma_m in settings.eye_distance_sigmas_m
        for wearer in range(2)
        for row in errorless_rows
    ]
    told = {"eye_distance_sigma_mm", "wearer", "method", "alignments", "wearer_s", "depth_m"}
    rows = [
        {name: row[name] for name in told} | {"refused": True}
        if row["method"] in ("SPAAM, 6", PAPER) and row["wearer"] == 0
        else row
        for row in rows
    ]
    report = methods_report(settings, rows)
    assert "the paper's method" in report.lead
    assert report.lead.startswith("Too few wearers for figures to report. ")
    assert methods_report(replace(settings, wearers=20), rows).lead.startswith("Mean reprojection")
    assert [figure.name for figure in report.figures] == ["reprojection-0mm", "reprojection-2mm"]
    titles = [section.title for section in report.sections]
    assert "One eye at a time, or both" in titles
    assert "Published" in titles


def test_the_predicted_cost_of_an_unseen_eye_distance() -> None:
    """1 mm in each eye at half a metre, before a display at two: 1.5 mrad."""
    assert predicted_cost_arcmin(0.002, 0.5) == pytest.approx(60.0 * np.degrees(0.0015), rel=1e-3)
