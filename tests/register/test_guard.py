import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handcal import rotation_between
from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import Bool, Float64
from handcal.lab.bench.trials import trial_alignment
from handcal.register.guard import (
    AXES,
    Axis,
    GuardSettings,
    RotationGuard,
    matched_pairs,
    turn_advice,
)
from handcal.sim.alignments import AlignmentSettings, SimulatedAlignment
from handcal.sim.hand import make_hand
from handcal.sim.raster import visible_points

CLEAN = AlignmentSettings(count=3000)
SENSED = AlignmentSettings(
    count=3000,
    resample=True,
    depth_sigma_m=0.0015,
    cursor_forearm_m=0.03,
    hand_forearm_m=0.05,
)


def _miss_deg(found: Float64, true: Float64) -> float:
    turned = Rotation.from_rotvec(found) * Rotation.from_rotvec(true).inv()
    return float(np.degrees(turned.magnitude()))


@pytest.fixture(scope="module")
def sensed() -> SimulatedAlignment:
    return trial_alignment(0, 8.0, SENSED)


@pytest.mark.parametrize("making", [CLEAN, SENSED], ids=["clean", "sensed"])
@pytest.mark.parametrize("angle_deg", [0.0, 5.0, 10.0, 20.0, 30.0])
def test_the_rotation_that_turns_the_cursor_into_the_hand(
    angle_deg: float, making: AlignmentSettings
) -> None:
    for trial in range(3):
        made = trial_alignment(trial, angle_deg, making)
        # The simulation turns the cursor against the hand.
        assert _miss_deg(rotation_between(made.cursor_m, made.hand_m), -made.rotation_rad) < 1.0


def test_sign_and_axis(sensed: SimulatedAlignment) -> None:
    cursor_m = transform(sensed.T_E_W, sensed.hand_m)
    to_the_right = transform(rigid([0.0, 0.2, 0.0], [0.01, 0.0, 0.02]), cursor_m)
    np.testing.assert_allclose(rotation_between(cursor_m, to_the_right), [0, 0.2, 0], atol=1e-3)


def test_the_live_guard_tells_in_time() -> None:
    limit_deg = np.degrees(GuardSettings().limit_rad)
    assert limit_deg == pytest.approx(9.0)
    for angle_deg in (limit_deg - 3.0, limit_deg + 3.0):
        for trial in range(3):
            made = trial_alignment(trial, angle_deg, SENSED)
            guard = RotationGuard(made.cursor_m, made.cursor_cut)
            found = guard.rotation(made.hand_m, made.hand_cut)
            assert _miss_deg(found, -made.rotation_rad) < 2.0
            is_over = np.linalg.norm(found) > GuardSettings().limit_rad
            assert is_over == (angle_deg > limit_deg)


def _extreme_move_m(still_m: Float64, turned_m: Float64, axis: int, sign: int) -> Float64:
    """Return how the outermost points of a hand in a direction have moved."""
    outermost = np.argsort(sign * still_m[:, axis])[-50:]
    return np.asarray((turned_m - still_m)[outermost].mean(axis=0))


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("axis", AXES)
def test_the_advice_turns_a_hand_back(axis: Axis, sign: int) -> None:
    """The hand is raised before the camera: x right, y down, z away from the wearer."""
    index = AXES.index(axis)
    raised_m = transform(rigid([0.1, -0.1, 0.05], [0.0, 0.0, 0.5]), make_hand(1).vertices_m)
    middle_m = raised_m.mean(axis=0)
    turn = np.zeros(3)
    turn[index] = sign * np.radians(12.0)
    turned_m = transform(rigid(turn), raised_m - middle_m) + middle_m
    advice = turn_advice(rotation_between(raised_m[::10], turned_m[::10]))
    assert advice.axis == axis
    assert advice.angle_rad == pytest.approx(-turn[index], abs=np.radians(0.5))

    fingers_m = _extreme_move_m(raised_m, turned_m, 1, -1)
    right_edge_m = _extreme_move_m(raised_m, turned_m, 0, 1)
    went_away = {"x": fingers_m[2] > 0, "y": right_edge_m[2] > 0, "z": fingers_m[0] > 0}[axis]
    assert (
        advice.text
        == {
            "x": ("Tip your fingers away from you", "Tip your fingers toward you"),
            "y": (
                "Turn the right edge of your hand away from you",
                "Turn the right edge of your hand toward you",
            ),
            # Fingers that went to the right went clockwise.
            "z": ("Tilt your hand clockwise", "Tilt your hand anticlockwise"),
        }[axis][bool(went_away)]
    )


def test_following_a_turning_hand_equals_registering_each_frame() -> None:
    made = trial_alignment(1, 0.0, SENSED)
    guard = RotationGuard(made.cursor_m, made.cursor_cut)
    middle_m = made.cursor_m.mean(axis=0)
    for angle_deg in (0.0, 2.0, 4.0, 7.0, 10.0, 9.0):
        turn = rigid([0.0, np.radians(angle_deg), 0.0])
        hand_m = transform(turn, made.hand_m - middle_m) + middle_m
        followed = guard.follow(hand_m, made.hand_cut)
        assert _miss_deg(followed, guard.rotation(hand_m, made.hand_cut)) < 0.6


def test_a_hand_that_leaps_is_found_again() -> None:
    made = trial_alignment(1, 0.0, SENSED)
    guard = RotationGuard(made.cursor_m, made.cursor_cut)
    guard.follow(transform(rigid([0.0, 0.0, 1.0]), made.hand_m), made.hand_cut)
    followed = guard.follow(made.hand_m, made.hand_cut)
    assert _miss_deg(followed, guard.rotation(made.hand_m, made.hand_cut)) < 0.6


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
