from dataclasses import replace

import numpy as np
import pytest

from handcal.core.types import Float32
from handcal.sim.sensor import (
    D415_FATTEN_PX,
    SensorSettings,
    border_px,
    fatten_for,
    sense_depth,
)
from tests.fat_hands import beside_truth, fat_hand

FOCAL_PX, BASELINE_M, SIGMA_PX = 1005.0, 0.055, 0.08
SETTINGS = SensorSettings()
SHAPE = 300, 600


@pytest.fixture
def _clean(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out what a sensor does to the edges beside growing them."""
    for name in ("_EDGE_HOLES", "_EDGE_FLYING", "_DISPARITY_SIGMA_PX"):
        monkeypatch.setattr(f"handcal.sim.sensor.{name}", 0.0)


def _wall(depth_m: float) -> Float32:
    return np.full(SHAPE, depth_m, dtype=np.float32)


def _post() -> Float32:
    """A post 100 px wide at 0.5 m before a wall at 1.5 m."""
    depth_m = _wall(1.5)
    depth_m[:, 300:400] = 0.5
    return depth_m


def _sense_m(depth_m: Float32, settings: SensorSettings = SETTINGS, seed: int = 0) -> Float32:
    measured = sense_depth(depth_m, FOCAL_PX, np.random.default_rng(seed), settings)
    return np.asarray(measured * settings.depth_scale_m, dtype=np.float32)


@pytest.mark.parametrize("depth_m", [0.4, 0.5, 0.7, 1.5])
def test_noise_grows_with_the_square_of_depth(depth_m: float) -> None:
    measured_m = _sense_m(_wall(depth_m))
    sigma_m = depth_m**2 * SIGMA_PX / (FOCAL_PX * BASELINE_M)
    assert measured_m.std() == pytest.approx(sigma_m, rel=0.1)
    assert measured_m.mean() == pytest.approx(depth_m, abs=0.1 * sigma_m)


def test_noise_is_shared_by_neighbours_only() -> None:
    error_m = _sense_m(_wall(0.5)) - 0.5
    near = np.corrcoef(error_m[:, :-1].ravel(), error_m[:, 1:].ravel())[0, 1]
    far = np.corrcoef(error_m[:, :-20].ravel(), error_m[:, 20:].ravel())[0, 1]
    assert near > 0.7
    assert abs(far) < 0.05


def test_depth_comes_in_steps_of_disparity() -> None:
    measured_m = _sense_m(_wall(1.5))
    steps = FOCAL_PX * BASELINE_M / measured_m * 32
    # The unit of 0.1 mm is about 0.08 of a step here.
    np.testing.assert_allclose(steps, np.rint(steps), atol=0.05)


@pytest.mark.usefixtures("_clean")
def test_shadow_left_of_a_near_thing_has_the_width_of_the_disparity_jump() -> None:
    holes = (_sense_m(_post()) == 0).mean(axis=0)
    jump_px = FOCAL_PX * BASELINE_M * (1 / 0.5 - 1 / 1.5)
    shadow = np.flatnonzero(holes)
    assert shadow.max() == 299
    assert len(shadow) == pytest.approx(jump_px, abs=1.5)
    np.testing.assert_array_equal(holes[shadow], 1.0)


def test_edges_have_holes_and_flying_pixels() -> None:
    measured_m = _sense_m(_post())
    band = measured_m[:, 399:401]  # right edge: no shadow
    flying = (band > 0.52) & (band < 1.4)
    assert (band == 0).mean() == pytest.approx(0.35, abs=0.07)
    assert 0.075 < flying.mean() <= 0.18
    assert (measured_m[:, 310:390] > 0).all()


@pytest.mark.usefixtures("_clean")
def test_near_things_grow_over_what_is_behind() -> None:
    widths = [
        int((_sense_m(_post(), replace(SETTINGS, fatten_px=px))[150] < 0.6).sum()) for px in (0, 2)
    ]
    holes = int((_sense_m(_post())[150] == 0).sum())
    assert widths[1] - widths[0] == pytest.approx(4, abs=1)
    assert holes > 0


@pytest.mark.usefixtures("_clean")
@pytest.mark.parametrize("fatten_px", [0.3, 1.5, 2.35])
def test_a_fraction_is_the_share_of_the_edge_that_grows_by_one_more(fatten_px: float) -> None:
    widths = [
        (_sense_m(_post(), replace(SETTINGS, fatten_px=px)) < 0.6)[:, 300:420].sum(axis=1)
        for px in (0.0, fatten_px)
    ]
    grown = widths[1] - widths[0]  # at the right edge; the left one casts a shadow
    whole = int(fatten_px)
    assert set(grown.tolist()) == {whole, whole + 1}
    assert grown.mean() == pytest.approx(fatten_px, abs=0.15)
    # In patches along the edge, as matching windows have them, and not row by row.
    assert np.count_nonzero(np.diff(grown)) < 0.2 * len(grown)


@pytest.mark.parametrize(("seed", "fatten_px"), [(1, 1), (2, 2), (3, 4)])
def test_the_border_of_a_hand_s_mask_lies_outside_as_the_line_says(
    seed: int, fatten_px: int
) -> None:
    cloud, _, hand, T_H_hand = fat_hand(seed, fatten_px)
    outside_px = beside_truth(cloud, hand, T_H_hand).outside_px
    assert outside_px == pytest.approx(border_px(fatten_px), abs=0.2)


def test_the_growth_for_a_border_is_the_line_s_reverse() -> None:
    for px in (-1.0, 0.0, 1.8, 3.5):
        assert border_px(fatten_for(px)) == pytest.approx(px)
    assert border_px(D415_FATTEN_PX) == pytest.approx(1.8, abs=0.01)


def test_the_nearest_distance_and_what_a_disparity_shift_does_to_it() -> None:
    """A D415 at 1280x720 sees from 0.44 m on, or from 0.31 to 1.1 m with a shift of 50."""
    ranged = replace(SETTINGS, disparities=126)
    shifted = replace(ranged, disparity_shift=50)
    for depth_m, plain, moved in [(0.33, 0, 1), (0.43, 0, 1), (0.45, 1, 1), (1.3, 1, 0)]:
        assert (_sense_m(_wall(depth_m), ranged) > 0).mean() == plain
        assert (_sense_m(_wall(depth_m), shifted) > 0).mean() == moved
