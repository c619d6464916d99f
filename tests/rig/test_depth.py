"""The check of measured depth, on boards whose pose and depth are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handcal.core.geometry import rigid
from handcal.core.types import DepthCheck, DepthEdges, Float64, Frame
from handcal.rig.boards.board import BoardError
from handcal.rig.boards.views import ViewsError
from handcal.rig.depth import (
    MIN_BORDER_VIEWS,
    DepthView,
    border_outside_px,
    depth_view,
    explain_depth,
    fit_depth,
    fit_edges,
)
from handcal.rig.findings import depth_finding
from handcal.sim.boards import BoardPainter
from tests.board_frames import BOARD, COLOR, SENSOR, T_C_D, frames, poses, seen
from tests.fat_hands import beside_truth, fat_hand

MADE = "2026-11-23T02:00:00+00:00"


def check_of(
    seed: int, scale: float = 1.0, offset_m: float = 0.0, square: float = 1.0, count: int = 10
) -> DepthCheck:
    """Return the check of a camera; `square` is the entered over the true side of the squares."""
    rng = np.random.default_rng(seed)
    views = []
    for T_D_B, frame in zip(
        made := poses(count, rng), frames(made, rng, scale, offset_m), strict=True
    ):
        view = seen(T_D_B, rng)
        views.append(depth_view(replace(view, points_m=square * view.points_m), frame))
    return fit_depth(views, MADE)


@pytest.mark.parametrize(
    ("scale", "offset_m"), [(1.0, 0.0), (1.02, 0.0), (1.0, -0.01), (0.98, 0.02)]
)
def test_scale_and_offset_are_found_within_their_uncertainty(scale: float, offset_m: float) -> None:
    check = check_of(1, scale, offset_m)
    assert (check.views, check.made) == (10, MADE)
    sigma = np.sqrt(np.diag(check.covariance))
    assert abs(check.scale - scale) < 3.0 * sigma[0] < 0.01
    assert abs(check.offset_m - offset_m) < 3.0 * sigma[1] < 0.006
    bias_m, sigma_m = check.bias_m(0.5)
    true_m = (scale - 1.0) * 0.5 + offset_m
    assert abs(bias_m - true_m) < 3.0 * sigma_m + 2e-4
    assert sigma_m < 0.001


def test_the_uncertainty_is_that_of_repeated_checks() -> None:
    checks = [check_of(seed) for seed in range(8)]
    off = np.array([check.bias_m(0.5) for check in checks])
    # 8 checks give their scatter to 25 %; a jackknife over 10 views is rather too large.
    ratio = np.sqrt(np.mean(off[:, 0] ** 2)) / np.sqrt(np.mean(off[:, 1] ** 2))
    assert 0.4 < ratio < 1.6


def test_a_good_camera_raises_no_doubt_and_a_bias_of_10_mm_does() -> None:
    for seed in range(2):
        assert depth_finding(check_of(seed)).is_fine
        for offset_m in (-0.01, 0.01):
            check = check_of(seed, offset_m=offset_m)
            assert not depth_finding(check).is_fine
            assert "mm at every distance: check the pose of the depth imager" in explain_depth(
                check
            )


def check_of_a_factory_calibration(seed: int, offset_m: float) -> DepthCheck:
    """Return the check of a camera whose colour calibration has errors, as a factory's has."""
    rng = np.random.default_rng(seed)
    made = poses(10, rng)
    fx, fy = rng.normal(1.0, 0.001, 2) * [COLOR.fx, COLOR.fy]
    cx, cy = rng.normal([COLOR.cx, COLOR.cy], 0.3)
    known = replace(COLOR, fx=fx, fy=fy, cx=cx, cy=cy)
    T = rigid(rng.normal(0.0, 0.0005, 3), rng.normal(0.0, 0.0002, 3)) @ T_C_D
    return fit_depth(
        [
            depth_view(seen(T_D_B, rng), replace(frame, color_intrinsics=known, T_C_D=T))
            for T_D_B, frame in zip(made, frames(made, rng, offset_m=offset_m), strict=True)
        ]
    )


@pytest.mark.campaign
def test_of_100_cameras_none_raises_a_false_alarm_and_each_bias_of_10_mm_is_found() -> None:
    off_m = []
    for seed in range(100):
        for offset_m in (0.0, 0.01 * (-1) ** seed):
            check = check_of_a_factory_calibration(seed, offset_m)
            assert depth_finding(check).is_fine is (offset_m == 0.0), seed
            off_m.append(check.bias_m(0.5)[0] - offset_m)
    assert np.sqrt(np.mean(np.square(off_m))) < 0.0005
    assert np.abs(off_m).max() < 0.0015


def test_a_wrong_square_size_is_distinguished_from_an_offset() -> None:
    check = check_of(3, square=1.04)
    assert check.scale == pytest.approx(1.0 / 1.04, abs=0.005)
    assert "at every distance: measure the squares" in explain_depth(check)
    assert "that a square is 25.0 mm, not 26.0" in explain_depth(check, 0.026)
    assert not depth_finding(check).is_fine


def test_both_errors_are_told_and_none_is_not() -> None:
    assert explain_depth(check_of(4, 0.95, 0.02)).startswith("depth differs by −")
    exact = [DepthView(z, z, 0.001) for z in (0.4, 0.5, 0.6, 0.7, 0.8)]
    assert explain_depth(fit_depth(exact)) == ""


