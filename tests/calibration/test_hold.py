"""The median surface of the frames of a hold."""

from dataclasses import replace

import numpy as np
import pytest

from handcal.calibration.hands import PlacedHand, merge_hold
from handcal.core.types import Float64
from tests.calibration.test_hands import cloud

SIDE = 60


def _held(points_m: Float64, number: int) -> PlacedHand:
    count = len(points_m)
    seen = replace(
        cloud(),
        points_m=points_m.astype(np.float32),
        is_cut=points_m[:, 1] > 0.05,
        colors=np.full((count, 3), number, np.uint8),
    )
    return PlacedHand(seen, number, np.eye(4), points_m, np.median(points_m, axis=0))


@pytest.fixture(scope="module")
def hands() -> list[PlacedHand]:
    """Return a sheet at half a metre in seven frames, 1 mm of noise and 1 % of flying pixels."""
    rays = np.stack(np.meshgrid(*[np.linspace(-0.12, 0.12, SIDE)] * 2), axis=-1).reshape(-1, 2)
    rng = np.random.default_rng(0)
    hands = []
    for number in range(7):
        depth_m = 0.5 + rng.normal(0.0, 0.001, len(rays))
        depth_m[rng.random(len(rays)) < 0.01] += 0.1
        hands.append(_held(np.column_stack([rays, np.ones(len(rays))]) * depth_m[:, None], number))
    return hands


def test_the_median_has_less_noise_and_no_flying_pixels(hands: list[PlacedHand]) -> None:
    merged = merge_hold(hands, hands[-1])
    depth_m = merged.points_W_m[:, 2]
    assert merged.frames == 7
    assert len(depth_m) == SIDE**2
    assert np.abs(depth_m - 0.5).max() < 0.003
    assert depth_m.std() < 0.6e-3
    np.testing.assert_allclose(merged.cloud.points_m, merged.points_W_m, atol=1e-6)
    np.testing.assert_array_equal(merged.cloud.is_cut, merged.points_W_m[:, 1] > 0.05)
    assert merged.t_host_ns == hands[-1].t_host_ns


@pytest.mark.parametrize("moved_m", [[0.0, 0.0, -0.001], [0.0, 0.0, 0.001], [0.0015, 0.0, 0.0]])
def test_a_hand_that_moved_before_does_not_count(moved_m: list[float]) -> None:
    rays = np.stack(np.meshgrid(*[np.linspace(-0.12, 0.12, 160)] * 2), axis=-1).reshape(-1, 2)
    rng = np.random.default_rng(1)

    def held(number: int, offset_m: Float64) -> PlacedHand:
        """See a flat hand, displaced, on the camera's rays."""
        on_hand = np.abs(0.5 * rays - offset_m[:2]).max(axis=1) < 0.05
        depth_m = 0.5 + offset_m[2] + rng.normal(0.0, 0.001, np.count_nonzero(on_hand))
        seen = np.column_stack([rays[on_hand], np.ones(len(depth_m))]) * depth_m[:, None]
        return _held(seen, number)

    there = [held(number, np.zeros(3)) for number in range(3)]
    elsewhere = [held(number, np.array(moved_m)) for number in range(3, 6)]
    merged = merge_hold([*elsewhere, *there], there[-1])
    assert merged.frames == 3
    assert merged.points_W_m[:, 2].mean() == pytest.approx(0.5, abs=1e-4)


def test_what_few_frames_have_seen_is_left_out(hands: list[PlacedHand]) -> None:
    extra_m = np.array([[0.2, 0.0, 0.5], [0.21, 0.0, 0.5]])
    last = _held(np.concatenate([hands[-1].points_W_m, extra_m]), 9)
    assert len(merge_hold([*hands[:-1], last], last).points_W_m) == SIDE**2


def test_movement_is_reported(hands: list[PlacedHand]) -> None:
    moved = replace(hands[0], middle_W_m=np.add(hands[0].middle_W_m, [0.003, 0, 0]))
    merged = merge_hold([moved, *hands[1:]], hands[-1])
    assert merged.movement_m == pytest.approx(0.003, abs=5e-4)
    assert merge_hold(hands[-1:], hands[-1]).points_W_m is hands[-1].points_W_m
