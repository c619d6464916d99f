import numpy as np
import pytest

from handcal.sim.hand import HandModel, HandSettings, make_hand

SEEDS = range(6)


def _edges(hand: HandModel) -> np.ndarray:
    corners = hand.triangles
    return np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])


@pytest.mark.parametrize("seed", SEEDS)
def test_mesh_is_one_closed_outward_surface(seed: int) -> None:
    hand = make_hand(seed)
    edges = _edges(hand).astype(np.int64)
    there, back = edges @ [len(hand.vertices_m), 1], edges @ [1, len(hand.vertices_m)]
    assert len(np.unique(there)) == len(edges)
    np.testing.assert_array_equal(np.sort(there), np.sort(back))
    v = hand.vertices_m[hand.triangles].astype(np.float64)
    volume_m3 = np.einsum("ij,ij->", v[:, 0], np.cross(v[:, 1], v[:, 2])) / 6
    assert 0.7e-3 < volume_m3 < 2.5e-3
    facing = np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0])
    agree = np.einsum("ij,ij->i", facing, hand.normals[hand.triangles[:, 0]]) > 0
    assert agree.mean() > 0.99


@pytest.mark.parametrize("seed", SEEDS)
def test_sizes_are_human(seed: int) -> None:
    hand = make_hand(seed)
    length_m = hand.wrist_m[1] - hand.vertices_m[:, 1].min()
    assert 0.155 < length_m < 0.225
    palm = hand.vertices_m[np.abs(hand.vertices_m[:, 1] + 0.02) < 0.004]
    ulnar_m = palm[:, 0].max() if hand.side == "left" else -palm[:, 0].min()
    assert 0.035 < ulnar_m < 0.055
    along_arm_m = (hand.vertices_m - hand.wrist_m) @ hand.arm_axis
    assert along_arm_m.max() == pytest.approx(0.25 + 0.035, abs=0.006)


def test_seed_decides_and_repeats() -> None:
    one = make_hand(3)
    make_hand.cache_clear()
    again, other = make_hand(3), make_hand(4)
    assert again is not one
    np.testing.assert_array_equal(one.vertices_m, again.vertices_m)
    np.testing.assert_array_equal(one.colors, again.colors)
    assert one.vertices_m.shape != other.vertices_m.shape
    assert {make_hand(seed).side for seed in SEEDS} == {"left", "right"}


def test_left_hand_mirrors_right_hand() -> None:
    right = make_hand(2, HandSettings(side="right"))
    left = make_hand(2, HandSettings(side="left"))
    np.testing.assert_allclose(left.vertices_m * [-1, 1, 1], right.vertices_m)
    # The thumb's tip is the farthest point to its side.
    assert right.vertices_m[:, 0].max() > -right.vertices_m[:, 0].min()
