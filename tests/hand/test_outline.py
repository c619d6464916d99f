"""The outline that is drawn: the silhouette of a hand that the depth image shows too large."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.display import projection_matrix
from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import DepthEdges, Float64, Frame, HandCloud, Intrinsics
from handcal.hand.outline import inward_normals, moved_inward, with_outline
from handcal.hand.segment import SegmentSettings, segment_hand
from handcal.rig.example import example_rig
from handcal.sim.hand import HandModel, make_hand
from handcal.sim.raster import D415, draw_hand
from handcal.sim.sensor import SensorSettings, sense_depth
from handcal.sim.verifying import SeenDifference, see_difference

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


def area_px(closed_px: Float64) -> float:
    return float(cv2.contourArea(closed_px.astype(np.float32)[:, None]))


@given(by_px=st.floats(-3.0, 3.0), is_reversed=st.booleans())
@settings(deadline=None, max_examples=20)
def test_a_smooth_contour_moves_by_as_much_everywhere(by_px: float, is_reversed: bool) -> None:
    contour_m = star()[::-1] if is_reversed else star()
    moved_m = moved_inward(contour_m, CAMERA, by_px)
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
    moved_px = on_image(moved_inward(at_half_a_metre(square), CAMERA, 15.0))
    assert area_px(moved_px) == pytest.approx(50.0**2, rel=0.15)
    length_px = np.linalg.norm(np.roll(moved_px, -1, axis=0) - moved_px, axis=1).sum()
    assert length_px < 4 * 80.0
    assert (np.abs(moved_px) < 35.0).all()


def test_a_cut_stays_where_the_arm_continues() -> None:
    contour_m = star()
    is_cut = on_image(contour_m)[:, 1] > 85.0
    moved_m = moved_inward(contour_m, CAMERA, 2.0, is_cut)
    middle = int(np.flatnonzero(is_cut).mean())
    move_px = on_image(moved_m) - on_image(contour_m)
    assert np.abs(move_px[middle]).max() < np.abs(move_px[~is_cut]).max()
    assert np.hypot(*move_px.T).max() <= 2.0 + 1e-6


def test_too_short_a_contour_is_left_alone() -> None:
    contour_m = star()[:2]
    np.testing.assert_array_equal(moved_inward(contour_m, CAMERA, 2.0), contour_m)


def test_normals_of_a_circle_point_to_its_middle() -> None:
    place_px = on_image(star(600, 100.0, 0.0))
    inward = inward_normals(place_px)
    np.testing.assert_allclose(inward, -place_px / 100.0, atol=1e-6)


def fat_hand(seed: int, fatten_px: int) -> tuple[HandCloud, HandModel, Float64]:
    """Return a hand as the example rig's camera segments it, and its pose in H."""
    rig, rng = example_rig(), np.random.default_rng(seed)
    hand = make_hand(seed)
    T_H_hand = rigid(rng.normal(0, 0.08, 3), np.add([0, 0.088, 0.49], rng.normal(0, 0.01, 3)))
    image = draw_hand(hand, invert(rig.T_H_D) @ T_H_hand, D415)
    depth_m = np.full((D415.height, D415.width), 2.0, np.float32)
    height, width = image.depth_m.shape
    part = depth_m[image.y0 : image.y0 + height, image.x0 : image.x0 + width]
    np.copyto(part, image.depth_m, where=np.isfinite(image.depth_m))
    sensor = replace(SensorSettings(), fatten_px=fatten_px)
    depth = sense_depth(depth_m, D415.fx, rng, sensor)
    frame = Frame(0, 0, 0, depth, sensor.depth_scale_m, D415)
    return segment_hand(frame, SegmentSettings(roi="depth")), hand, T_H_hand


def asked_for(cloud: HandCloud, hand: HandModel, T_H_hand: Float64) -> SeenDifference:
    """Return what a wearer whose φ is exactly right asks for: nothing, if the outline is right."""
    rig = example_rig()
    display = rig.eyes["left"]
    outline_H_m = transform(rig.T_H_D, cloud.outline_m[~cloud.outline_is_cut])
    seen = see_difference(
        display,
        np.zeros(3),
        projection_matrix(display) @ display.T_V_H,
        np.eye(4),
        hand,
        T_H_hand,
        outline_H_m,
    )
    assert seen is not None
    return seen


@pytest.mark.parametrize("fatten_px", [1, 2, 3])
def test_the_wearer_asks_for_nothing_where_the_rig_knows_its_edges(fatten_px: int) -> None:
    asked, uncorrected = [], []
    for seed in range(4):
        cloud, hand, T_H_hand = fat_hand(seed, fatten_px)
        drawn = with_outline(cloud, D415, DepthEdges(fatten_px, 0.2, "measured"))
        assert drawn.outline_sigma_px == 0.2
        asked.append(asked_for(drawn, hand, T_H_hand))
        uncorrected.append(asked_for(cloud, hand, T_H_hand).size)
    assert np.mean(uncorrected) < -0.006 * fatten_px
    assert abs(np.mean([one.right_arcmin for one in asked])) < 1.5
    assert abs(np.mean([one.down_arcmin for one in asked])) < 1.5
    # The simulator's square windows fatten slanted edges more than the number says.
    assert abs(np.mean([one.size for one in asked])) < (0.004 if fatten_px == 3 else 0.003)


def test_what_is_registered_stays_as_measured() -> None:
    cloud, _, _ = fat_hand(0, 2)
    drawn = with_outline(cloud, D415, DepthEdges(2.0, 0.2, "measured"))
    assert drawn.contour_m is not drawn.outline_m
    np.testing.assert_array_equal(drawn.contour_m, cloud.contour_m)
    np.testing.assert_array_equal(drawn.points_m, cloud.points_m)
    np.testing.assert_array_equal(cloud.outline_m, cloud.contour_m)
    np.testing.assert_array_equal(cloud.outline_is_cut, cloud.contour_is_cut)
