from dataclasses import replace

import numpy as np
import pytest

from handcal.core.display import eye_projection
from handcal.core.errors import HandcalError
from handcal.core.geometry import project, rigid, transform
from handcal.core.types import EYES, Eye, Float64
from handcal.lab.bench.trials import trial_hand
from handcal.register.solve import solve_alignment
from handcal.rig.example import example_rig
from handcal.sim.overlay import overlay_by_eye
from handcal.sim.placement import PlacementError

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
        np.testing.assert_allclose(side(hand_px, axis=0), side(cursor_px, axis=0), atol=8.0)


def test_a_placement_error_moves_and_turns_the_hand() -> None:
    error = PlacementError(np.array([0.0, 0.0, 0.05]), np.array([0.004, 0.0]), 0.02)
    true_m = dict.fromkeys(EYES, np.zeros(3))
    alignment = overlay_by_eye(
        np.random.default_rng(4), trial_hand(4), RIG, true_m, 2000, placement_error=error
    )
    assert np.linalg.norm(alignment.rotation_rad) == pytest.approx(0.05)
    moved_m = alignment.hand_m.mean(axis=0) - alignment.cursor_m.mean(axis=0)
    away_m = 0.56  # from the eyes
    assert moved_m[2] == pytest.approx(0.02 * away_m, abs=0.003)
    assert np.linalg.norm(moved_m[:2]) == pytest.approx(0.004 * away_m, abs=0.003)


def test_a_rig_that_shows_no_hand_is_named() -> None:
    small = {eye: replace(RIG.eyes[eye], width_px=20, height_px=20) for eye in EYES}
    turned_away = rigid([0.0, np.pi, 0.0]) @ RIG.T_H_D
    for rig in (replace(RIG, eyes=small), replace(RIG, T_H_D=turned_away)):
        with pytest.raises(HandcalError, match="check the rig file"):
            overlay_by_eye(
                np.random.default_rng(1), trial_hand(1), rig, dict.fromkeys(EYES, np.zeros(3)), 500
            )


@pytest.mark.parametrize("along_m", [-0.010, 0.010])
def test_the_true_shift_is_found_again(along_m: float) -> None:
    true_m = np.array([0.003, -0.002, along_m])
    alignment = overlay_by_eye(
        np.random.default_rng(0), trial_hand(0), RIG, {"right": true_m}, 2000
    )
    solved = solve_alignment(alignment, RIG)
    assert set(solved) == {"right"}
    np.testing.assert_allclose(solved["right"].shift_m, true_m, atol=5e-4)
