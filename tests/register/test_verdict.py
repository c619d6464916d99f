from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handcal.register.verdict import (
    VerdictSettings,
    expected_error_arcmin,
    eye_distance_m,
    judge,
)
from handcal.rig.example import HALF_EYE_DISTANCE_M, example_rig
from handcal.types import EyeShift

RIG = example_rig()
SETTINGS = VerdictSettings()
GOOD = EyeShift(
    shift_m=np.array([0.002, -0.001, 0.003]),
    covariance_m2=np.diag([0.0003, 0.0003, 0.001]) ** 2,
    rms_m=0.0012,
    residuals_m=np.zeros(5),
    inlier_ratio=0.95,
    iterations=9,
    converged=True,
    stop_reason="step below 30 µm",
    history_m2=np.ones(9),
    method="fused",
)


def test_a_good_solution_is_accepted_with_its_expected_error() -> None:
    for eye, verdict in judge(RIG, {"left": GOOD, "right": GOOD}, SETTINGS).items():
        assert verdict.name == "accept"
        arcmin = expected_error_arcmin(RIG.eyes[eye], GOOD)
        assert verdict.reason == f"expected error {arcmin:.1f}′ in the display"
        assert 1.0 < arcmin < 15.0


@pytest.mark.parametrize(
    ("changes", "name", "reason"),
    [
        (
            {"shift_m": np.array([0.0, 0.024, 0.007])},
            "implausible",
            "the eye would lie 25 mm from the rig's viewpoint, beyond the 20 mm eye box; "
            "check how the headset sits and the rig",
        ),
        (
            {"converged": False, "stop_reason": "limit of 40 iterations"},
            "repeat",
            "the registration did not converge (limit of 40 iterations)",
        ),
        (
            {"inlier_ratio": 0.42},
            "repeat",
            "only 42 % of the hand found its place on the cursor; "
            "hold the hand in the cursor's shape",
        ),
        (
            {"rms_m": 0.0063},
            "repeat",
            "hand and cursor differ by 6.3 mm; hold the hand in the cursor's shape",
        ),
    ],
)
def test_what_fails_is_named(changes: dict[str, Any], name: str, reason: str) -> None:
    verdict = judge(RIG, {"left": replace(GOOD, **changes)}, SETTINGS)["left"]
    assert (verdict.name, verdict.reason) == (name, reason)


@pytest.mark.parametrize(("apart_mm", "said"), [(49.0, "49"), (81.0, "81")])
def test_eyes_too_near_or_too_far_apart(apart_mm: float, said: str) -> None:
    half_m = 0.5e-3 * apart_mm - HALF_EYE_DISTANCE_M
    shifts = {
        "left": replace(GOOD, shift_m=np.array([-half_m, 0.0, 0.0])),
        "right": replace(GOOD, shift_m=np.array([half_m, 0.0, 0.0])),
    }
    for verdict in judge(RIG, shifts, SETTINGS).values():  # type: ignore[arg-type]
        assert verdict.name == "implausible"
        assert verdict.reason == (
            f"the eyes would lie {said} mm apart; check the rig, or align one eye at a time"
        )


def test_an_uncertain_eye_asks_for_another_alignment_and_leaves_the_other_alone() -> None:
    uncertain = replace(GOOD, covariance_m2=np.diag([0.004, 0.004, 0.006]) ** 2)
    verdicts = judge(RIG, {"left": uncertain, "right": GOOD}, SETTINGS)
    arcmin = expected_error_arcmin(RIG.eyes["left"], uncertain)
    assert verdicts["left"].name == "repeat"
    assert verdicts["left"].reason == (
        f"still uncertain by {arcmin:.0f}′ in the display; align once more"
    )
    assert verdicts["right"].name == "accept"


def test_limits_are_the_settings() -> None:
    strict = VerdictSettings(error_max_arcmin=0.1)
    assert judge(RIG, {"left": GOOD}, strict)["left"].name == "repeat"
    narrow = VerdictSettings(eye_box_m=0.001)
    assert judge(RIG, {"left": GOOD}, narrow)["left"].name == "implausible"


def test_eye_distance() -> None:
    apart_m = eye_distance_m(RIG, {"left": GOOD, "right": GOOD})
    assert apart_m == pytest.approx(2 * HALF_EYE_DISTANCE_M, abs=1e-4)
    moved = replace(GOOD, shift_m=GOOD.shift_m + np.array([0.002, 0.0, 0.0]))
    apart_m = eye_distance_m(RIG, {"left": GOOD, "right": moved})
    assert apart_m == pytest.approx(2 * HALF_EYE_DISTANCE_M + 0.002, abs=1e-4)
    assert eye_distance_m(RIG, {"left": GOOD}) is None


def test_expected_error_of_one_axis_by_hand() -> None:
    # An eye 1 mm aside puts a point at 0.5 m, seen against 2 m, off by 3 mm at 2 m.
    aside = replace(GOOD, covariance_m2=np.diag([0.001, 0.0, 0.0]) ** 2, shift_m=np.zeros(3))
    arcmin = expected_error_arcmin(RIG.eyes["left"], aside)
    assert arcmin == pytest.approx(60 * np.degrees(0.003 / 2.0), rel=0.01)


def test_expected_error_is_the_spread_of_drawn_pixels() -> None:
    rng = np.random.default_rng(0)
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    shift = replace(GOOD, covariance_m2=axes @ np.diag([0.0003, 0.001, 0.002]) ** 2 @ axes.T)
    display = RIG.eyes["right"]
    corners_m = np.array([[x, y, 0.5, 1.0] for x in (-0.04, 0.04) for y in (-0.04, 0.04)])
    drawn = rng.multivariate_normal(shift.shift_m, shift.covariance_m2, 4000)

    def pixels(phi: np.ndarray) -> np.ndarray:
        # UQ by its definition, with φ4 = 1/2.
        a, b, c = phi
        UQ = np.array([[1 - c / 2, 0, a / 2, -a], [0, 1 - c / 2, b / 2, -b], [0, 0, 1, -c]])
        image = corners_m @ (display.K @ display.H0 @ UQ).T
        return np.asarray(image[:, :2] / image[:, 2:])

    middle_px = pixels(shift.shift_m)
    squares = [np.sum((pixels(phi) - middle_px) ** 2, axis=1).mean() for phi in drawn]
    expected = 60 * np.degrees(np.sqrt(np.mean(squares)) / display.K[0, 0])
    assert expected_error_arcmin(display, shift) == pytest.approx(expected, rel=0.04)
