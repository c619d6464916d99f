"""Hands placed in the world: late poses, steadiness, the hand at a time."""

import numpy as np
import pytest

from handcal.calibration.hands import RecentHands
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
    return RecentHands(poses, T_H_D, steady_s=0.4, steady_m=0.005)


def test_a_hand_is_placed_in_the_world(hands: RecentHands) -> None:
    hand, problem = hands.add(cloud(), PERIOD_NS)
    assert hand is not None
    assert problem == ""
    np.testing.assert_allclose(hand.middle_W_m, [0.0, 0.1, 0.5], atol=1e-7)
    assert hands.newest(0.0) is hand


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
    assert hands.newest(1.0) is first


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
    assert hands.nearest(2 * PERIOD_NS + 40_000_000, 0.15) is placed[1]
    with pytest.raises(HandError):
        hands.nearest(4 * PERIOD_NS, 0.05)
    hands.add(None, 16 * PERIOD_NS)  # the first two are older than 1.4 s now
    with pytest.raises(HandError):
        hands.nearest(PERIOD_NS, 0.05)
    assert hands.nearest(3 * PERIOD_NS, 0.05) is placed[2]
    hands.clear()
    with pytest.raises(HandError):
        hands.nearest(3 * PERIOD_NS, 0.05)


def test_a_hold_is_what_came_before_the_hand_and_holds_it_even_out_of_order(
    hands: RecentHands,
) -> None:
    for number, x_m in enumerate([0.0, 0.1, 0.1, 0.1]):
        hands.add(cloud(x_m), (10 + number) * PERIOD_NS)
    hand = hands.nearest(13 * PERIOD_NS, 0.05)
    assert [one.t_host_ns for one in hands.held_at(hand)] == [n * PERIOD_NS for n in (11, 12, 13)]
    # A later frame whose estimated time is earlier, of a hand elsewhere.
    hands.add(cloud(0.2), 13 * PERIOD_NS - 1)
    assert hands.held_at(hand) == [hand]


def test_a_moment_without_a_frame_is_no_moment_without_a_hand(hands: RecentHands) -> None:
    for i in range(3):
        hands.add(cloud(), i * 10 * PERIOD_NS)
    assert hands.nearest(10 * PERIOD_NS, 0.15).t_host_ns == 10 * PERIOD_NS
    with pytest.raises(NoFrameError):
        hands.nearest(15 * PERIOD_NS, 0.15)
    hands.add(None, 15 * PERIOD_NS, missed_for=HandError("no hand"))
    with pytest.raises(HandError, match="did not see your hand"):
        hands.nearest(15 * PERIOD_NS, 0.15)
