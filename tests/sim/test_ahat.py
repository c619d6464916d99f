"""A time-of-flight camera's depth by the phase of its light, with the lens of a pinhole camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handcal.core.types import Float32, Float64, Intrinsics
from handcal.sim.ahat import UNITS_PER_M, AhatSettings, sense_depth_by_phase

CAMERA = Intrinsics(320, 288, 250.0, 250.0, 159.5, 143.5)
SETTINGS = AhatSettings()
HAND_M = 0.5
IN_HAND = (slice(100, 190), slice(110, 210))


def scene(wall_m: float = 1.6, hand_m: float = HAND_M) -> Float32:
    """A square of skin before a white wall."""
    depth_m = np.full((CAMERA.height, CAMERA.width), wall_m, np.float32)
    depth_m[IN_HAND] = hand_m
    return depth_m


def sense_m(depth_m: Float32, settings: AhatSettings = SETTINGS, seed: int = 0) -> Float64:
    units = sense_depth_by_phase(depth_m, CAMERA, np.random.default_rng(seed), settings)
    assert units.dtype == np.uint16
    assert units.shape == depth_m.shape
    return np.asarray(units / UNITS_PER_M, np.float64)


def test_a_hand_is_measured_with_noise_of_millimetres() -> None:
    measured_m = sense_m(scene())[104:186, 114:206]
    assert (measured_m > 0.0).all()
    assert measured_m.mean() == pytest.approx(HAND_M, abs=2e-4)
    assert 0.5e-3 < measured_m.std() < 3e-3


def test_it_is_depth_and_not_the_distance_along_the_ray() -> None:
    measured_m = sense_m(np.full((CAMERA.height, CAMERA.width), 0.6, np.float32))
    corner_m = measured_m[:30, :30]
    # A wall seen from the side returns less light.
    assert np.median(corner_m[corner_m > 0.0]) == pytest.approx(0.6, abs=2e-3)
    assert np.median(measured_m[130:150, 150:170]) == pytest.approx(0.6, abs=2e-3)


@pytest.mark.parametrize("wall_m", [1.4, 1.6, 1.9])
def test_what_is_beyond_one_turn_of_the_phase_has_no_depth(wall_m: float) -> None:
    """It would show at 0.35 to 0.85 m, where a hand may be."""
    measured_m = sense_m(scene(wall_m))
    beside_m = measured_m[:, :100]
    assert (beside_m == 0.0).mean() > 0.99
    assert (measured_m[110:180, 120:200] > 0.0).all()


def test_pixels_that_see_both_hand_and_wall_have_a_phase_in_between() -> None:
    sharp, blurred = (
        sense_m(scene(0.9), replace(SETTINGS, blur_px=px, noise=1e-3)) for px in (0.05, 1.0)
    )
    rows = slice(120, 170)
    between = [
        np.count_nonzero((one[rows, 105:115] > 0.51) & (one[rows, 105:115] < 0.88))
        for one in (sharp, blurred)
    ]
    assert between[0] == 0
    assert between[1] >= 50  # at least one pixel of each row
