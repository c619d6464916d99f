"""A hand's mesh: closed, of human size, its skin by marching cubes."""

from __future__ import annotations

import numpy as np
import pytest

from handcal.sim.hand import HandSettings, isosurface, make_hand

SEEDS = range(6)


def _edges(corners: np.ndarray) -> np.ndarray:
    return np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])


@pytest.mark.parametrize("seed", SEEDS)
def test_mesh_is_one_closed_outward_surface(seed: int) -> None:
    hand = make_hand(seed)
    edges = _edges(hand.triangles).astype(np.int64)
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


@pytest.mark.parametrize("seed", range(3))
def test_any_field_has_a_closed_surface(seed: int) -> None:
    field = np.full((14, 15, 16), 1.0, np.float32)
    rng = np.random.default_rng(seed)
    field[1:-1, 1:-1, 1:-1] = rng.normal(size=(12, 13, 14))  # every one of the 256 cases
    _, triangles, _ = isosurface(field)
    edges = _edges(triangles).tolist()
    # Surfaces may touch along an edge, but every edge is passed as often one way as the other.
    assert sorted(edges) == sorted([b, a] for a, b in edges)


def test_a_ball_is_round_and_its_normals_point_outwards() -> None:
    center, radius = np.array([10.2, 11.1, 9.7]), 7.3
    at = np.stack(np.meshgrid(*map(np.arange, (21, 22, 20)), indexing="ij"), axis=-1) - center
    field = (np.linalg.norm(at, axis=-1) - radius).astype(np.float32)
    vertices, triangles, normals = isosurface(field)
    assert len(vertices) - len(_edges(triangles)) // 2 + len(triangles) == 2  # Euler
    out = vertices - center
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), radius, atol=0.02)
    assert np.einsum("ij,ij->i", out, normals).min() > 0.99 * radius
    a, b, c = (out[triangles[:, corner]] for corner in range(3))
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    assert volume == pytest.approx(4 / 3 * np.pi * radius**3, rel=0.02)
