"""The outline that is drawn: the silhouette of a hand that the depth image shows too large."""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.geometry import invert, rigid
from handcal.core.types import Bool, DepthEdges, Float64, Frame, HandCloud, Intrinsics, UInt8
from handcal.hand.outline import inward_normals, moved_inward, with_outline
from handcal.hand.segment import SegmentSettings, segment_hand
from handcal.rig.example import example_rig
from handcal.sim.hand import HandModel, make_hand
from handcal.sim.raster import D415, draw_hand
from handcal.sim.sensor import SensorSettings, sense_depth

SKIN = (205, 155, 130)
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


def fat_hand(
    seed: int, fatten_px: int, background: tuple[int, int, int] | None = None, zoom: float = 1.0
) -> tuple[HandCloud, Frame, HandModel, Float64]:
    """Return a hand as the example rig's camera segments it, its frame, and its pose in H.

    With colour before a background; of a lens `zoom` times as long as the depth camera's.
    """
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
    cloud = segment_hand(frame, SegmentSettings(roi="depth"))
    if background is not None:
        camera = replace(D415, fx=zoom * D415.fx, fy=zoom * D415.fy)
        color = photograph(hand, invert(rig.T_H_D) @ T_H_hand, camera, background, rng)
        frame = replace(frame, color=color, color_intrinsics=camera)
    return cloud, frame, hand, T_H_hand


def photograph(
    hand: HandModel,
    T_D_hand: Float64,
    camera: Intrinsics,
    background: tuple[int, int, int],
    rng: np.random.Generator,
) -> UInt8:
    """Return a noisy image of a hand before leaves, or the like, of one colour."""
    image = draw_hand(hand, T_D_hand, camera)
    height, width = image.depth_m.shape
    is_hand = np.zeros((camera.height, camera.width, 1), np.float32)
    is_hand[image.y0 : image.y0 + height, image.x0 : image.x0 + width, 0] = np.isfinite(
        image.depth_m
    )
    leaves = cv2.GaussianBlur(rng.normal(0, 60, is_hand.shape), (0, 0), 2.0)[..., None]
    light = is_hand * SKIN + (1.0 - is_hand) * (background + leaves)
    light = cv2.GaussianBlur(light, (0, 0), 0.7) + rng.normal(0, 4, light.shape)
    return np.clip(light, 0, 255).astype(np.uint8)


@dataclass(frozen=True)
class Difference:
    """An outline beside the silhouette of the true hand, in the depth image."""

    outside_px: float
    right_px: float
    down_px: float
    size: float


def beside_truth(cloud: HandCloud, hand: HandModel, T_H_hand: Float64) -> Difference:
    """Compare what is drawn, without its cut, with the silhouette: distance and similarity."""
    finer = 3
    camera = replace(
        D415,
        width=finer * D415.width,
        height=finer * D415.height,
        **{name: finer * getattr(D415, name) for name in ("fx", "fy")},
        **{name: finer * (getattr(D415, name) + 0.5) - 0.5 for name in ("cx", "cy")},
    )
    image = draw_hand(hand, invert(example_rig().T_H_D) @ T_H_hand, camera)
    is_hand = np.pad(np.isfinite(image.depth_m), 30).astype(np.uint8)
    # Either distance is to the centre of the nearest pixel of the other kind.
    beyond_px = np.asarray(cv2.distanceTransform(1 - is_hand, cv2.DIST_L2, 5), np.float64)
    beyond_px -= cv2.distanceTransform(is_hand, cv2.DIST_L2, 5)
    beyond_px = (beyond_px - 0.5 * np.sign(beyond_px)) / finer
    silhouette_m = cloud.outline_m[~near_cut(cloud.outline_is_cut)].astype(np.float64)
    place_px = silhouette_m[:, :2] / silhouette_m[:, 2:] * D415.fx
    at = finer * (place_px + np.add([D415.cx, D415.cy], 0.5)) - 0.5
    column, row = (at - [image.x0 - 30, image.y0 - 30]).astype(np.float32).T
    slope = np.gradient(finer * cv2.GaussianBlur(beyond_px, (0, 0), 3.0))
    gap_px, down, right = (
        cv2.remap(one.astype(np.float32), column, row, cv2.INTER_LINEAR).ravel()
        for one in (beyond_px, *slope)
    )
    from_middle = place_px - place_px.mean(axis=0)
    across = right * from_middle[:, 0] + down * from_middle[:, 1]
    fitted, *_ = np.linalg.lstsq(np.column_stack([right, down, across]), gap_px, rcond=None)
    return Difference(float(gap_px.mean()), *map(float, fitted))


def near_cut(is_cut: Bool) -> Bool:
    """Return the points of a closed outline at most 25 steps from a cut."""
    return np.asarray(np.any([np.roll(is_cut, step) for step in range(-25, 26)], axis=0))


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
    assert abs(drawn.outside_px) < 0.15
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


def test_color_that_tells_nothing_changes_nothing() -> None:
    cloud, frame, _, _ = fat_hand(1, 2, SKIN)
    without = with_outline(cloud, replace(frame, color=None, color_intrinsics=None), TYPICAL)
    assert frame.color is not None
    dark = replace(frame, color=frame.color // 16)
    alike = replace(frame, color=np.full_like(frame.color, SKIN))
    elsewhere = replace(frame, T_C_D=rigid(None, [2.0, 0.0, 0.0]))
    for one in (dark, alike, elsewhere):
        drawn = with_outline(cloud, one, TYPICAL)
        np.testing.assert_array_equal(drawn.outline_m, without.outline_m)
        assert drawn.outline_sigma_px == TYPICAL.sigma_px


def test_what_is_registered_stays_as_measured() -> None:
    cloud, frame, _, _ = fat_hand(0, 2)
    drawn = with_outline(cloud, frame, DepthEdges(2.0, 0.2, "measured"))
    assert drawn.contour_m is not drawn.outline_m
    np.testing.assert_array_equal(drawn.contour_m, cloud.contour_m)
    np.testing.assert_array_equal(drawn.points_m, cloud.points_m)
    np.testing.assert_array_equal(cloud.outline_m, cloud.contour_m)
    np.testing.assert_array_equal(cloud.outline_is_cut, cloud.contour_is_cut)
