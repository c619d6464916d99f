import numpy as np
import pytest

from handcal.bench.trials import trial_hand
from handcal.bench.wearer import overlay_by_eye
from handcal.display import eye_projection
from handcal.geometry import project, transform
from handcal.register.solve import solve_alignment
from handcal.rig.example import example_rig
from handcal.types import EYES, Eye, Float64

RIG = example_rig()


def _overlay(true_shift_m: dict[Eye, Float64]) -> tuple[Float64, Float64]:
    """Return where the hand and the cursor are on the display, by the left eye, (N, 2) px each."""
    alignment = overlay_by_eye(np.random.default_rng(2), trial_hand(2), RIG, true_shift_m, 20_000)
    display, T_E_W = RIG.eyes["left"], alignment.T_E_W["left"]
    seen = eye_projection(display, true_shift_m["left"])
    return (
        project(seen, transform(T_E_W, alignment.hand_m)),
        project(eye_projection(display), transform(T_E_W, alignment.cursor_m)),
    )


def test_the_hand_covers_the_cursor_on_the_display() -> None:
    hand_px, cursor_px = _overlay({"left": np.array([0.004, -0.003, 0.010])})
    for side in (np.min, np.max, np.mean):
        np.testing.assert_allclose(side(hand_px, axis=0), side(cursor_px, axis=0), atol=6.0)


def test_eyes_at_the_viewpoints_need_no_update() -> None:
    alignment = overlay_by_eye(
        np.random.default_rng(1), trial_hand(1), RIG, dict.fromkeys(EYES, np.zeros(3)), 2000
    )
    assert alignment.eyes == EYES
    for shift in solve_alignment(alignment, RIG).values():
        np.testing.assert_allclose(shift.shift_m, 0.0, atol=5e-4)


@pytest.mark.parametrize("along_m", [-0.010, 0.010])
def test_the_true_shift_is_found_again(along_m: float) -> None:
    true_m = np.array([0.003, -0.002, along_m])
    alignment = overlay_by_eye(
        np.random.default_rng(0), trial_hand(0), RIG, {"right": true_m}, 2000
    )
    solved = solve_alignment(alignment, RIG)
    assert set(solved) == {"right"}
    np.testing.assert_allclose(solved["right"].shift_m, true_m, atol=5e-4)
