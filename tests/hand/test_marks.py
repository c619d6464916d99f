"""Marks at the finger tips and the wrist: where they are, and that they displace nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.core.types import Float64
from handcal.hand import outline
from handcal.hand.outline import outline_marks
from handcal.hand.segment import segment_hand
from handcal.hand.settings import SegmentSettings

from .conftest import Shot

_STEP_M = 0.001
# Wrist, three fingers of 4 cm, 2 cm apart, and back.
_CORNERS_M = 0.01 * np.column_stack(
    [(0, 5, 5, 4, 4, 3, 3, 2, 2, 1, 1, 0), (0, 0, -12, -12, -8, -8, -13, -13, -8, -8, -12, -12)]
)
_TIPS_M = np.array([(4.5, -12), (2.5, -13), (0.5, -12)]) * 0.01


def comb() -> tuple[Float64, np.ndarray[tuple[int], np.dtype[np.bool_]]]:
    """Return a comb's closed outline at 0.5 m, and which of it is its lower side, the wrist."""
    sides = list(zip(_CORNERS_M, np.roll(_CORNERS_M, -1, axis=0), strict=True))
    counts = [round(float(np.linalg.norm(b - a)) / _STEP_M) for a, b in sides]
    points = np.vstack(
        [np.linspace(*side, n, endpoint=False) for side, n in zip(sides, counts, strict=True)]
    )
    return np.column_stack([points, np.full(len(points), 0.5)]), points[:, 1] == 0.0


@given(st.integers(0, 700))
def test_tips_and_wrist_are_marked_wherever_the_outline_begins(start: int) -> None:
    outline_m, is_cut = comb()
    marks_m = outline_marks(np.roll(outline_m, start, axis=0), np.roll(is_cut, start))
    wrist_m = np.array([(0.0, 0.0), (0.05, 0.0)])
    apart_m = np.linalg.norm(marks_m[:, None, :2] - np.vstack([_TIPS_M, wrist_m]), axis=2)
    assert (apart_m.min(axis=0) < 0.007).all()
    assert (apart_m.min(axis=1) < 0.014).all()


def test_marks_lie_on_both_sides_of_the_outline() -> None:
    outline_m, is_cut = comb()
    marks_m = outline_marks(outline_m, is_cut)
    middle_m = 0.5 * (marks_m[: len(marks_m) // 2] + marks_m[len(marks_m) // 2 :])
    apart_m = np.linalg.norm(middle_m[:, None] - outline_m, axis=2).min(axis=1)
    np.testing.assert_allclose(apart_m, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(marks_m[: len(middle_m)] - middle_m, axis=1), 0.0015)


def test_all_five_fingers_of_a_simulated_hand_are_marked(shot: Shot) -> None:
    cloud = segment_hand(shot.frame, SegmentSettings())
    outline_m = cloud.contour_m.astype(np.float64)
    marks_m = outline_marks(outline_m, cloud.contour_is_cut)
    beyond_m = shot.beyond_wrist_m(marks_m.astype(np.float32))
    marks_m, beyond_m = marks_m[: len(marks_m) // 2], beyond_m[: len(marks_m) // 2]
    fingers_m = marks_m[beyond_m < -0.03]
    assert 1 + np.count_nonzero(np.linalg.norm(np.diff(fingers_m, axis=0), axis=1) > 0.01) == 5
    assert (np.abs(beyond_m[beyond_m > -0.03]) < 0.04).all()


@pytest.mark.parametrize("is_cut", [False, True])
def test_without_an_arm_nothing_is_marked(is_cut: bool) -> None:
    outline_m, cut = comb()
    assert not len(outline_marks(outline_m, np.full_like(cut, is_cut)))


def test_points_may_be_repeated() -> None:
    outline_m, is_cut = comb()
    marks_m = outline_marks(outline_m.repeat(3, axis=0), is_cut.repeat(3))
    assert np.isfinite(marks_m).all()


@given(st.lists(st.integers(0, 30), min_size=1, max_size=40, unique=True))
def test_tips_are_the_prominent_peaks(heights: list[int]) -> None:
    reach_m = 0.005 * np.array(heights)  # no difference is near the limit

    def prominence_m(index: int) -> float:
        sides = reach_m[index::-1], reach_m[index:]
        ends = ([*np.flatnonzero(side > reach_m[index]), len(side)][0] for side in sides)
        lowest_m = (side[:end].min() for side, end in zip(sides, ends, strict=True))
        return float(reach_m[index] - max(lowest_m))

    prominent = [i for i in range(len(reach_m)) if prominence_m(i) >= outline._LEAST_FINGER_M]
    assert outline._tips(reach_m) == prominent
