"""Hands placed in the world: late poses, steadiness, the hand at a time, and holds."""

from dataclasses import replace

import numpy as np
import pytest

from handcal.calibration.hands import PlacedHand, RecentHands, merge_hold
from handcal.core.errors import HandError, NoFrameError, PoseError, PosePendingError
from handcal.core.geometry import rigid
from handcal.core.types import Float64, HandCloud

PERIOD_NS = 100_000_000
T_H_D = rigid([0.0, 0.0, 0.0], [0.0, 0.1, 0.0])


def cloud(x_m: float = 0.0) -> HandCloud:
    points_m = np.array([[x_m, 0.0, 0.5]] * 9)
    return HandCloud(
        t_camera_ns=0,
        t_host_ns=0,
        points_m=points_m,
        is_cut=np.zeros(9, bool),
        colors=None,
        contour_m=points_m,
        contour_is_cut=np.zeros(9, bool),
        mask=np.zeros((4, 4), np.uint8),
        box_px=(0, 0, 1, 1),
        median_depth_m=0.5,
    )


class Poses:
    """Poses known up to a time; lost ones never come."""

    def __init__(self) -> None:
        self.until_ns = 10**12
        self.lost: set[int] = set()

    def __call__(self, t_host_ns: int) -> Float64:
        if t_host_ns in self.lost:
            raise PoseError("no pose")
        if t_host_ns > self.until_ns:
            raise PosePendingError("not yet")
        return np.eye(4)


@pytest.fixture
def poses() -> Poses:
    return Poses()


@pytest.fixture
def hands(poses: Poses) -> RecentHands:
    return RecentHands(poses, T_H_D)


def test_a_hand_is_placed_in_the_world(hands: RecentHands) -> None:
    hand, problem = hands.add(cloud(), PERIOD_NS)
    assert hand is not None
    assert problem == ""
    np.testing.assert_allclose(hand.middle_W_m, [0.0, 0.1, 0.5], atol=1e-7)
    assert hands.newest() is hand


def test_a_hand_waits_for_its_pose_and_those_behind_it_wait_too(
    hands: RecentHands, poses: Poses
) -> None:
    hands.add(cloud(), 1 * PERIOD_NS)
    poses.until_ns = 1 * PERIOD_NS
    assert hands.add(cloud(), 2 * PERIOD_NS) == (None, "not yet")
    assert hands.placed_until_ns() == 1 * PERIOD_NS
    poses.until_ns = 3 * PERIOD_NS
    hand, _ = hands.add(None, 3 * PERIOD_NS)
    assert hand is not None
    assert hand.t_host_ns == 2 * PERIOD_NS
    assert hands.placed_until_ns() == 3 * PERIOD_NS


def test_a_hand_whose_pose_is_lost_is_left_out(hands: RecentHands, poses: Poses) -> None:
    poses.lost = {2 * PERIOD_NS}
    first, _ = hands.add(cloud(), 1 * PERIOD_NS)
    assert hands.add(cloud(), 2 * PERIOD_NS) == (None, "no pose")
    assert hands.placed_until_ns() == 2 * PERIOD_NS
    assert hands.newest() is first


@pytest.mark.parametrize(("step_m", "is_steady"), [(0.0005, True), (0.006, False)])
def test_a_hand_is_steady_if_it_hardly_moved_for_a_while(
    hands: RecentHands, step_m: float, is_steady: bool
) -> None:
    for number in range(1, 5):
        hands.add(cloud(number * step_m), number * PERIOD_NS)
        assert hands.steady() is None  # not seen for long enough
    hand, _ = hands.add(cloud(5 * step_m), 5 * PERIOD_NS)
    assert hands.steady() is (hand if is_steady else None)
    for number in range(6, 9):  # out of view
        hands.add(None, number * PERIOD_NS)
    assert (hands.steady() is not None) == is_steady
    hands.add(None, 9 * PERIOD_NS)  # nothing since
    assert hands.steady() is None


