import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handcal import rotation_between
from handcal.bench.trials import trial_alignment
from handcal.errors import HandError
from handcal.geometry import rigid, transform
from handcal.register.guard import GuardSettings, RotationGuard
from handcal.sim.alignments import AlignmentSettings, SimulatedAlignment
from handcal.types import Float64

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


def test_swapping_the_clouds_inverts(sensed: SimulatedAlignment) -> None:
    there = rotation_between(sensed.cursor_m, sensed.hand_m)
    back = rotation_between(sensed.hand_m, sensed.cursor_m)
    assert _miss_deg(there, -back) < 0.3


def test_axes_turn_with_the_frame(sensed: SimulatedAlignment) -> None:
    T = rigid([1.0, -0.5, 2.0], [0.3, 0.2, -1.0])
    found = rotation_between(transform(T, sensed.cursor_m), transform(T, sensed.hand_m))
    once = rotation_between(sensed.cursor_m, sensed.hand_m)
    np.testing.assert_allclose(found, T[:3, :3] @ once, atol=1e-9)


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


def test_bad_clouds_are_refused(sensed: SimulatedAlignment) -> None:
    good = sensed.hand_m
    bad = np.array(good)
    bad[7, 1] = np.nan
    for message, clouds in {
        "cursor_m contains NaN": (bad, good),
        "hand_m contains NaN": (good, bad),
        r"cursor_m must have shape \(N, 3\), got \(3000, 2\)": (good[:, :2], good),
        "hand_m has 99 points": (good, good[:99]),
        "cursor_m has all its points on one line": (np.outer(np.arange(200), [1, 2, 3]), good),
    }.items():
        with pytest.raises(ValueError, match=message):
            rotation_between(*clouds)
    guard = RotationGuard(good)
    with pytest.raises(HandError, match="beside cut edges"):
        guard.rotation(good, np.ones(len(good), dtype=np.bool_))
