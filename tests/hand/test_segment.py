"""Segmentation of simulated hands with known truth, and of real ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.errors import HandError
from handcal.core.geometry import camera_matrix, project, rigid
from handcal.core.types import Frame, HandCloud, Intrinsics, UInt16
from handcal.hand.segment import segment_hand
from handcal.hand.settings import NEARER_M, SegmentSettings

from .conftest import CAMERA, Shot, shoot

SETTINGS = SegmentSettings()


def read_depth(path: Path) -> UInt16:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert image is not None
    assert image.dtype == np.uint16
    return np.asarray(image, np.uint16)


def with_depth(frame: Frame, depth: UInt16) -> Frame:
    return Frame(
        frame.index,
        frame.t_camera_ns,
        frame.t_host_ns,
        depth,
        frame.depth_scale_m,
        frame.depth_intrinsics,
    )


def cut_beyond_wrist_m(shot: Shot, cloud: HandCloud) -> float:
    return float(shot.beyond_wrist_m(cloud.contour_m[cloud.contour_is_cut]).mean())


@pytest.mark.parametrize("seed", range(6))
def test_mask_covers_the_hand_and_little_else(seed: int) -> None:
    shot = shoot(seed)
    cloud = segment_hand(shot.frame, SETTINGS)
    mask = cloud.mask > 0
    on_hand = shot.is_hand() & (shot.frame.depth > 0)
    assert mask[on_hand].mean() > 0.95
    assert np.isfinite(shot.depth_m[mask]).mean() > 0.97
    assert shot.beyond_wrist_m(cloud.points_m).max() < 0.04


def test_cut_lands_at_the_same_place_of_the_same_hand() -> None:
    cuts_m = np.array(
        [
            [
                cut_beyond_wrist_m(shot, segment_hand(shot.frame, SETTINGS))
                for shot in (
                    shoot(seed),
                    shoot(seed, at_m=(0.03, 0.0, 0.48), turn_rad=(0.2, 0.1, 0.15), noise_seed=1),
                    shoot(seed, at_m=(-0.03, 0.03, 0.56), turn_rad=(0.1, 0.2, 0.0), noise_seed=2),
                    shoot(seed, forearm_m=0.2, noise_seed=3),
                )
            ]
            for seed in range(4)
        ]
    )
    assert 0.01 < cuts_m.mean() < 0.03
    assert (cuts_m - cuts_m.mean(axis=1, keepdims=True)).std() < 0.004


def test_points_lie_on_the_true_surface(shot: Shot) -> None:
    cloud = segment_hand(shot.frame, SETTINGS)
    columns, rows = np.rint(project(camera_matrix(CAMERA) @ rigid()[:3], cloud.points_m)).T
    error_m = cloud.points_m[:, 2] - shot.depth_m[rows.astype(int), columns.astype(int)]
    assert np.percentile(np.abs(error_m), 99) < 0.005
    assert (np.abs(error_m) > 0.02).sum() <= 5  # a flying pixel
    assert abs(np.median(error_m)) < 0.0005
    assert abs(len(cloud.points_m) - SETTINGS.points) < 0.02 * SETTINGS.points
    assert cloud.median_depth_m == pytest.approx(np.median(cloud.points_m[:, 2]), abs=1e-6)
    assert (cloud.t_camera_ns, cloud.t_host_ns) == (1_000, 2_000)


def test_only_the_wrist_is_marked_as_cut(shot: Shot) -> None:
    cloud = segment_hand(shot.frame, SETTINGS)
    beyond_m = shot.beyond_wrist_m(cloud.contour_m)
    cut_m = beyond_m[cloud.contour_is_cut]
    assert len(cut_m) > 30
    assert cut_m.min() > 0.0
    assert not cloud.contour_is_cut[beyond_m < 0.0].any()
    assert 0.0 < cloud.is_cut.mean() < 0.08
    assert shot.beyond_wrist_m(cloud.points_m[cloud.is_cut]).min() > -0.01
    edge_m = cloud.contour_m[cloud.contour_is_cut]
    apart_m = np.linalg.norm(cloud.points_m[:, None] - edge_m, axis=2).min(axis=1)
    assert cloud.is_cut[apart_m < 0.003].mean() > 0.95


def test_contour_goes_around_the_hand_in_order(shot: Shot) -> None:
    cloud = segment_hand(shot.frame, SETTINGS)
    step_m = np.linalg.norm(np.diff(cloud.contour_m[:, :2], axis=0), axis=1)
    assert np.median(step_m) < 0.002
    assert np.percentile(step_m, 98) < 0.01
    rows, columns = np.nonzero(cloud.mask)
    around = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
    assert list(cloud.box_px) == [int(edge) for edge in around]


@pytest.mark.parametrize("wall_m", [0.60, 0.66, 0.72])
def test_what_stands_close_behind_does_not_join(wall_m: float) -> None:
    shot = shoot(wall_m=wall_m)
    mask = segment_hand(shot.frame, SETTINGS).mask > 0
    assert np.isfinite(shot.depth_m[mask]).mean() > 0.97
    assert mask[shot.is_hand() & (shot.frame.depth > 0)].mean() > 0.95


def test_region_of_interest_gives_the_same_hand(shot: Shot) -> None:
    whole = segment_hand(shot.frame, SETTINGS)
    in_roi = segment_hand(shot.frame, SETTINGS, whole.box_px)
    union = np.count_nonzero((whole.mask > 0) | (in_roi.mask > 0))
    assert np.count_nonzero((whole.mask > 0) & (in_roi.mask > 0)) > 0.97 * union


def test_region_of_interest_edge_counts_as_cut(shot: Shot) -> None:
    x0, y0, x1, y1 = segment_hand(shot.frame, SETTINGS).box_px
    narrow = SegmentSettings(roi_margin=0.0)
    cloud = segment_hand(shot.frame, narrow, (x0, y0, x1, y1 - (y1 - y0) // 5))
    pixels = project(camera_matrix(CAMERA) @ rigid()[:3], cloud.contour_m)
    lowest = pixels[:, 1] > pixels[:, 1].max() - 0.5
    assert cloud.contour_is_cut[lowest].all()
    with pytest.raises(ValueError, match="region of interest"):
        segment_hand(shot.frame, SETTINGS, (700, 0, 800, 50))


def test_arm_that_leaves_through_the_gate_is_cut() -> None:
    shot = shoot(turn_rad=(-0.9, 0.0, 0.0), at_m=(0.0, 0.0, 0.5))  # the elbow comes nearer
    depth_max_m = float(shot.depth_m[shot.is_hand()].max()) + 0.02
    settings = SegmentSettings(depth_min_m=0.44, depth_max_m=depth_max_m)
    cloud = segment_hand(shot.frame, settings)
    cut_m = shot.beyond_wrist_m(cloud.contour_m[cloud.contour_is_cut])
    assert len(cut_m) > 20
    assert cut_m.min() > -0.02
    assert cloud.points_m[:, 2].min() >= 0.44 - 1e-4


@pytest.mark.parametrize("with_box", [False, True])
@pytest.mark.parametrize("end", ["near", "far"])
def test_a_hand_across_the_gate_is_kept_whole_or_told_where_to_go(end: str, with_box: bool) -> None:
    shot = shoot(turn_rad=(-0.5, 0.0, 0.0))
    whole = segment_hand(shot.frame, SETTINGS)
    box = whole.box_px if with_box else None
    surface = (whole.mask > 0) & (shot.frame.depth > 0)
    depth_m = shot.frame.depth[surface] * shot.frame.depth_scale_m
    for beyond, is_kept in ((0.05, True), (0.1, True), (0.3, True), (0.7, False), (0.9, False)):
        if end == "near":  # a hand that the detector sees may be nearer
            near_m = float(np.quantile(depth_m, beyond)) + NEARER_M * with_box
            gated, way = SegmentSettings(depth_min_m=near_m, depth_max_m=1.0), "near.* back"
        else:
            far_m = float(np.quantile(depth_m, 1.0 - beyond))
            gated, way = SegmentSettings(depth_min_m=0.2, depth_max_m=far_m), "far.* nearer"
        if is_kept:
            mask = segment_hand(shot.frame, gated, box).mask
            assert (mask > 0)[surface].mean() > 0.97, beyond
            continue
        with pytest.raises(HandError, match=rf"too {way} by \d+ cm"):
            segment_hand(shot.frame, gated, box)


def test_a_farther_thing_is_not_taken_for_a_hand_before_the_gate() -> None:
    near, far = shoot(), shoot(at_m=(0.1, 0.02, 0.75))
    depth = np.where(near.frame.depth < 6000, near.frame.depth, far.frame.depth)
    gated = SegmentSettings(depth_min_m=0.62, depth_max_m=0.9)
    with pytest.raises(HandError, match=r"too near, at 5\d cm; move it back by 1\d cm"):
        segment_hand(with_depth(near.frame, depth), gated)


def test_hand_at_the_border_is_refused() -> None:
    with pytest.raises(HandError, match="cut by the image border"):
        segment_hand(shoot(at_m=(0.0, -0.11, 0.52)).frame, SETTINGS)


def test_a_hand_half_hidden_by_another_thing_is_refused(shot: Shot) -> None:
    x0, y0, x1, y1 = segment_hand(shot.frame, SETTINGS).box_px
    nearer = round((float(shot.depth_m[shot.is_hand()].min()) - 0.06) / shot.frame.depth_scale_m)
    for rows in (slice((y0 + y1) // 2, CAMERA.height), slice((y0 + y1) // 2, (y0 + y1) // 2 + 20)):
        depth = shot.frame.depth.copy()
        depth[rows, :] = nearer
        with pytest.raises(HandError, match=r"hidden behind something|shaped like"):
            segment_hand(with_depth(shot.frame, depth), SETTINGS, (x0, y0, x1, y1))
    depth = shot.frame.depth.copy()
    depth[y0 : y0 + 20, x0 - 30 : x0] = nearer  # beside it
    segment_hand(with_depth(shot.frame, depth), SETTINGS, (x0, y0, x1, y1))


def test_nothing_within_the_gate_is_refused(shot: Shot) -> None:
    with pytest.raises(HandError, match=r"no hand-sized object between 0\.35 and 0\.70 m"):
        segment_hand(shoot(at_m=(0.0, 0.02, 1.2)).frame, SETTINGS)
    with pytest.raises(HandError, match="no hand-sized"):
        segment_hand(with_depth(shot.frame, np.zeros_like(shot.frame.depth)), SETTINGS)


@pytest.mark.parametrize(("factor", "seen"), [(0.1, "farther than 0.15"), (5, "nearer than 2")])
def test_depths_of_another_unit_are_told(shot: Shot, factor: float, seen: str) -> None:
    with pytest.raises(HandError, match=f"{seen}.*if a hand is in view, correct the unit"):
        segment_hand(replace(shot.frame, depth_scale_m=factor * 1e-4), SETTINGS)


@given(
    blobs=st.lists(
        st.tuples(
            st.integers(-20, 660),
            st.integers(-20, 380),
            st.integers(2, 250),
            st.integers(2, 250),
            st.integers(0, 7500),
            st.integers(-60, 60),
        ),
        max_size=8,
    ),
    seed=st.integers(0, 1000),
    holes=st.floats(0.0, 1.0),
)
@settings(max_examples=60, deadline=None)
def test_any_scene_gives_a_hand_or_a_reason(
    blobs: list[tuple[int, int, int, int, int, int]], seed: int, holes: float
) -> None:
    rows, columns = np.indices((CAMERA.height, CAMERA.width))
    depth = np.zeros((CAMERA.height, CAMERA.width))
    for x, y, a, b, z, slope in blobs:
        inside = ((columns - x) / a) ** 2 + ((rows - y) / b) ** 2 < 1.0
        depth[inside] = z + slope * (columns - x)[inside]
    depth[np.random.default_rng(seed).random(depth.shape) < holes**4] = 0.0
    frame = Frame(1, 0, 0, depth.clip(0, 65535).astype(np.uint16), 1e-4, CAMERA)
    try:
        cloud = segment_hand(frame, SETTINGS)
    except HandError:
        return
    assert 0 < len(cloud.points_m) < 1.1 * SETTINGS.points
    assert np.isfinite(cloud.points_m).all()
    assert cloud.points_m[:, 2].min() > SETTINGS.depth_min_m - 1e-4
    assert cloud.points_m[:, 2].max() < SETTINGS.depth_max_m + 1e-4


def test_small_holes_are_closed_in_the_mask_but_give_no_points(shot: Shot) -> None:
    before = segment_hand(shot.frame, SETTINGS)
    rows, columns = np.nonzero(before.mask)
    row, column = int(np.median(rows)), int(np.median(columns))
    depth = shot.frame.depth.copy()
    depth[row : row + 6, column : column + 6] = 0
    cloud = segment_hand(with_depth(shot.frame, depth), SETTINGS)
    assert (cloud.mask[row : row + 6, column : column + 6] == 255).all()
    pixels = project(camera_matrix(CAMERA) @ rigid()[:3], cloud.points_m) - (column, row)
    assert not ((pixels > -0.5) & (pixels < 5.5)).all(axis=1).any()


def test_colors_are_those_that_the_color_camera_sees(shot: Shot) -> None:
    T_C_D = rigid([0.0, 0.02, 0.01], [0.015, 0.002, 0.0])
    camera = Intrinsics(320, 240, 300.0, 300.0, 150.0, 130.0)
    columns, rows = np.meshgrid(np.arange(320), np.arange(240))
    image = np.stack([columns % 256, rows % 256, columns // 256], axis=-1).astype(np.uint8)
    frame = shot.frame
    cloud = segment_hand(
        Frame(1, 0, 0, frame.depth, frame.depth_scale_m, CAMERA, image, camera, T_C_D),
        SETTINGS,
    )
    pixels = np.rint(project(camera_matrix(camera) @ T_C_D[:3], cloud.points_m))
    assert cloud.colors is not None
    seen = ((pixels >= 0) & (pixels < (320, 240))).all(axis=1)
    assert seen.any()
    np.testing.assert_array_equal(cloud.colors[seen, 0], pixels[seen, 0] % 256)
    np.testing.assert_array_equal(cloud.colors[seen, 1], pixels[seen, 1] % 256)
    assert not cloud.colors[~seen].any()


def test_settings_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ValueError, match="depth gate"):
        SegmentSettings(depth_min_m=0.7, depth_max_m=0.35)
    for points in (0, 100_000):
        with pytest.raises(ValueError, match="points"):
            SegmentSettings(points=points)


def test_real_hands_before_a_body_are_found(shared_data: Path) -> None:
    folder = shared_data / "rgbd" / "depth_only_sr305" / "20210326-230536"
    camera = Intrinsics(640, 480, 476.007, 476.007, 313.683, 242.755)
    for name in ("30", "50", "70", "90", "110", "130", "150"):
        depth = read_depth(folder / f"{name}.png")
        cloud = segment_hand(Frame(0, 0, 0, depth, 0.000125, camera), SETTINGS)
        assert np.ptp(cloud.points_m, axis=0).max() < 0.26
        assert np.ptp(cloud.points_m[:, 2]) < 0.15
    # Arm and body touch, and the elbow, cut by the border, may as well be a hand.
    depth = read_depth(folder / "170.png")
    with pytest.raises(HandError, match=r"arm and body|told from the arm"):
        segment_hand(Frame(0, 0, 0, depth, 0.000125, camera), SETTINGS)
