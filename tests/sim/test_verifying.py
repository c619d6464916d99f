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
from handcal.sim.verifying import (
    SeenDifference,
    SimulatedVerification,
    presses_for,
    see_difference,
)
from tests.sim.rims import rim_outline

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


def outline_W_m(hand: HandModel, T_W_hand: Float64, eye: Eye, true_m: Float64) -> Float64:
    """Return the rim of the hand as the true eye sees it."""
    T_E_W = view_of_eye(RIG.eyes[eye], T_W_H)
    rim_m = rim_outline(hand, rigid(None, -true_m) @ T_E_W @ T_W_hand)
    return transform(invert(T_E_W), rim_m + true_m)


def drawn_with(eye: Eye, shift_m: Float64) -> Float64:
    """Return the pixels from points in H that are drawn with φ."""
    display = RIG.eyes[eye]
    return np.asarray(eye_projection(display, shift_m) @ view_of_eye(display, np.eye(4)))


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
    outline = outline_W_m(hand, T_W_hand, eye, true_m)
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
    moved, t_s = run(SimulatedVerification(REQUEST, EXACT), SeenDifference(7.3, -4.1, 0.006))
    assert (moved.right_arcmin, moved.down_arcmin) == (7.0, -4.0)
    assert moved.size == pytest.approx(0.006)
    assert t_s < 5.0


def test_a_drawing_that_does_not_follow_ends_all_the_same() -> None:
    """As with a headset that does not draw what it is sent."""
    verification = SimulatedVerification(REQUEST, EXACT)
    for t_s in np.arange(0.0, 90.0, 1 / 30):
        if verification.step(float(t_s), np.zeros(1), lambda: SeenDifference(9.0, 0.0, 0.0))[1]:
            return
    raise AssertionError("the wearer was never content")


def test_presses_are_whole_steps_and_half_a_step_is_good_enough() -> None:
    seen = SeenDifference(3.4, -0.6, 0.0021)
    right, down, size = presses_for(seen, EXACT, REQUEST)
    assert (right, down) == (3.0 * REQUEST.step_arcmin, 0.0)
    assert size == pytest.approx(REQUEST.step_size * round(0.0021 / REQUEST.step_size))
    # Who sees it wrongly presses for that.
    assert presses_for(seen, SeenDifference(-3.4, 0.6, -0.0021), REQUEST) == (0.0, 0.0, 0.0)


def test_a_drawing_that_fits_at_once_and_is_moved_aside_is_brought_back() -> None:
    """The wearer sees that it has moved, looks again and presses keys."""
    verification = SimulatedVerification(REQUEST, EXACT)
    moved, confirmed, drawn_moved, changed_s = NudgeSum(), 0, NudgeSum(), 0.0
    for t_s in np.arange(0.0, 30.0, 1 / 90):
        aside = (8.0, -6.0, 0.02) if confirmed else (0.0, 0.0, 0.0)
        if t_s > changed_s + 0.05:
            drawn_moved = moved
        left = SeenDifference(
            -aside[0] - drawn_moved.right_arcmin,
            -aside[1] - drawn_moved.down_arcmin,
            -aside[2] - drawn_moved.size,
        )
        drawn = np.array([aside[0], drawn_moved.right_arcmin, drawn_moved.down_arcmin,
                          drawn_moved.size])  # fmt: skip
        nudge, fits = verification.step(float(t_s), drawn, partial(_same, left))
        if nudge is not None and nudge != moved:
            moved, changed_s = nudge, float(t_s)
        confirmed += fits
        if confirmed == 2:
            break
    assert confirmed == 2
    assert (moved.right_arcmin, moved.down_arcmin) == (-8.0, 6.0)
    assert moved.size == pytest.approx(-0.02)
