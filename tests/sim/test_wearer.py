from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handcal.core.display import projection_matrix, view_of_eye
from handcal.core.geometry import invert, transform
from handcal.core.types import EYES, Eye, Float64
from handcal.rig.example import example_rig
from handcal.sim.hand import HandModel, make_hand
from handcal.sim.raster import D415, draw_hand
from handcal.sim.wearer import DisplayView, Wearer, WearerAction, draw_eyes
from handcal.sim.wearer_settings import WearerSettings
from tests.sim.rims import rim_outline

RIG = example_rig()
STEADY = WearerSettings(
    lateral_sigma_arcmin=0.0,
    depth_sigma=0.0,
    rotation_sigma_rad=0.0,
    novice=False,
    head_sway_m=0.0,
    head_sway_rad=0.0,
    hand_sway_m=0.0,
    hand_sway_rad=0.0,
    tremor_m=0.0,
)
IDLE = DisplayView(
    t_s=0.0,
    cursor_W_m=None,
    cursor_id=0,
    P={eye: projection_matrix(RIG.eyes[eye]) for eye in EYES},
    T_V_H={eye: RIG.eyes[eye].T_V_H for eye in EYES},
    eyes=EYES,
    guard_red=False,
    prompt="",
)


@pytest.fixture(scope="module")
def hand() -> HandModel:
    return make_hand(1)


class Stage:
    """Runs a wearer's time in steps of 1/30 s and plays the engine's part."""

    def __init__(self, hand: HandModel, settings: WearerSettings, seed: int = 0) -> None:
        self.hand = hand
        self.wearer = Wearer(seed, RIG, hand, settings)
        self.view = IDLE
        self.action: WearerAction

    def run(self, duration_s: float) -> Iterator[WearerAction]:
        for _ in range(round(30 * duration_s)):
            self.view = replace(self.view, t_s=self.view.t_s + 1 / 30)
            self.action = self.wearer.step(self.view)
            yield self.action

    def wait(self, duration_s: float) -> list[float]:
        """Return the times at which the wearer confirmed."""
        return [self.view.t_s for action in self.run(duration_s) if action.confirm]

    def show_cursor(self, cursor_id: int, eyes: tuple[Eye, ...] = EYES) -> Float64:
        """Show the rim of the hand as the camera sees it now; return its pose."""
        T_W_D = self.action.T_W_H @ RIG.T_H_D
        rim_m = rim_outline(self.hand, invert(T_W_D) @ self.action.T_W_hand)[::5]
        self.view = replace(
            self.view, cursor_W_m=transform(T_W_D, rim_m), cursor_id=cursor_id, eyes=eyes
        )
        return self.action.T_W_hand


def _turned_rad(T_0: Float64, T_1: Float64) -> float:
    return float(Rotation.from_matrix(T_0[:3, :3].T @ T_1[:3, :3]).magnitude())


@pytest.mark.parametrize("seed", range(5))
def test_hand_is_raised_into_the_cameras_and_the_displays_view(seed: int) -> None:
    hand = make_hand(seed)
    stage = Stage(hand, WearerSettings(), seed)
    assert stage.wait(3.0) == []
    T_W_H, T_W_hand = stage.action.T_W_H, stage.action.T_W_hand
    T_D_hand = invert(T_W_H @ RIG.T_H_D) @ T_W_hand
    assert 0.40 < T_D_hand[2, 3] < 0.58
    image = draw_hand(hand, T_D_hand, D415)
    assert image.y0 > 0  # fingertips
    for eye in EYES:
        display = RIG.eyes[eye]
        palm = view_of_eye(display, T_W_H) @ T_W_hand[:, 3]
        u, v, _ = display.K @ (palm[:3] / palm[2])
        assert 200 < u < display.width_px - 200
        assert 200 < v < display.height_px - 100


