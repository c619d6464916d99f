import re
from dataclasses import replace

import numpy as np
import pytest

from handcal.core.geometry import image_points, rigid, transform
from handcal.core.types import Float64, Intrinsics
from handcal.rig.boards.board import Board, BoardView, corners_m
from handcal.rig.boards.views import ViewsError
from handcal.rig.lens.viewpoint import TrackedView, locate_viewpoint

CAMERA = Intrinsics(1280, 720, 1800.0, 1797.0, 644.0, 355.0, (-0.08, 0.05, 0.0004, -0.0003, 0.0))
BOARD = Board()
T_H_C = rigid([0.03, -0.02, 0.05], [-0.032, 0.041, -0.048])


def seen(T_C_B: Float64, rng: np.random.Generator, noise_px: float) -> BoardView:
    points_m = corners_m(BOARD)
    pixels = image_points(transform(T_C_B, points_m), CAMERA)
    pixels = pixels + rng.normal(0.0, noise_px, pixels.shape)
    return BoardView(points_m, pixels, (1280, 720), np.arange(len(points_m)), 1.0)


def tracked_views(
    rng: np.random.Generator, count: int, noise_px: float, sigma_m: float
) -> dict[str, TrackedView]:
    views = {}
    for number in range(count):
        T_C_B = rigid(rng.normal(0.0, 0.3, 3), [*rng.uniform(-0.2, 0.0, 2), rng.uniform(0.5, 1.0)])
        T_H_B = T_H_C @ T_C_B @ rigid(rng.normal(0.0, sigma_m, 3), rng.normal(0.0, sigma_m, 3))
        views[f"{number}.png"] = TrackedView(seen(T_C_B, rng, noise_px), T_H_B)
    return views


def test_without_noise_the_place_is_exact() -> None:
    found = locate_viewpoint(tracked_views(np.random.default_rng(1), 3, 0.0, 0.0), CAMERA)
    np.testing.assert_allclose(found.T_H_C, T_H_C, atol=1e-8)
    assert found.rms_px < 1e-5
    assert found.verdict.name == "good"


def test_the_covariance_covers_wrong_tracked_poses() -> None:
    told_m2, actual_m2 = [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        found = locate_viewpoint(tracked_views(rng, 15, 0.1, 0.0005), CAMERA)
        off_m = found.T_H_C[:3, 3] - T_H_C[:3, 3]
        actual_m2.append(off_m @ off_m)
        told_m2.append(np.trace(found.covariance[3:, 3:]))
    assert np.sqrt(np.mean(actual_m2)) < 0.0015
    assert 0.5 < np.mean(told_m2) / np.mean(actual_m2) < 2.0


@pytest.mark.parametrize("count", [5, 15])
def test_a_wrong_side_of_the_squares_is_named_with_the_right_one(count: int) -> None:
    views = {
        name: replace(one, view=replace(one.view, points_m=1.08 * one.view.points_m))
        for name, one in tracked_views(np.random.default_rng(3), count, 0.1, 0.0003).items()
    }
    verdict = locate_viewpoint(views, CAMERA).verdict
    assert verdict.name == "bad"
    assert re.search(r"that a square is 2(4\.9|5\.[01]) mm, not 27\.0: measure", verdict.reason)


def test_a_mistaken_view_is_named() -> None:
    views = tracked_views(np.random.default_rng(2), 8, 0.1, 0.0)
    wrong = views["3.png"]
    views["3.png"] = TrackedView(wrong.view, wrong.T_H_B @ rigid(None, [0.03, 0.0, 0.0]))
    found = locate_viewpoint(views, CAMERA)
    assert found.verdict.name != "good"
    assert "3.png" in found.verdict.reason


def test_a_camera_that_moved_is_bad() -> None:
    views = tracked_views(np.random.default_rng(3), 6, 0.1, 0.02)
    assert locate_viewpoint(views, CAMERA).verdict.name == "bad"


def test_two_views_are_too_few() -> None:
    with pytest.raises(ViewsError, match="2 views"):
        locate_viewpoint(tracked_views(np.random.default_rng(4), 2, 0.0, 0.0), CAMERA)
