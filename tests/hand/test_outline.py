"""The outline that is drawn: of a hand that the depth image shows too large, and its marks."""

from __future__ import annotations

from dataclasses import astuple, replace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.display import view_of_eye
from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import Bool, DepthEdges, Float64, HandCloud, Intrinsics
from handcal.hand import outline
from handcal.hand.outline import (
    contour_px,
    inward_normals,
    moved_contour,
    outline_marks,
    with_outline,
)
from handcal.hand.segment import segment_hand
from handcal.hand.settings import SegmentSettings
from handcal.rig.example import example_rig
from handcal.sim.raster import D415
from tests.fat_hands import SKIN, Difference, beside_truth, fat_hand

from .conftest import CAMERA as SHOT_CAMERA
from .conftest import Shot

TYPICAL = DepthEdges(1.8, 0.7, "typical")
CAMERA = Intrinsics(640, 480, 600.0, 610.0, 320.0, 240.0)


def star(points: int = 800, middle_px: float = 100.0, arms_px: float = 30.0) -> Float64:
    """Return a closed contour (points, 3) with five round arms, half a metre away."""
    turn = np.linspace(0.0, 2.0 * np.pi, points, endpoint=False)
    reach_px = middle_px + arms_px * np.cos(5.0 * turn)
    return at_half_a_metre(np.column_stack([np.cos(turn), np.sin(turn)]) * reach_px[:, None])


def at_half_a_metre(place_px: Float64) -> Float64:
    x, y = 0.5 * place_px.T / [[CAMERA.fx], [CAMERA.fy]]
    return np.column_stack([x, y, np.full(len(x), 0.5)])


def on_image(points_m: Float64) -> Float64:
    place_px: Float64 = points_m[:, :2] / points_m[:, 2:] * [CAMERA.fx, CAMERA.fy]
    return place_px


def moved_inward(contour_m: Float64, by_px: float, is_cut: Bool | None = None) -> Float64:
    move_px = by_px * inward_normals(on_image(contour_m))
    return moved_contour(
        contour_m, CAMERA, move_px, np.zeros(len(contour_m), bool) if is_cut is None else is_cut
    )


def area_px(closed_px: Float64) -> float:
    return float(cv2.contourArea(closed_px.astype(np.float32)[:, None]))


@given(by_px=st.floats(-3.0, 3.0), is_reversed=st.booleans())
@settings(deadline=None, max_examples=20)
def test_a_smooth_contour_moves_by_as_much_everywhere(by_px: float, is_reversed: bool) -> None:
    contour_m = star()[::-1] if is_reversed else star()
    moved_m = moved_inward(contour_m, by_px)
    gap_px = np.linalg.norm(on_image(moved_m)[:, None] - on_image(contour_m), axis=2).min(axis=1)
    np.testing.assert_allclose(gap_px, abs(by_px), atol=0.02)
    lost_px = area_px(on_image(contour_m)) - area_px(on_image(moved_m))
    around_px = cv2.arcLength(on_image(contour_m).astype(np.float32)[:, None], closed=True)
    assert lost_px == pytest.approx(by_px * around_px, abs=0.05 * abs(by_px) * around_px + 1e-3)
    np.testing.assert_array_equal(moved_m[:, 2], contour_m[:, 2])


def test_a_sharp_corner_does_not_fold() -> None:
    side = np.arange(-40.0, 40.0)
    low, high = np.full(len(side), -40.0), np.full(len(side), 40.0)
    square = np.vstack([np.c_[side, low], np.c_[high, side], np.c_[-side, high], np.c_[low, -side]])
    moved_px = on_image(moved_inward(at_half_a_metre(square), 15.0))
    assert area_px(moved_px) == pytest.approx(50.0**2, rel=0.15)
    length_px = np.linalg.norm(np.roll(moved_px, -1, axis=0) - moved_px, axis=1).sum()
    assert length_px < 4 * 80.0
    assert (np.abs(moved_px) < 35.0).all()


def test_a_cut_stays_where_the_arm_continues() -> None:
    contour_m = star()
    is_cut = on_image(contour_m)[:, 1] > 85.0
    moved_m = moved_inward(contour_m, 2.0, is_cut)
    middle = int(np.flatnonzero(is_cut).mean())
    move_px = on_image(moved_m) - on_image(contour_m)
    assert np.abs(move_px[middle]).max() < np.abs(move_px[~is_cut]).max()
    assert np.hypot(*move_px.T).max() <= 2.0 + 1e-6


def drawn_beside_truth(
    fatten_px: int, edges: DepthEdges, **photographed: Any
) -> tuple[Difference, list[HandCloud]]:
    """Return the mean difference of what is drawn of four hands, and the hands."""
    found, clouds = [], []
    for seed in range(4):
        cloud, frame, hand, T_H_hand = fat_hand(seed, fatten_px, **photographed)
        clouds.append(with_outline(cloud, frame, edges))
        found.append(astuple(beside_truth(clouds[-1], hand, T_H_hand)))
    return Difference(*np.mean(found, axis=0)), clouds


@pytest.mark.parametrize("fatten_px", [1, 2, 3])
def test_the_silhouette_is_drawn_where_the_rig_knows_its_edges(fatten_px: int) -> None:
    cloud, _, hand, T_H_hand = fat_hand(9, fatten_px)
    measured = beside_truth(cloud, hand, T_H_hand).outside_px  # of another hand
    assert measured == pytest.approx(fatten_px, abs=0.9)
    drawn, clouds = drawn_beside_truth(fatten_px, DepthEdges(measured, 0.2, "measured"))
    # To the camera it lies as far outside as the eyes see more of a finger than the camera does.
    turned_px = 6e-5 * D415.fx / 0.49
    assert abs(drawn.outside_px - turned_px) < 0.15
    assert abs(drawn.size) < 0.003
    assert np.hypot(drawn.right_px, drawn.down_px) < 0.3  # 1'
    assert {one.outline_sigma_px for one in clouds} == {0.2}


