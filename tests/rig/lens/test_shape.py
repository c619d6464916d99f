"""Boards that are not as entered, of known shape."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from handcal.core.geometry import image_points, rigid, transform
from handcal.core.types import Float64, Intrinsics
from handcal.rig.boards.board import Board, BoardView, corners_m
from handcal.rig.boards.views import BoardImage, image_files, read_views
from handcal.rig.lens.camera import CameraCalibration, calibrate_camera, fit_lens
from handcal.rig.lens.shape import boards_seen
from handcal.rig.lens.stereo import calibrate_stereo
from handcal.sim.boards import board_poses

BOARD = Board()
CAMERA = Intrinsics(640, 480, 520.0, 521.0, 322.0, 236.0, (0.05, -0.1, 0.001, -0.0005, 0.02))
NOISE_PX = 0.05
T_H_D = rigid([0.02, -0.01, 0.03], [0.06, 0.002, -0.01])
Shape = Callable[[Float64, Float64], tuple[Float64, Float64, Float64]]
"""From places on the board, -1 to 1, to by how much its corners are off, mm."""

SHAPES: dict[str, tuple[Shape, str]] = {
    "bent": (lambda u, v: (0 * u, 0 * u, 2.0 * (1 - u * u)), "bent by 2.0 mm over its width"),
    "bent a little": (lambda u, v: (0 * u, 0 * u, 0.5 * (1 - v * v)), "bent by 0.5 mm over its h"),
    "bent much": (lambda u, v: (0 * u, 0 * u, 4.0 * (1 - u * u)), "bent by 4.0 mm over its width"),
    "twisted": (lambda u, v: (0 * u, 0 * u, u * v), "twisted by 1.0 mm at its corners"),
    "wide": (lambda u, v: (0.5 * u, 0 * u, 0 * u), r"printed 0\.[45]\d % wider than high: measure"),
    "high": (lambda u, v: (0 * u, 0.625 * v, 0 * u), r"printed (0\.9|1\.0)\d % higher than wide"),
    "row": (lambda u, v: (0 * u, (np.abs(v + 0.2) < 0.01) / 2, 0 * u), "a row of corners is off"),
    "uneven": (
        lambda u, v: (0 * u, 0 * u, 0.8 * np.exp(-((u - 0.4) ** 2 + (v + 0.3) ** 2) / 0.1)),
        "uneven: single corners are off by 0",
    ),
}


def real_board(shape: Shape | None) -> Float64:
    points_m = corners_m(BOARD)
    middle_m = (points_m[0] + points_m[-1]) / 2
    u, v = ((points_m - middle_m)[:, :2] / (points_m[-1] - middle_m)[:2]).T
    return points_m if shape is None else points_m + 1e-3 * np.column_stack(shape(u, v))


def view_of(real_m: Float64, T_C_B: Float64, rng: np.random.Generator) -> BoardView:
    pixels = image_points(transform(T_C_B, real_m), CAMERA)
    pixels += rng.normal(0.0, NOISE_PX, pixels.shape)
    inside = ((pixels > 2) & (pixels < [637, 477])).all(axis=1)
    ids = np.flatnonzero(inside)
    return BoardView(corners_m(BOARD)[ids], pixels[ids], (640, 480), ids, 2.0)


def views_of(shape: Shape | None, seed: int, count: int = 16) -> list[BoardImage]:
    rng = np.random.default_rng(seed)
    poses = board_poses(BOARD, CAMERA, count, rng)
    real_m = real_board(shape)
    return [BoardImage(str(n), view_of(real_m, T, rng)) for n, T in enumerate(poses)]


def off_sigmas(result: CameraCalibration, true: Intrinsics) -> Float64:
    found = result.intrinsics
    off = [found.fx - true.fx, found.fy - true.fy, found.cx - true.cx, found.cy - true.cy]
    return np.abs(off) / result.sigma[:4]


@pytest.mark.parametrize("kind", SHAPES)
def test_a_board_that_is_not_as_entered_is_solved_and_named(kind: str) -> None:
    shape, words = SHAPES[kind]
    largest = []
    for seed in range(3):
        result = calibrate_camera(views_of(shape, seed))
        assert pytest.approx(NOISE_PX * np.sqrt(2), rel=0.15) == result.rms_px
        assert result.sigma[0] < 0.6
        largest.append(off_sigmas(result, CAMERA).max())
        assert result.verdict.name == "good"
        assert f"the board is not as entered: {result.board.words}" in result.verdict.reason
        assert re.search(words, result.board.words), result.board.words
    assert max(largest) < 3.5


def test_a_flat_board_stays_as_it_is_with_its_shape_in_the_uncertainty() -> None:
    for seed in range(4):
        views = views_of(None, seed)
        result = calibrate_camera(views)
        flat = fit_lens([view.found for view in views if view.found], "full")
        assert result.board.words == ""
        assert flat is not None
        assert flat.covariance is not None
        assert result.intrinsics == flat.camera
        assert (result.sigma[:2] > 1.01 * np.sqrt(np.diag(flat.covariance))[:2]).all()


def test_a_board_seen_by_a_known_camera_has_its_real_corners() -> None:
    named = {view.name: view.found for view in views_of(SHAPES["bent"][0], 1) if view.found}
    seen, board = boards_seen(named, CAMERA)
    assert board.words.startswith("bent by 2.0 mm")
    whole = max(seen.values(), key=lambda one: len(one.ids))
    true_mm = 1e3 * real_board(SHAPES["bent"][0])[whole.ids, 2]
    found_mm = 1e3 * whole.points_m[:, 2]
    np.testing.assert_allclose(found_mm - found_mm.mean(), true_mm - true_mm.mean(), atol=0.1)


def test_the_pose_between_cameras_is_found_with_a_bent_board() -> None:
    rng = np.random.default_rng(5)
    real_m = real_board(SHAPES["bent"][0])
    pairs = [
        (
            BoardImage(f"{n}.png", view_of(real_m, T, rng)),
            BoardImage(f"{n}.png", view_of(real_m, T_H_D @ T, rng)),
        )
        for n, T in enumerate(board_poses(BOARD, CAMERA, 14, rng, others=((T_H_D, CAMERA),)))
    ]
    result = calibrate_stereo(pairs, CAMERA, CAMERA)
    assert result.covariance is not None
    off_m = result.T_H_D[:3, 3] - T_H_D[:3, 3]
    assert (np.abs(off_m) < 3.5 * np.sqrt(np.diag(result.covariance))[3:]).all()
    assert result.verdict.name == "good"
    assert "if a square is exactly 25.00 mm (1 % more is 0.6 mm more)" in result.verdict.reason
    assert "bent by 2.0 mm over its width" in result.verdict.reason


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("flat", ""),
        ("bent_2mm", "bent by 1.0 mm over its width of 180 mm"),  # 2 mm over the sheet's 260 mm
        ("printed_half_percent_wide", "printed 0.49 % wider than high: measure both sides"),
    ],
)
def test_images_of_boards_as_in_the_field(shared_data: Path, name: str, words: str) -> None:
    folder = shared_data / "field" / "bent_board" / name
    if not folder.exists():
        pytest.skip(f"{folder} is absent")
    board = Board(kind="checkerboard", squares=(11, 8), square_m=0.02)
    views = read_views(image_files([folder]), board)
    result = calibrate_camera(views, "auto")
    true = Intrinsics(640, 400, 450.0, 450.0, 322.5, 197.5)
    assert off_sigmas(result, true).max() < 3.0
    assert result.sigma[:2].max() < 0.1
    assert (result.board.words, result.verdict.name) == (words, "good")