def test_a_wrong_depth_unit_is_named() -> None:
    views = [DepthView(z, 8.0 * z, 0.001) for z in (0.4, 0.5, 0.6, 0.7, 0.8)]
    with pytest.raises(
        ViewsError, match="measured depth is 8 times that of the board: check the s"
    ):
        fit_depth(views)


@pytest.mark.parametrize(
    ("depths_m", "problem"),
    [
        ((0.4, 0.5, 0.6, 0.7), "4 views of the board with depth are too few: 5 are needed"),
        ((0.50, 0.52, 0.55, 0.58, 0.60), r"only at 0\.50 to 0\.60 m: hold it nearer"),
    ],
)
def test_views_that_determine_nothing_are_refused(
    depths_m: tuple[float, ...], problem: str
) -> None:
    with pytest.raises(ViewsError, match=problem):
        fit_depth([DepthView(z, z, 0.001) for z in depths_m])


def test_a_finger_on_the_board_is_left_out() -> None:
    rng = np.random.default_rng(5)
    T_D_B: Float64 = poses(1, rng, 0.5, 0.5)[0]
    (frame,) = frames([T_D_B], rng)
    plain = depth_view(view := seen(T_D_B, rng), frame)
    depth = frame.depth.copy()
    depth[180:200, 300:330] = 4500  # 0.45 m
    finger = depth_view(view, replace(frame, depth=depth))
    assert finger.measured_m == pytest.approx(plain.measured_m, abs=2e-4)
    assert finger.flatness_m == pytest.approx(plain.flatness_m, rel=0.1)


def test_a_board_that_depth_does_not_see_is_refused() -> None:
    rng = np.random.default_rng(6)
    T_D_B: Float64 = poses(1, rng, 0.5, 0.5)[0]
    (frame,) = frames([T_D_B], rng)
    with pytest.raises(BoardError, match="shows too little of the board"):
        depth_view(seen(T_D_B, rng), replace(frame, depth=np.zeros_like(frame.depth)))
    with pytest.raises(ValueError, match="needs colour"):
        depth_view(seen(T_D_B, rng), replace(frame, color=None, color_intrinsics=None))


PAINTER = BoardPainter(BOARD, COLOR)


def frames_of(count: int, fatten_px: int = 0) -> list[tuple[Float64, Frame]]:
    rng = np.random.default_rng(fatten_px)
    made = poses(count, rng)
    sensor = replace(SENSOR, fatten_px=fatten_px)
    return list(zip(made, frames(made, rng, painter=PAINTER, sensor=sensor), strict=True))


def edges_of_boards(fatten_px: int) -> DepthEdges:
    rng = np.random.default_rng(7)
    found = fit_edges(
        [border_outside_px(seen(T_D_B, rng), frame) for T_D_B, frame in frames_of(8, fatten_px)]
    )
    assert found is not None
    return found


@pytest.mark.parametrize("fatten_px", [0, 1, 2, 3])
def test_what_boards_tell_is_true_of_hands(fatten_px: int) -> None:
    edges = edges_of_boards(fatten_px)
    assert (edges.source, edges.views) == ("measured", 8)
    assert 0.3 <= edges.sigma_px < 0.35
    of_hands_px = []
    for seed in range(3):
        cloud, _, hand, T_H_hand = fat_hand(seed, fatten_px)
        of_hands_px.append(beside_truth(cloud, hand, T_H_hand).outside_px)
    assert edges.fatten_px == pytest.approx(np.mean(of_hands_px), abs=edges.sigma_px)


def test_a_shift_between_depth_and_color_is_no_fattening() -> None:
    rng = np.random.default_rng(8)
    ((T_D_B, frame),) = frames_of(1, 2)
    right = border_outside_px(view := seen(T_D_B, rng), frame)
    shifted = replace(frame, depth=np.roll(frame.depth, (1, -1), axis=(0, 1)))
    assert border_outside_px(view, shifted) == pytest.approx(right, abs=0.15)


def test_a_border_that_is_not_seen_is_refused() -> None:
    rng = np.random.default_rng(9)
    ((T_D_B, frame),) = frames_of(1)
    view = seen(T_D_B, rng)
    on_table = np.where(frame.depth > 15_000, np.median(frame.depth[150:210, 280:360]), frame.depth)
    elsewhere = frame.T_C_D @ rigid(None, [0.0, 0.0, 0.1])
    assert frame.color is not None
    for other in (
        replace(frame, color=np.full_like(frame.color, 200)),
        replace(frame, depth=on_table.astype(np.uint16)),
    ):
        with pytest.raises(BoardError, match="the border of its sheet is not seen in both"):
            border_outside_px(view, other)
    for other in (
        replace(frame, depth=np.zeros_like(frame.depth)),
        replace(frame, T_C_D=elsewhere),
    ):
        with pytest.raises(BoardError, match="the depth image shows too little of the board"):
            border_outside_px(view, other)
    with pytest.raises(ValueError, match="needs colour"):
        border_outside_px(view, replace(frame, color=None, color_intrinsics=None))


def test_few_views_are_not_enough() -> None:
    assert fit_edges([1.0] * (MIN_BORDER_VIEWS - 1)) is None
