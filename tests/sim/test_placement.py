from collections.abc import Sequence

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handcal.core.display import projection_matrix, view_of_eye
from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import EYES, Eye, Float64
from handcal.rig.example import example_rig
from handcal.sim.hand import HandModel, make_hand
from handcal.sim.placement import (
    CursorView,
    PlacementError,
    apply_placement_error,
    match_cursor,
    overlay_hand,
    view_through,
)
from handcal.sim.raster import visible_points

RIG = example_rig()
T_W_H = rigid([0.02, 0.01, 0.03], [0.1, 0.05, -0.1])
T_W_HAND = T_W_H @ rigid([0.05, -0.1, 0.02], [0.0, 0.08, 0.45])


@pytest.fixture(scope="module")
def hand() -> HandModel:
    return make_hand(1)


@pytest.fixture(scope="module")
def surface_m(hand: HandModel) -> Float64:
    T_W_D = T_W_H @ RIG.T_H_D
    points_m, _ = visible_points(
        hand, invert(T_W_D) @ T_W_HAND, 400, np.random.default_rng(0), forearm_m=0.02
    )
    return transform(invert(T_W_HAND) @ T_W_D, points_m)


def _views(surface_m: Float64, shift_m: Sequence[float], eyes: tuple[Eye, ...]) -> list[CursorView]:
    return [
        view_through(
            RIG.eyes[eye],
            np.array(shift_m),
            T_W_H,
            projection_matrix(RIG.eyes[eye]) @ RIG.eyes[eye].T_V_H,
            transform(T_W_HAND, surface_m),
        )
        for eye in eyes
    ]


def test_eyes_at_the_viewpoints_see_the_cursor_where_the_hand_was(surface_m: Float64) -> None:
    start = rigid(translation_m=[0.01, -0.02, 0.03]) @ T_W_HAND
    placed = overlay_hand(surface_m, start, _views(surface_m, (0, 0, 0), EYES))
    assert placed is not None
    np.testing.assert_allclose(placed[0], T_W_HAND, atol=1e-8)
    assert placed[1] < 1e-4


@pytest.mark.parametrize("phi_3_m", [-0.01, 0.01])
def test_one_eye_moved_forward_moves_the_hand_by_the_exact_factor(
    surface_m: Float64, phi_3_m: float
) -> None:
    placed = overlay_hand(surface_m, T_W_HAND, _views(surface_m, (0, 0, phi_3_m), ("left",)))
    assert placed is not None
    T_E_W = view_of_eye(RIG.eyes["left"], T_W_H)
    depth_m = transform(T_E_W, T_W_HAND[None, :3, 3])[0, 2]
    moved_m = (T_E_W[:3, :3] @ (placed[0] - T_W_HAND)[:3, 3])[2]
    assert moved_m == pytest.approx(phi_3_m * (1 - depth_m / 2.0), rel=0.05)


def test_noisy_cursor_with_flying_pixels_finds_the_hand(
    hand: HandModel, surface_m: Float64
) -> None:
    rng = np.random.default_rng(1)
    cursor_m = transform(T_W_HAND, surface_m) + rng.normal(0.0, 0.0005, surface_m.shape)
    cursor_m[::25, 2] += 0.05
    guess = T_W_HAND @ rigid([0.01, 0.01, -0.01], [0.002, 0.001, -0.002])
    error = invert(T_W_HAND) @ match_cursor(hand, cursor_m, guess)
    assert np.linalg.norm(error[:3, 3]) < 0.0004
    assert Rotation.from_matrix(error[:3, :3]).magnitude() < 0.006


def test_a_placement_error_turns_the_line_of_sight_and_scales_it() -> None:
    eye_m = np.array([0.1, -0.2, 0.0])
    line_m = T_W_HAND[:3, 3] - eye_m
    sideways = PlacementError(np.zeros(3), np.array([0.003, 0.004]), 0.0)
    aside = apply_placement_error(T_W_HAND, eye_m, sideways)[:3, 3] - eye_m
    cosine = aside @ line_m / np.linalg.norm(aside) / np.linalg.norm(line_m)
    assert np.arccos(cosine) == pytest.approx(0.005, rel=1e-3)
    farther = PlacementError(np.zeros(3), np.zeros(2), 0.01)
    longer = apply_placement_error(T_W_HAND, eye_m, farther)[:3, 3] - eye_m
    np.testing.assert_allclose(longer, 1.01 * line_m)