def test_steady_wearer_puts_the_hand_where_the_true_eyes_see_the_cursor(hand: HandModel) -> None:
    stage = Stage(hand, STEADY)
    stage.wait(3.0)
    T_a = stage.show_cursor(1, ("left",))
    shown_s = stage.view.t_s
    (confirmed_s,) = stage.wait(3.0)
    assert confirmed_s - shown_s == pytest.approx(0.4 + 0.8 + 0.6, abs=0.15)
    T_E_W = view_of_eye(RIG.eyes["left"], stage.action.T_W_H)
    depth_m = transform(T_E_W, T_a[None, :3, 3])[0, 2]
    moved_m = T_E_W[:3, :3] @ (stage.action.T_W_hand - T_a)[:3, 3]
    # Overlay fixes size: d - s = φ (φ4 s_z - 1), so that the hand moves by φ (1 - s_z φ4).
    expected_m = stage.wearer.true_shift_m["left"] * (1 - depth_m / 2.0)
    np.testing.assert_allclose(moved_m, expected_m, atol=0.0006)
    assert _turned_rad(T_a, stage.action.T_W_hand) < 0.003


def test_novice_is_refused_once_and_then_turns_back(hand: HandModel) -> None:
    stage = Stage(hand, replace(STEADY, novice=True))
    stage.wait(3.0)
    T_a = stage.show_cursor(1)
    assert len(stage.wait(2.0)) == 1
    assert _turned_rad(T_a, stage.action.T_W_hand) > np.radians(9)
    stage.view = replace(stage.view, guard_red=True)
    stage.wait(1.2)
    stage.view = replace(stage.view, guard_red=False)
    assert len(stage.wait(2.0)) == 1
    assert _turned_rad(T_a, stage.action.T_W_hand) < np.radians(1)


def test_experienced_wearer_never_confirms_a_red_hand(hand: HandModel) -> None:
    stage = Stage(hand, WearerSettings(novice=False))
    stage.wait(3.0)
    stage.show_cursor(1)
    stage.view = replace(stage.view, guard_red=True)
    assert stage.wait(6.0) == []
    stage.view = replace(stage.view, guard_red=False)
    assert len(stage.wait(3.0)) == 1


def test_confirms_again_only_when_no_answer_comes(hand: HandModel) -> None:
    stage = Stage(hand, STEADY)
    stage.wait(3.0)
    stage.show_cursor(1)
    (first_s,) = stage.wait(5.0)
    (second_s,) = stage.wait(5.0)
    assert second_s - first_s == pytest.approx(6.0, abs=0.1)


def test_after_new_projections_the_hand_is_raised_elsewhere(hand: HandModel) -> None:
    stage = Stage(hand, STEADY)
    stage.wait(3.0)
    stage.show_cursor(1)
    stage.wait(3.0)
    before = stage.action.T_W_hand
    P = {eye: projection_matrix(RIG.eyes[eye], stage.wearer.true_shift_m[eye]) for eye in EYES}
    stage.view = replace(stage.view, P=P)
    heights_m = [action.T_W_hand[1, 3] - before[1, 3] for action in stage.run(3.0)]
    assert max(heights_m) > 0.2  # y is down
    assert 0.001 < np.linalg.norm((stage.action.T_W_hand - before)[:3, 3]) < 0.1
    # Seen through the right projections, the hand comes back to where the cursor was made.
    T_a = stage.show_cursor(2)
    assert len(stage.wait(3.0)) == 1
    np.testing.assert_allclose(stage.action.T_W_hand[:3, 3], T_a[:3, 3], atol=0.0004)


def test_drawn_eyes_have_the_asked_spread_and_stay_in_the_eye_box() -> None:
    rng = np.random.default_rng(0)
    drawn = [draw_eyes(rng, WearerSettings()) for _ in range(3000)]
    shifts = np.array([[eyes[eye] for eye in EYES] for eyes in drawn])
    assert np.linalg.norm(shifts, axis=2).max() <= 0.010 + 1e-12
    apart_m = shifts[:, 1, 0] - shifts[:, 0, 0]
    assert apart_m.std() == pytest.approx(np.hypot(0.002, 0.0005 * np.sqrt(2)), rel=0.06)
    np.testing.assert_allclose(shifts.mean((0, 1)), 0.0, atol=0.0002)
