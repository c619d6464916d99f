import numpy as np
import pytest

from handcal.core.types import Float64, Intrinsics
from handcal.rig.boards.board import Board
from handcal.rig.lens.camera import _FOCAL_WIDTHS, _first_camera, best_lens, compare_lenses
from handcal.rig.lens.lens import Camera, LensModel, predict, to_plane
from handcal.sim.boards import board_poses, board_view

BOARD = Board()
COEFFICIENTS: dict[LensModel, tuple[float, ...]] = {
    "none": (),
    "radial": (-0.25, 0.08, 0.0, 0.0, 0.0),
    "full": (-0.25, 0.08, 0.0008, -0.0005, -0.01),
    "rational": (0.4, -0.1, 0.0008, -0.0005, 0.02, 0.7, -0.05, 0.04),
}


def chosen(lens: LensModel, views: int, seed: int) -> tuple[LensModel, float]:
    """Return the model chosen of a simulated camera, and its error over the image."""
    camera = Intrinsics(640, 480, 532.0, 531.0, 325.0, 238.0, COEFFICIENTS[lens])
    rng = np.random.default_rng(seed)
    poses = board_poses(BOARD, camera, views, rng)
    best = best_lens(compare_lenses([board_view(BOARD, T, camera, rng, 0.13) for T in poses]))
    return best.lens, error_px(best.camera, camera)


def error_px(camera: Camera, true: Camera) -> float:
    """Return the RMS error of distant points over the image, without a small rotation."""
    x, y = np.linspace(27, 612, 12), np.linspace(27, 452, 9)
    pixels = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    rays = np.column_stack([to_plane(pixels, true), np.ones(len(pixels))])
    seen_px, by = predict(rays, np.zeros(6), true)
    off: Float64 = (predict(rays, np.zeros(6), camera)[0] - seen_px).ravel()
    off = off - by[:, :3] @ np.linalg.lstsq(by[:, :3], off, rcond=None)[0]
    return float(np.sqrt(2.0 * np.mean(off**2)))


@pytest.mark.parametrize("number", [1, 3, 6])
def test_the_first_focal_length_is_the_nearest_of_those_tried(number: int) -> None:
    focal_px = float(640 * _FOCAL_WIDTHS[number])
    camera = Intrinsics(640, 480, focal_px, focal_px, 319.5, 239.5)
    rng = np.random.default_rng(number)
    poses = board_poses(BOARD, camera, 6, rng)
    first = _first_camera([board_view(BOARD, T, camera, rng, 0.1) for T in poses], "full")
    assert first is not None
    assert first.fx == pytest.approx(focal_px)


def test_a_lens_without_distortion_is_not_given_any() -> None:
    assert chosen("none", 12, 3)[0] == "none"


def test_coefficients_that_the_views_show_are_used() -> None:
    """Taking models within 5 % as equal left this one at two coefficients."""
    assert chosen("full", 20, 30)[0] in ("full", "rational")


@pytest.mark.campaign
@pytest.mark.parametrize("lens", COEFFICIENTS)
def test_twenty_views_give_a_quarter_of_a_pixel(lens: LensModel) -> None:
    errors_px = [chosen(lens, 20, seed)[1] for seed in range(100, 116)]
    assert np.sqrt(np.mean(np.square(errors_px))) < 0.25