@pytest.mark.parametrize(("fatten_px", "zoom"), [(0, 1.0), (2, 1.0), (3, 1.0), (2, 0.8)])
def test_color_shows_the_edge_of_a_camera_that_is_not_known(fatten_px: int, zoom: float) -> None:
    drawn, clouds = drawn_beside_truth(fatten_px, TYPICAL, background=(40, 110, 50), zoom=zoom)
    assert abs(drawn.outside_px) < 0.25
    assert abs(drawn.size) < 0.002
    assert np.hypot(drawn.right_px, drawn.down_px) < 0.3
    assert max(one.outline_sigma_px for one in clouds) < 0.6


def test_an_eye_below_the_camera_sees_the_outline_on_the_silhouette() -> None:
    rig = example_rig()
    view = view_of_eye(rig.eyes["left"], np.eye(4))
    eye_D_m = transform(invert(rig.T_H_D), invert(view)[:3, 3][None])[0]
    assert 0.05 < np.linalg.norm(eye_D_m) < 0.1
    found, at_the_border = [], []
    for seed in range(4):
        cloud, frame, hand, T_H_hand = fat_hand(seed, 2, (40, 110, 50))
        drawn = with_outline(cloud, frame, TYPICAL)
        found.append(beside_truth(drawn, hand, T_H_hand, eye_D_m))
        nearer_m = drawn.outline_m * (cloud.contour_m[:, 2:] / drawn.outline_m[:, 2:])
        as_measured = replace(drawn, outline_m=nearer_m)
        at_the_border.append(beside_truth(as_measured, hand, T_H_hand, eye_D_m))
    assert abs(np.mean([one.size for one in found])) < 0.0025
    assert abs(np.mean([one.right_px for one in found])) < 0.15
    assert abs(np.mean([one.down_px for one in found])) < 0.35
    assert np.mean([one.down_px for one in at_the_border]) < -0.6


def test_color_of_another_moment_is_not_followed() -> None:
    cloud, frame, _, _ = fat_hand(1, 2, (40, 110, 50))
    assert frame.color is not None
    moved = replace(frame, color=np.roll(frame.color, 6, axis=1))
    assert with_outline(cloud, moved, TYPICAL).outline_sigma_px == TYPICAL.sigma_px
    assert with_outline(cloud, frame, TYPICAL).outline_sigma_px < TYPICAL.sigma_px


def test_color_that_tells_nothing_changes_nothing() -> None:
    cloud, frame, _, _ = fat_hand(1, 2, SKIN)
    without = with_outline(cloud, replace(frame, color=None, color_intrinsics=None), TYPICAL)
    assert frame.color is not None
    dark = replace(frame, color=frame.color // 16)
    alike = replace(frame, color=np.full_like(frame.color, SKIN))
    elsewhere = replace(frame, T_C_D=rigid(None, [2.0, 0.0, 0.0]))
    moved = replace(frame, color=np.roll(frame.color, 12, axis=1))
    for one in (dark, alike, elsewhere, moved):
        drawn = with_outline(cloud, one, TYPICAL)
        np.testing.assert_array_equal(drawn.outline_m, without.outline_m)
        assert drawn.outline_sigma_px == TYPICAL.sigma_px


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


LENS = (0.1, -0.2, 0.001, -0.002, 0.05)


def test_the_contour_lies_on_the_mask_s_border(shot: Shot) -> None:
    cloud = segment_hand(shot.frame, SegmentSettings())
    depth_px, color_px = contour_px(cloud, shot.frame)
    assert color_px is None
    columns, rows = np.rint(depth_px).astype(int).T
    np.testing.assert_allclose(depth_px, np.rint(depth_px), atol=1e-3)
    assert (cloud.mask[rows, columns] == 255).all()
    around = np.stack([cloud.mask[rows + dy, columns + dx] for dx, dy in
                       ((-1, 0), (1, 0), (0, -1), (0, 1))])  # fmt: skip
    assert (around == 0).any(axis=0).mean() > 0.99


def test_a_lens_moves_the_contour_back_to_its_pixels(shot: Shot) -> None:
    frame = replace(shot.frame, depth_intrinsics=replace(SHOT_CAMERA, distortion=LENS))
    depth_px, _ = contour_px(segment_hand(frame, SegmentSettings()), frame)
    np.testing.assert_allclose(depth_px, np.rint(depth_px), atol=0.02)


@pytest.mark.parametrize("beside_m", [0.0, 0.015])
def test_a_colour_camera_sees_the_contour_shifted_by_its_place(shot: Shot, beside_m: float) -> None:
    color = np.zeros((SHOT_CAMERA.height, SHOT_CAMERA.width, 3), np.uint8)
    T_C_D = rigid(translation_m=[beside_m, 0.0, 0.0])
    frame = replace(shot.frame, color=color, color_intrinsics=SHOT_CAMERA, T_C_D=T_C_D)
    cloud = segment_hand(frame, SegmentSettings())
    depth_px, color_px = contour_px(cloud, frame)
    assert color_px is not None
    disparity_px = SHOT_CAMERA.fx * beside_m / cloud.contour_m[:, 2]
    np.testing.assert_allclose(color_px[:, 0] - depth_px[:, 0], disparity_px, atol=1e-3)
    np.testing.assert_allclose(color_px[:, 1], depth_px[:, 1], atol=1e-3)
