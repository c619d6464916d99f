"""The change of a hand's shape, on hands bent by a known amount and on real ones."""

import json
import re
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import Bool, Float64, Frame, Intrinsics
from handcal.hand.segment import segment_hand
from handcal.hand.settings import SegmentSettings
from handcal.register.guard import GuardSettings, RotationGuard
from handcal.register.rcicp import best_rigid
from handcal.register.shape import ShapeChange, change_text
from handcal.sim.hand import HandSettings, make_hand
from handcal.sim.raster import visible_points
from tests.register.real_clouds import halves, read_clouds

T_D_HAND = rigid([0.1, 0.1, 0.05], [0.0, 0.02, 0.5])
LIMIT_M = GuardSettings().shape_limit_m


@cache
def seen(seed: int, forearm_m: float, **changes: float) -> tuple[Float64, Bool]:
    """Return a hand as a sensor sees it, its shape changed."""
    hand = make_hand(seed, HandSettings(**changes))  # type: ignore[arg-type]
    rng = np.random.default_rng([seed, len(changes)])
    return visible_points(hand, T_D_HAND, 5000, rng, forearm_m=forearm_m, depth_sigma_m=0.001)


def measured(seed: int, **changes: float) -> ShapeChange:
    guard = RotationGuard(*seen(seed, 0.03))
    return guard.shape_change(*seen(seed, 0.05, **changes))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_hand_that_keeps_its_shape_has_not_changed(seed: int) -> None:
    """Sampled, cut and measured apart; a movement is no change of shape."""
    assert measured(seed).rms_m < 0.0005
    hand_m, is_cut = seen(seed, 0.05)
    moved_m = transform(rigid([0.05, -0.08, 0.06], [0.03, -0.02, 0.04]), hand_m)
    assert RotationGuard(*seen(seed, 0.03)).shape_change(moved_m, is_cut).rms_m < 0.0008


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"thumb_out_rad": 0.2}, "thumb .* further out"),
        ({"thumb_out_rad": -0.2}, "thumb .* further in"),
        ({"spread_more": 0.8}, "fingers on the .* further out"),
        ({"curl_more_rad": 0.15}, ".*fingers.* nearer to you"),
    ],
)
def test_a_changed_shape_is_reported(seed: int, changes: dict[str, float], words: str) -> None:
    change = measured(seed, **changes)
    assert change.rms_m > 0.6 * LIMIT_M
    assert re.fullmatch(f"{words} than in the cursor", change_text(change, np.eye(3)))


def test_a_larger_change_measures_more() -> None:
    sizes_m = [measured(1, thumb_out_rad=out).rms_m for out in (0.0, 0.1, 0.2, 0.3)]
    assert sizes_m == sorted(sizes_m)
    assert sizes_m[-1] > LIMIT_M


@settings(max_examples=10, deadline=None)
@given(st.tuples(*[st.floats(-1.0, 1.0)] * 6))
def test_the_axes_of_the_frame_do_not_matter(pose: tuple[float, ...]) -> None:
    T = rigid(pose[:3], pose[3:])
    cursor_m, cursor_cut = seen(1, 0.03)
    hand_m, hand_cut = seen(1, 0.05, thumb_out_rad=0.2)
    once = measured(1, thumb_out_rad=0.2)
    guard = RotationGuard(transform(T, cursor_m), cursor_cut)
    again = guard.shape_change(transform(T, hand_m), hand_cut)
    assert again.rms_m == pytest.approx(once.rms_m, rel=1e-3)
    assert change_text(again, T[:3, :3].T) == change_text(once, np.eye(3))


def real_hands(folder: Path) -> list[tuple[Float64, Bool, Float64]]:
    """Return points, cut edges and joints of the frames of one hand."""
    hands = []
    for name, about in json.loads((folder / "meta.json").read_text()).items():
        depth = cv2.imread(str(folder / f"{name}_depth.png"), cv2.IMREAD_UNCHANGED)
        assert depth is not None
        camera = Intrinsics(about["width"], about["height"], *about["intrinsics"])
        frame = Frame(0, 0, 0, depth.astype(np.uint16), about["depth_unit_m"], camera)
        cloud = segment_hand(frame, SegmentSettings())
        joints_m = np.array(about["joints3d_mm"]) / 1e3
        hands.append((cloud.points_m.astype(np.float64), cloud.is_cut, joints_m))
    return hands


def test_real_hands_change_as_their_joints_do(shared_data: Path) -> None:
    """Every second frame of a hand that moves its fingers; the joints are others' measurement."""
    hands = real_hands(shared_data / "rgbd" / "color_aligned_640")[::2]
    by_joints, by_surface = [], []
    for i, (cursor_m, cursor_cut, before_m) in enumerate(hands):
        guard = RotationGuard(cursor_m, cursor_cut)
        for hand_m, hand_cut, after_m in hands[i + 1 :]:
            T = best_rigid(before_m, after_m)
            left_m = after_m - transform(T, before_m)
            by_joints.append(np.sqrt(np.mean(np.sum(left_m**2, axis=1))))
            change = guard.shape_change(transform(invert(T), hand_m), hand_cut)
            by_surface.append(change.rms_m)
    assert np.corrcoef(by_joints, by_surface)[0, 1] > 0.8


@pytest.mark.parametrize("seed", [1, 2])
def test_outliers_are_no_change_of_shape(seed: int) -> None:
    rng = np.random.default_rng(seed)
    hand_m, is_cut = seen(seed, 0.05)
    stray_m = rng.uniform(hand_m.min(axis=0), hand_m.max(axis=0), (len(hand_m) // 20, 3))
    spoiled = np.vstack([hand_m, stray_m]), np.append(is_cut, np.zeros(len(stray_m), np.bool_))
    assert RotationGuard(*seen(seed, 0.03)).shape_change(*spoiled).rms_m < 0.0008


@pytest.mark.parametrize("away_m", [0.03, 0.05])
def test_a_clump_that_only_the_cursor_has_is_no_change_of_shape(away_m: float) -> None:
    """Its node moved by centimetres to the nearest part of the hand, and counted as a finger."""
    rng = np.random.default_rng(0)
    cursor_m, is_cut = seen(1, 0.03)
    beside_m = cursor_m[np.argmax(cursor_m[:, 0])] + [away_m, 0.0, away_m]
    clump_m = beside_m + rng.normal(0.0, 0.004, (120, 3))
    guard = RotationGuard(
        np.vstack([cursor_m, clump_m]), np.append(is_cut, np.zeros(len(clump_m), np.bool_))
    )
    assert guard.shape_change(*seen(1, 0.05)).rms_m < 0.0008


def test_halves_of_real_frames_have_not_changed(shared_data: Path) -> None:
    """Of the frame with the longest tail, and of others."""
    for name, every in (("sr300_320", 7), ("color_aligned_640_b", 3)):
        for number, (_, cloud) in enumerate(read_clouds(shared_data / "rgbd" / name, every)):
            for draw in range(8):
                rng = np.random.default_rng([number, draw])
                (cursor_m, cursor_cut), hand = halves(rng, cloud)
                change = RotationGuard(cursor_m, cursor_cut).shape_change(*hand)
                assert change.rms_m < 0.0015
