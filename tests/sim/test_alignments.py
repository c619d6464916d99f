from dataclasses import replace

import numpy as np
import pytest

from handcal.core.display import update_matrix
from handcal.core.geometry import project, transform
from handcal.register.rcicp import best_rigid
from handcal.sim.alignments import AlignmentSettings, SimulatedAlignment, simulate_alignment
from handcal.sim.hand import HandModel, make_hand

CLEAN = AlignmentSettings(count=800)


@pytest.fixture(scope="module")
def hand() -> HandModel:
    return make_hand(0)


def _make(hand: HandModel, angle_rad: float, settings: AlignmentSettings) -> SimulatedAlignment:
    return simulate_alignment(np.random.default_rng(4), hand, angle_rad, settings)


@pytest.mark.parametrize("exact", [True, False])
def test_known_pairs_fall_on_one_pixel(hand: HandModel, exact: bool) -> None:
    made = _make(hand, 0.0, replace(CLEAN, exact=exact))
    UQ = update_matrix(made.shift_m, made.display_distance_m)
    np.testing.assert_allclose(
        project(np.eye(3, 4), made.known_cursor_m), project(UQ[:3], made.known_hand_m), atol=1e-12
    )


def test_only_the_honest_hand_keeps_its_width(hand: HandModel) -> None:
    for exact, ratio in ((True, 1.0), (False, None)):
        made = _make(hand, 0.0, replace(CLEAN, exact=exact))
        width = np.ptp(made.known_cursor_m[:, 0]) / np.ptp(made.known_hand_m[:, 0])
        phi_3 = made.shift_m[2] / made.display_distance_m
        # φ1 shears by depth, which the width hardly shows.
        assert width == pytest.approx(ratio or 1.0 - phi_3, abs=2e-4)
        assert abs(phi_3) > 5e-4


def test_the_cursor_is_turned_by_the_angle_about_a_point_of_its_own(hand: HandModel) -> None:
    straight, turned = (_make(hand, angle_rad, CLEAN) for angle_rad in (0.0, 0.3))
    T = best_rigid(straight.cursor_m, turned.cursor_m)
    np.testing.assert_allclose(transform(T, straight.cursor_m), turned.cursor_m, atol=1e-9)
    assert np.linalg.norm(turned.rotation_rad) == pytest.approx(0.3)
    angle = np.arccos((np.trace(T[:3, :3]) - 1) / 2)
    assert angle == pytest.approx(0.3)
    axis = turned.rotation_rad / 0.3
    np.testing.assert_allclose(T[:3, :3] @ axis, axis, atol=1e-9)
    still = np.linalg.norm(transform(T, straight.cursor_m) - straight.cursor_m, axis=1)
    assert still.min() < 1e-9


def test_forearms_are_cut_where_told(hand: HandModel) -> None:
    settings = replace(CLEAN, resample=True, cursor_forearm_m=0.02, hand_forearm_m=0.06, count=3000)
    made = _make(hand, 0.0, settings)
    assert made.cursor_cut.any()
    assert made.hand_cut.any()
    assert 0.7 < len(made.known_hand_m) / len(made.hand_m) < 0.97
    equal = _make(hand, 0.0, replace(settings, hand_forearm_m=0.02))
    assert len(equal.known_hand_m) == len(equal.hand_m)
