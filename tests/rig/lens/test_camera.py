import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.core.geometry import camera_matrix, rigid
from handcal.core.types import Float64, Intrinsics
from handcal.rig.boards.board import Board
from handcal.rig.boards.views import BoardImage, ViewsError, drop, read_views
from handcal.rig.lens.camera import (
    _FOCAL_WIDTHS,
    _first_camera,
    best_lens,
    calibrate_camera,
    compare_lenses,
    fit_lens,
)
from handcal.rig.lens.lens import Camera, LensModel, predict, to_plane
from handcal.sim.boards import board_poses, board_view

BOARD = Board()
CAMERA = Intrinsics(640, 480, 532.0, 531.0, 325.0, 238.0, (-0.25, 0.08, 0.0008, -0.0005, -0.01))
NOISE_PX = 0.1


def _views(count: int = 15, seed: int = 1, noise_px: float = NOISE_PX) -> tuple[BoardImage, ...]:
    rng = np.random.default_rng(seed)
    poses = board_poses(BOARD, CAMERA, count, rng)
    return tuple(
        BoardImage(f"{number}.png", board_view(BOARD, T, CAMERA, rng, noise_px))
        for number, T in enumerate(poses)
    )


def test_without_noise_the_camera_comes_back() -> None:
    result = calibrate_camera(_views(noise_px=0.0))
    np.testing.assert_allclose(
        camera_matrix(result.pinhole), camera_matrix(CAMERA), atol=0.01, rtol=1e-5
    )
    np.testing.assert_allclose(result.intrinsics.distortion[:4], CAMERA.distortion[:4], atol=1e-3)
    assert result.rms_px < 1e-3
    assert result.verdict.name == "good"
    assert result.arcmin_per_px == pytest.approx(np.degrees(1 / 532.0) * 60, rel=1e-3)


def test_the_covariance_is_as_the_errors_are() -> None:
    errors = []
    for seed in range(8):
        result = calibrate_camera(_views(seed=seed))
        found = result.intrinsics
        off = np.array([found.fx, found.fy, found.cx, found.cy]) - [532.0, 531.0, 325.0, 238.0]
        errors.append(off / result.sigma[:4])
        assert result.rms_px == pytest.approx(NOISE_PX * np.sqrt(2), rel=0.15)
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) < 1.6


def test_the_covariance_is_as_opencv_has_it() -> None:
    views = _views()
    found = [one.found for one in views if one.found]
    *_, deviations, _, _ = cv2.calibrateCameraExtended(
        [seen.points_m.astype(np.float32) for seen in found],
        [seen.pixels.astype(np.float32) for seen in found],
        (640, 480),
        np.eye(3),
        np.zeros(5),
    )
    solved = fit_lens(found, "full")
    assert solved is not None
    assert solved.covariance is not None
    sigma = np.sqrt(np.diag(solved.covariance))
    np.testing.assert_allclose(sigma, np.ravel(deviations)[:9], rtol=0.05)
    # OpenCV takes the board as exact.
    assert (calibrate_camera(views).sigma > 0.999 * sigma).all()


@pytest.mark.parametrize(("lens", "count"), [("none", 0), ("radial", 5), ("rational", 8)])
def test_each_lens_model_solves_its_coefficients(lens: str, count: int) -> None:
    result = calibrate_camera(_views(), lens)  # type: ignore[arg-type]
    assert len(result.intrinsics.distortion) == count
    assert (result.verdict.name == "bad") == (lens == "none")
    if lens == "radial":
        assert result.intrinsics.distortion[2:] == (0.0, 0.0, 0.0)


def test_few_views_are_not_enough() -> None:
    result = calibrate_camera(_views(5))
    assert result.verdict.name == "needs more views"
    assert "5 views, 20 are better" in result.verdict.reason
    with pytest.raises(ViewsError, match="2 of 2 images used, at least 3"):
        calibrate_camera(_views(2))


def test_views_at_one_angle_are_bad() -> None:
    rng = np.random.default_rng(1)
    views = []
    for number in range(12):
        T_C_B = rigid([0.0, 0.0, 0.1 * number], [*rng.uniform(-0.1, 0.0, 2), 0.5])
        views.append(BoardImage(f"{number}", board_view(BOARD, T_C_B, CAMERA, rng, NOISE_PX)))
    result = calibrate_camera(views)
    assert result.verdict.name == "bad"
    assert "one angle" in result.verdict.reason


def test_views_that_are_hardly_tilted_ask_for_more() -> None:
    rng = np.random.default_rng(1)
    views = []
    for number in range(25):
        tilt_rad = rng.uniform(-0.15, 0.15, 2)
        T_C_B = rigid([*tilt_rad, 0.1 * number], [*rng.uniform(-0.1, 0.0, 2), 0.4])
        views.append(BoardImage(f"{number}", board_view(BOARD, T_C_B, CAMERA, rng, 0.002)))
    result = calibrate_camera(views)
    assert result.verdict.name == "needs more views"
    assert "tilt" in result.verdict.reason


def test_a_bad_image_is_named_and_may_be_dropped() -> None:
    views = list(_views())
    spoilt = views[4].found
    assert spoilt is not None
    pixels = spoilt.pixels + np.random.default_rng(1).normal(scale=8.0, size=spoilt.pixels.shape)
    views[4] = BoardImage("4.png", dataclasses.replace(spoilt, pixels=pixels))
    result = calibrate_camera(views)
    assert result.verdict.name == "bad"
    assert result.worst.name == "4.png"
    assert "drop the worst image, 4.png" in result.verdict.reason
    again = calibrate_camera(drop(views, ["4.png"]))
    assert again.verdict.name == "good"
    assert again.dropped == ("4.png",)
    assert "4.png" not in again.residuals_px


@pytest.mark.parametrize(("side", "opencv_px"), [("left", 0.41), ("right", 0.46)])
def test_photographs_fit_better_than_by_plain_opencv(
    shared_data: Path, side: str, opencv_px: float
) -> None:
    files = sorted((shared_data / "boards" / "opencv_stereo").glob(f"{side}*.jpg"))
    board = Board(kind="checkerboard", squares=(10, 7))
    result = calibrate_camera(read_views(files, board))
    assert len(result.residuals_px) == 13
    assert result.rms_px < opencv_px / 2
    assert result.verdict.name == "good"
    assert result.worst.name in result.residuals_px


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
