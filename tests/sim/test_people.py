from typing import get_args

import numpy as np
import pytest

from handcal.lab.study.trials import study_hand
from handcal.sim.people import (
    DRIFT_SIGMA_M,
    VARIANTS,
    Variant,
    begin_sitting,
    draw_error,
    draw_movement_m,
    is_balanced,
)
from handcal.sim.wearer_settings import WearerSettings
from tests.helpers import ROOT

USUAL = WearerSettings()
_ARCMIN = np.radians(1.0 / 60.0)
PEOPLE = ROOT.parent / "shared/data/people"


def _errors(variant: Variant, depth_m: float = 0.56, sittings: int = 1) -> np.ndarray:
    """Return errors of overlays, right and down in arcmin and size in %, (sittings, 400, 3)."""
    rng = np.random.default_rng(3)
    found = []
    for _ in range(sittings):
        sitting = begin_sitting(rng, USUAL, variant)
        errors = [draw_error(rng, sitting, depth_m, 0.16) for _ in range(400)]
        found.append([[*(e.lateral_rad / _ARCMIN), 100.0 * e.depth_ratio] for e in errors])
    return np.array(found)


def test_plain_people_err_as_the_settings_say() -> None:
    sigma = _errors("plain")[0].std(axis=0)
    expected = [USUAL.lateral_sigma_arcmin, USUAL.lateral_sigma_arcmin, 100 * USUAL.depth_sigma]
    np.testing.assert_allclose(sigma, expected, rtol=0.12)


def test_a_drifting_persons_error_is_partly_the_same_for_a_sitting() -> None:
    errors = _errors("drift", sittings=60)
    between, within = errors.mean(axis=1).std(axis=0), errors.std(axis=1).mean(axis=0)
    np.testing.assert_allclose(between / within, 1.0, rtol=0.25)


def test_only_the_named_part_of_the_hand_is_balanced() -> None:
    hand, rng = study_hand(1), np.random.default_rng(1)
    points_m = hand.vertices_m.astype(np.float64)
    along_m = (points_m - hand.wrist_m) @ hand.arm_axis
    fingers, palm, all_of_it = (
        is_balanced(points_m, hand, begin_sitting(rng, USUAL, variant))
        for variant in ("fingers-only", "palm-only", "plain")
    )
    assert along_m[fingers].max() < along_m[palm].min()
    assert (fingers | palm).all()
    assert all_of_it.all()


def test_only_some_hands_move_before_they_are_measured() -> None:
    rng = np.random.default_rng(2)
    moving = {
        variant
        for variant in VARIANTS
        if draw_movement_m(rng, begin_sitting(rng, USUAL, variant)).any()
    }
    assert moving == {"drift", "late-presses"}
    assert set(get_args(Variant)) == set(VARIANTS)


def test_the_drift_is_that_of_a_recorded_hand() -> None:
    file = PEOPLE / "leap_steady_hand/palm_indextip_mm.csv"
    if not file.exists():
        pytest.skip(f"{file} is not there")
    t_s, *palm_mm = np.loadtxt(file, delimiter=",", skiprows=1, usecols=range(4)).T
    still = t_s > t_s[0] + 2.0  # before, the hand arrives
    every = round(1.0 / float(np.median(np.diff(t_s))))
    starts = range(0, still.sum() - every, every // 2)
    windows = [np.array(palm_mm)[:, still][:, start : start + every] for start in starts]
    sigma_mm = np.sqrt(np.mean([window.var(axis=1) for window in windows]))
    assert sigma_mm == pytest.approx(1e3 * DRIFT_SIGMA_M, rel=0.1)
