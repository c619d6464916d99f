import numpy as np
import pytest

from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import Bool, Float64
from handcal.register.guard import matched_pairs
from handcal.sim.hand import make_hand
from handcal.sim.raster import visible_points

T_D_CURSOR = rigid(translation_m=[0.0, 0.05, 0.5])
ROTATION_RAD = np.array([0.05, -0.08, 0.1])
T_D_HAND = rigid(ROTATION_RAD, [0.02, 0.04, 0.51])
FOREARM_M = 0.02


@pytest.fixture(scope="module")
def clouds() -> tuple[Float64, Bool, Float64]:
    """Return cursor, its cut and hand, sampled differently."""
    hand, rng = make_hand(1), np.random.default_rng(0)
    cursor_m, is_cut = visible_points(hand, T_D_CURSOR, 4000, rng, forearm_m=FOREARM_M)
    hand_m, _ = visible_points(hand, T_D_HAND, 4000, rng, forearm_m=FOREARM_M)
    return cursor_m, is_cut, hand_m


def test_pairs_join_the_same_places_of_the_hand(clouds: tuple[Float64, Bool, Float64]) -> None:
    cursor_m, is_cut, hand_m = clouds
    pairs = matched_pairs(cursor_m, hand_m, ROTATION_RAD, is_cut)
    assert 200 < len(pairs) < 400
    moved_m = transform(T_D_HAND @ invert(T_D_CURSOR), cursor_m[pairs[:, 0]])
    distance_m = np.linalg.norm(moved_m - hand_m[pairs[:, 1]], axis=1)
    # A thousand points on a hand lie 4 mm apart.
    assert np.median(distance_m) < 0.004
    assert distance_m.max() < 0.012


def test_no_pair_ends_on_a_cut(clouds: tuple[Float64, Bool, Float64]) -> None:
    cursor_m, is_cut, hand_m = clouds
    wide_cut = is_cut | (cursor_m[:, 1] > np.median(cursor_m[:, 1]))
    for cut in (is_cut, wide_cut):
        pairs = matched_pairs(cursor_m, hand_m, ROTATION_RAD, cut)
        assert len(pairs)
        assert not cut[pairs[:, 0]].any()


def test_empty_clouds_have_no_pairs() -> None:
    none_m, some_m = np.empty((0, 3)), np.ones((5, 3))
    for cursor_m, hand_m in ((none_m, some_m), (some_m, none_m)):
        is_cut = np.zeros(len(cursor_m), dtype=np.bool_)
        assert matched_pairs(cursor_m, hand_m, np.zeros(3), is_cut).shape == (0, 2)
