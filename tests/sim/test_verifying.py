"""The simulated wearer's verification: what is seen, and what is pressed."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from handcal.core.display import eye_projection, view_of_eye
from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import EYES, Eye, Float64
from handcal.link.nudges import NudgeSum, VerifyRequest
from handcal.register.nudge import nudged_shift_m
from handcal.rig.example import example_rig
from handcal.sim.hand import HandModel, make_hand
from handcal.sim.verifying import SeenDifference, SimulatedVerification, see_difference

RIG = example_rig()
T_W_H = rigid([0.1, -0.2, 0.05], [0.3, -0.1, 0.2])
REQUEST = VerifyRequest(5, "left")
EXACT = SeenDifference(0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def hand() -> HandModel:
    return make_hand(1)


def raised(eye: Eye) -> Float64:
    """Return the pose in W of a hand half a metre before an eye."""
    T_E_hand = rigid([0.0, 0.1, 0.1], [0.01, 0.02, 0.5])
    return np.asarray(invert(view_of_eye(RIG.eyes[eye], T_W_H)) @ T_E_hand)


def outline_W_m(hand: HandModel, T_W_hand: Float64, eye: Eye) -> Float64:
    """Return the rim of the hand as the eye at C0 sees it: points whose normals face sideways."""
    T_E_hand = view_of_eye(RIG.eyes[eye], T_W_H) @ T_W_hand
    points = transform(T_E_hand, hand.vertices_m)
    normals = hand.normals @ T_E_hand[:3, :3].T
    rays = points / np.linalg.norm(points, axis=1)[:, None]
    rim = np.abs(np.einsum("ij,ij->i", rays, normals)) < 0.15
    reach_m = (hand.vertices_m - hand.wrist_m) @ hand.arm_axis
    return transform(T_W_hand, hand.vertices_m[rim & (reach_m < 0.02)])


def drawn_with(eye: Eye, shift_m: Float64) -> Float64:
    """Return the pixels from points in H that are drawn with φ."""
    display = RIG.eyes[eye]
    return np.asarray(eye_projection(display, shift_m) @ view_of_eye(display, np.eye(4)))


@pytest.mark.parametrize("eye", EYES)
def test_a_drawing_with_the_true_shift_fits(hand: HandModel, eye: Eye) -> None:
    true_m = np.array([0.003, -0.002, 0.004])
    T_W_hand = raised(eye)
    outline = outline_W_m(hand, T_W_hand, eye)
    drawn = drawn_with(eye, true_m)
    seen = see_difference(RIG.eyes[eye], true_m, drawn, T_W_H, hand, T_W_hand, outline)
    assert seen is not None
    assert abs(seen.right_arcmin) < 0.1
    assert abs(seen.down_arcmin) < 0.1
    assert abs(seen.size) < 1e-3


@pytest.mark.parametrize(
    ("right", "down", "size"), [(12.0, 0.0, 0.0), (0.0, -9.0, 0.0), (-7.0, 5.0, 0.015)]
)
def test_a_nudge_by_the_difference_makes_the_drawing_fit(
    hand: HandModel, right: float, down: float, size: float
) -> None:
    """The wearer's signs and units are those of the solver, and a second look finds the rest."""
    eye = EYES[0]
    display, T_W_hand = RIG.eyes[eye], raised(eye)
    true_m = np.array([0.003, -0.002, 0.004])
    outline = outline_W_m(hand, T_W_hand, eye)
    hand_E_m = transform(view_of_eye(display, T_W_H), outline).mean(axis=0)
    shift_m = nudged_shift_m(display, true_m, hand_E_m, right, down, size)
    left = []
    for _ in range(3):
        drawn = drawn_with(eye, shift_m)
        seen = see_difference(display, true_m, drawn, T_W_H, hand, T_W_hand, outline)
        assert seen is not None
        left.append(float(np.hypot(seen.right_arcmin, seen.down_arcmin)))
        shift_m = nudged_shift_m(
            display, shift_m, hand_E_m, seen.right_arcmin, seen.down_arcmin, seen.size
        )
    assert left[0] == pytest.approx(np.hypot(right, down), abs=1.5)
    assert left[2] < 0.2
    np.testing.assert_allclose(shift_m, true_m, atol=5e-4)


def test_nothing_is_seen_of_a_drawing_beside_the_display(hand: HandModel) -> None:
    T_W_hand = raised("left")
    outline = outline_W_m(hand, T_W_hand, "left") + np.array([2.0, 0.0, 0.0])
    drawn = drawn_with("left", np.zeros(3))
    args = (RIG.eyes["left"], np.zeros(3), drawn, T_W_H, hand, T_W_hand, outline)
    assert see_difference(*args) is None


def run(
    verification: SimulatedVerification, error: SeenDifference, seconds: float = 30.0
) -> tuple[NudgeSum, float]:
    """Let a drawing follow the presses after 50 ms; return where it fits, and when."""
    moved, drawn_moved, changes = NudgeSum(), NudgeSum(), 0
    due: list[tuple[float, NudgeSum]] = []
    for t_s in np.arange(0.0, seconds, 1 / 90):
        while due and due[0][0] <= t_s:
            drawn_moved, changes = due.pop(0)[1], changes + 1
        left = SeenDifference(
            error.right_arcmin - drawn_moved.right_arcmin,
            error.down_arcmin - drawn_moved.down_arcmin,
            error.size - drawn_moved.size,
        )
        nudge, fits = verification.step(
            float(t_s), np.full(1, float(changes)), partial(_same, left)
        )
        if nudge is not None and nudge != moved:
            moved = nudge
            due.append((t_s + 0.05, nudge))
        if fits:
            return moved, float(t_s)
    raise AssertionError("the wearer was never content")


def _same(seen: SeenDifference) -> SeenDifference:
    return seen


def test_the_wearer_moves_the_drawing_until_it_fits_within_a_step() -> None:
    moved, t_s = run(
        SimulatedVerification(REQUEST, EXACT, 0.6, 0.12), SeenDifference(7.3, -4.1, 0.006)
    )
    assert (moved.right_arcmin, moved.down_arcmin) == (7.0, -4.0)
    assert moved.size == pytest.approx(0.006)
    assert t_s < 5.0


def test_the_wearer_s_own_error_stays() -> None:
    error = SeenDifference(2.0, 0.0, 0.0)
    moved, _ = run(SimulatedVerification(REQUEST, error, 0.6, 0.12), SeenDifference(3.0, 0.0, 0.0))
    assert moved.right_arcmin == 5.0


def test_a_drawing_that_does_not_follow_ends_all_the_same() -> None:
    """As with a headset that does not draw what it is sent."""
    verification = SimulatedVerification(REQUEST, EXACT, 0.6, 0.12)
    for t_s in np.arange(0.0, 90.0, 1 / 30):
        if verification.step(float(t_s), np.zeros(1), lambda: SeenDifference(9.0, 0.0, 0.0))[1]:
            return
    raise AssertionError("the wearer was never content")
