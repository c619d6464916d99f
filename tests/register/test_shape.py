"""The change of a hand's shape, on hands bent by a known amount and on real ones."""

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import Bool, EyeShift, Float64, Frame, Intrinsics
from handcal.hand.segment import segment_hand
from handcal.hand.settings import SegmentSettings
from handcal.lab.bench.trials import measured_alignment
from handcal.lab.study.trials import solve_trial
from handcal.register.consistent import match_hands
from handcal.register.guard import GuardSettings, RotationGuard
from handcal.register.rcicp import best_rigid
from handcal.register.shape import Opening, ShapeChange, change_text
from handcal.sim.alignments import SimulatedAlignment
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


POINTS = 3000


def _opened(trial: int, by: float) -> SimulatedAlignment:
    """Return an alignment whose hand is larger by a share, and as much farther from the eye."""
    rng = np.random.default_rng([trial, 6])
    made = measured_alignment(rng, trial % 3, rng.uniform(0.0, 2.0), 0.001, POINTS)
    seen_m = transform(made.T_E_W, made.hand_m) - made.shift_m
    hand_m = transform(invert(made.T_E_W), made.shift_m + (1.0 + by) * seen_m)
    return replace(made, hand_m=hand_m)


def _squared(solved: EyeShift, made: SimulatedAlignment) -> float:
    error_m = solved.shift_m - made.shift_m
    return float(error_m @ np.linalg.solve(solved.covariance_m2, error_m))


@pytest.mark.parametrize("by", [-0.02, 0.01, 0.02, 0.03])
def test_a_hand_that_opens_moves_phi_no_more_than_sigma_says(by: float) -> None:
    alignments = [_opened(trial, by) for trial in range(12)]
    solved = [solve_trial(made, "consistent") for made in alignments]
    assert np.mean(list(map(_squared, solved, alignments))) < 6.0
    # Half a metre and a display at 2 m: without the size, φ3 would be wrong by 6.7 mm for 1 %.
    errors_m = [
        abs(one.shift_m[2] - made.shift_m[2]) for one, made in zip(solved, alignments, strict=True)
    ]
    assert np.median(errors_m) < 0.0035


def test_a_hand_that_does_not_open_keeps_its_phi(monkeypatch: pytest.MonkeyPatch) -> None:
    alignments = [_opened(trial, 0.0) for trial in range(12)]
    solved = [solve_trial(made, "consistent") for made in alignments]
    monkeypatch.setattr(Opening, "known", lambda *_: (0.0, 0.0))
    rigid = [solve_trial(made, "consistent") for made in alignments]
    moved_m = [np.linalg.norm(a.shift_m - b.shift_m) for a, b in zip(solved, rigid, strict=True)]
    assert np.median(moved_m) < 0.0003
    assert np.mean(list(map(_squared, solved, alignments))) < 4.5


def _of(made: SimulatedAlignment) -> tuple[Float64, Float64, Bool, Bool]:
    return made.cursor_m, made.hand_m, made.cursor_cut, made.hand_cut


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 20), st.floats(-0.04, 0.04))
def test_the_size_is_measured(trial: int, by: float) -> None:
    opening = match_hands(*_of(_opened(trial, by))).opening
    assert -opening.log_size == pytest.approx(np.log1p(by), abs=5.0 * opening.sigma)
    assert 0.0005 < opening.sigma < 0.004
    # The similarity has that size.
    size = np.cbrt(np.linalg.det(opening.T_target_source[:3, :3]))
    assert size == pytest.approx(np.exp(opening.log_size))


@given(st.floats(-0.1, 0.1), st.floats(0.0005, 0.01), st.floats(0.0, 0.01))
def test_what_noise_or_a_bent_hand_explains_is_not_believed(
    log_size: float, sigma: float, shape_rms_m: float
) -> None:
    share, left = Opening(log_size, sigma, np.eye(4)).known(shape_rms_m)
    assert 0.0 <= share <= 1.0
    assert left >= 0.0
    bent_share, _ = Opening(log_size, sigma, np.eye(4)).known(shape_rms_m + 0.01)
    assert bent_share <= max(share, 0.3)
    if abs(log_size) < sigma:
        assert share < 0.35


def test_noise_is_no_change_of_size() -> None:
    """The noise of the hand must not multiply itself: it would be half a percent."""
    sizes = []
    for trial in range(10):
        rng = np.random.default_rng([trial, 7])
        made = measured_alignment(rng, trial % 3, 0.0, 0.002, POINTS)
        sizes.append(match_hands(*_of(made)).opening.log_size)
    assert abs(np.mean(sizes)) < 0.0015
