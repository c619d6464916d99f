import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtr

from handcal.core.display import (
    eye_projection,
    reprojection_arcmin,
    target_corners_m,
)
from handcal.core.geometry import project
from handcal.core.types import EYES, Eye, Float64
from handcal.register import benefit as benefits
from handcal.register.benefit import (
    WORKING_DISTANCE_M,
    benefit,
    depth_error_m,
    expected_arcmin,
    foreseen_benefit,
)
from handcal.rig.example import example_rig

RIG = example_rig()
DISPLAY = RIG.eyes["left"]
PRIOR_M2 = 0.004**2 * np.eye(3)


def _covariance(rng: np.random.Generator, size_m: float) -> Float64:
    root = size_m * rng.normal(size=(3, 3))
    return np.asarray(root @ root.T)


def test_the_samples_are_those_of_a_standard_normal() -> None:
    samples = benefits._standard_normal()
    half = samples[: len(samples) // 2]
    assert (samples[len(half) :] == -half).all()
    cells = np.floor(len(half) * ndtr(half)).astype(int)  # each of equal probability
    assert (np.sort(cells, axis=0) == np.arange(len(half))[:, None]).all()
    np.testing.assert_allclose(np.cov(samples.T), np.eye(3), atol=0.02)


def test_without_uncertainty_it_is_the_reprojection_error() -> None:
    shift_m = np.array([0.002, -0.001, 0.003])
    true_m: dict[Eye, Float64] = dict.fromkeys(EYES, shift_m)
    offline: dict[Eye, Float64] = dict.fromkeys(EYES, np.zeros(3))
    exact_arcmin = reprojection_arcmin(RIG, offline, true_m)
    expected = np.mean([expected_arcmin(RIG.eyes[eye], shift_m, np.zeros((3, 3))) for eye in EYES])
    assert expected == pytest.approx(exact_arcmin, rel=0.02)


def test_the_expectations_are_those_of_many_simulated_eyes() -> None:
    rng = np.random.default_rng(1)
    shift_m, covariance_m2 = np.array([0.003, -0.001, 0.002]), _covariance(rng, 0.001)
    found = benefit(DISPLAY, np.zeros(3), PRIOR_M2, shift_m, covariance_m2)
    zero = np.zeros((3, 3))
    eyes_m = rng.multivariate_normal(shift_m, covariance_m2, 1500)
    after = np.array([expected_arcmin(DISPLAY, eye - shift_m, zero) for eye in eyes_m])
    without = np.array([expected_arcmin(DISPLAY, eye, zero) for eye in eyes_m])
    assert found.after_arcmin == pytest.approx(after.mean(), rel=0.05)
    assert found.without_arcmin == pytest.approx(without.mean(), rel=0.05)
    assert found.probability_better == pytest.approx((after < without).mean(), abs=0.03)
    assert found.before_arcmin == pytest.approx(
        expected_arcmin(DISPLAY, np.zeros(3), PRIOR_M2), rel=1e-9
    )


@given(seed=st.integers(0, 10_000), size_mm=st.floats(0.1, 5.0))
def test_more_uncertainty_means_more_error_and_less_certain_benefit(
    seed: int, size_mm: float
) -> None:
    rng = np.random.default_rng(seed)
    shift_m, covariance_m2 = rng.normal(0.0, 0.003, 3), _covariance(rng, 1e-3 * size_mm)
    less, more = (
        benefit(DISPLAY, np.zeros(3), PRIOR_M2, shift_m, factor * covariance_m2)
        for factor in (1.0, 4.0)
    )
    assert more.after_arcmin == pytest.approx(2.0 * less.after_arcmin, rel=0.01)
    assert more.probability_better <= less.probability_better + 0.05
    assert 0.0 <= more.probability_better <= 1.0


def test_what_adds_nothing_promises_nothing() -> None:
    shift_m, now_m2 = np.array([0.003, 0.001, 0.0]), 0.0012**2 * np.eye(3)
    now = benefit(DISPLAY, np.zeros(3), PRIOR_M2, shift_m, now_m2)
    foreseen = foreseen_benefit(DISPLAY, shift_m, now_m2)
    assert foreseen == (now.after_arcmin, now.probability_better)


def test_expected_error_of_one_axis_by_hand() -> None:
    # An eye 1 mm aside puts a point at z, seen against 2 m, off by (2 m - z) / z mm at 2 m.
    at_2_m = np.mean([(2.0 - z) / z for z in (0.4, 0.5, 0.6)])
    by_hand = 60 * np.degrees(1e-3 * at_2_m / 2.0) * np.sqrt(2 / np.pi)
    found = expected_arcmin(DISPLAY, np.zeros(3), np.diag([0.001, 0.0, 0.0]) ** 2)
    assert found == pytest.approx(by_hand, rel=0.02)


def test_the_error_against_distance_of_one_axis_by_hand() -> None:
    sigma_m = np.diag([1e-3, 0.0, 0.0])
    found = benefit(DISPLAY, np.zeros(3), PRIOR_M2, np.array([0.01, 0.0, 0.0]), sigma_m**2)
    for one in found.by_distance:
        arcmin_per_m = 60 * np.degrees(abs(1 / one.distance_m - 1 / DISPLAY.z_C0_S_m))
        # Mean and quantiles of a folded normal distribution; then of one far from 0.
        after = one.after_arcmin, one.after_low_arcmin, one.after_high_arcmin
        folded = [1e-3 * arcmin_per_m * part for part in (np.sqrt(2 / np.pi), 0.0313, 2.2414)]
        assert after == pytest.approx(folded, rel=0.1 if one.distance_m < 2 else 0.03, abs=0.01)
        without = one.without_arcmin, one.without_low_arcmin, one.without_high_arcmin
        aside = [arcmin_per_m * part for part in (10e-3, 8.04e-3, 11.96e-3)]
        assert without == pytest.approx(aside, rel=0.03, abs=1e-6)


def test_the_error_in_depth_is_the_movement_of_an_object_that_covers_its_drawing() -> None:
    ahead_m = np.array([0.0, 0.0, 0.003])
    corners_m = target_corners_m(WORKING_DISTANCE_M)
    drawn_px = project(eye_projection(DISPLAY, ahead_m), corners_m)
    moved_m = float(depth_error_m(DISPLAY, ahead_m))
    offline = eye_projection(DISPLAY, np.zeros(3))

    def apart_px(nearer_m: float) -> float:
        return float(np.abs(project(offline, corners_m - [0.0, 0.0, nearer_m]) - drawn_px).max())

    assert apart_px(moved_m) < 0.02 * apart_px(0.0)


def test_the_errors_in_depth_are_those_of_a_gaussian_by_hand() -> None:
    ratio = 1.0 - WORKING_DISTANCE_M / DISPLAY.z_C0_S_m
    covariance_m2 = np.diag([1e-3, 1e-3, 0.6e-3]) ** 2
    found = benefit(
        DISPLAY, np.zeros(3), PRIOR_M2, np.array([0.0, 0.0, 0.012]), covariance_m2
    ).depth
    folded = np.sqrt(2.0 / np.pi) * ratio
    assert found.before_m == pytest.approx(0.004 * folded, rel=0.01)
    assert found.without_m == pytest.approx(0.012 * ratio, rel=0.01)
    assert found.after_m == pytest.approx(0.6e-3 * folded, rel=0.01)
    assert found.probability_better == 1.0
    unknown = benefit(DISPLAY, np.zeros(3), PRIOR_M2, np.array([0.004, 0.0, 0.0]), PRIOR_M2).depth
    assert unknown.probability_better == 0.0
    assert str(found) == "9.0 → 0.4 mm, 99\u00a0% sure to be better"