def test_the_hand_nearest_in_time_is_returned_while_it_is_kept(hands: RecentHands) -> None:
    placed = [hands.add(cloud(), number * PERIOD_NS)[0] for number in range(1, 4)]
    assert hands.nearest(2 * PERIOD_NS + 40_000_000) is placed[1]
    with pytest.raises(HandError):
        hands.nearest(5 * PERIOD_NS)
    hands.add(None, 16 * PERIOD_NS)  # the first is older than 1.4 s now
    with pytest.raises(HandError):
        hands.nearest(PERIOD_NS - 60_000_000)
    assert hands.nearest(3 * PERIOD_NS) is placed[2]
    hands.clear()
    with pytest.raises(HandError):
        hands.nearest(3 * PERIOD_NS)


def test_a_hold_is_what_came_before_the_hand_and_holds_it_even_out_of_order(
    hands: RecentHands,
) -> None:
    for number, x_m in enumerate([0.0, 0.1, 0.1, 0.1]):
        hands.add(cloud(x_m), (10 + number) * PERIOD_NS)
    hand = hands.nearest(13 * PERIOD_NS)
    assert [one.t_host_ns for one in hands.held_at(hand)] == [n * PERIOD_NS for n in (11, 12, 13)]
    # A later frame whose estimated time is earlier, of a hand elsewhere.
    hands.add(cloud(0.2), 13 * PERIOD_NS - 1)
    assert hands.held_at(hand) == [hand]


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
def sheet() -> list[PlacedHand]:
    """Return a sheet at half a metre in seven frames, 1 mm of noise and 1 % of flying pixels."""
    rays = np.stack(np.meshgrid(*[np.linspace(-0.12, 0.12, SIDE)] * 2), axis=-1).reshape(-1, 2)
    rng = np.random.default_rng(0)
    sheet = []
    for number in range(7):
        depth_m = 0.5 + rng.normal(0.0, 0.001, len(rays))
        depth_m[rng.random(len(rays)) < 0.01] += 0.1
        sheet.append(_held(np.column_stack([rays, np.ones(len(rays))]) * depth_m[:, None], number))
    return sheet


def test_the_median_has_less_noise_and_no_flying_pixels(sheet: list[PlacedHand]) -> None:
    merged = merge_hold(sheet, sheet[-1])
    depth_m = merged.points_W_m[:, 2]
    assert merged.frames == 7
    assert len(depth_m) == SIDE**2
    assert np.abs(depth_m - 0.5).max() < 0.003
    assert depth_m.std() < 0.6e-3
    np.testing.assert_allclose(merged.cloud.points_m, merged.points_W_m, atol=1e-6)
    np.testing.assert_array_equal(merged.cloud.is_cut, merged.points_W_m[:, 1] > 0.05)
    assert merged.t_host_ns == sheet[-1].t_host_ns


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


def test_what_few_frames_have_seen_is_left_out(sheet: list[PlacedHand]) -> None:
    extra_m = np.array([[0.2, 0.0, 0.5], [0.21, 0.0, 0.5]])
    last = _held(np.concatenate([sheet[-1].points_W_m, extra_m]), 9)
    assert len(merge_hold([*sheet[:-1], last], last).points_W_m) == SIDE**2


def test_movement_is_reported(sheet: list[PlacedHand]) -> None:
    moved = replace(sheet[0], middle_W_m=np.add(sheet[0].middle_W_m, [0.003, 0, 0]))
    merged = merge_hold([moved, *sheet[1:]], sheet[-1])
    assert merged.movement_m == pytest.approx(0.003, abs=5e-4)
    assert merge_hold(sheet[-1:], sheet[-1]).points_W_m is sheet[-1].points_W_m


def test_a_moment_without_a_frame_is_no_moment_without_a_hand(hands: RecentHands) -> None:
    for i in range(3):
        hands.add(cloud(), i * 10 * PERIOD_NS)
    assert hands.nearest(10 * PERIOD_NS).t_host_ns == 10 * PERIOD_NS
    with pytest.raises(NoFrameError):
        hands.nearest(15 * PERIOD_NS)
    hands.add(None, 15 * PERIOD_NS, missed_for=HandError("no hand"))
    with pytest.raises(HandError, match="did not see your hand"):
        hands.nearest(15 * PERIOD_NS)
