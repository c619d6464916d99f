"""The display's calibration, from corners with known truth and, once, from a rendered image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handcal.core.display import eye_projection, view_of_eye
from handcal.core.geometry import image_points, invert, project, rigid
from handcal.core.types import EyeDisplay, Float64, Intrinsics
from handcal.rig.boards.views import ViewsError
from handcal.rig.displays.grid import Grid, GridView, draw_grid, find_grid
from handcal.rig.displays.homography import (
    DisplayCalibration,
    DisplaySettings,
    RotationWarp,
    Screen,
    calibrate_display,
    fit_homography,
    pixel_size_m,
)
from handcal.rig.example import FOCAL_PX, Z_E_S_M, example_rig
from handcal.rig.lens.fit import CalibrationVerdict
from handcal.rig.lens.viewpoint import ViewpointPose
from handcal.sim.boards import PictureSettings
from handcal.sim.viewpoint import VIEWPOINT_CAMERA as CAMERA
from handcal.sim.viewpoint import photograph_display

DISPLAY = example_rig().eyes["left"]
SIZE = DISPLAY.width_px, DISPLAY.height_px
SCREEN = Screen(*SIZE, DISPLAY.T_V_H)
PIXEL_M = Z_E_S_M / FOCAL_PX
GOOD = CalibrationVerdict("good", "as told")
R_E_C = rigid([0.05, -0.03, 0.1])[:3, :3]


def seen(display: EyeDisplay, R_E_C: Float64, noise_px: float = 0.0, seed: int = 0) -> GridView:
    """Return the corners of a display's grid that an ideal detector finds."""
    x, y = np.arange(80.0, SIZE[0], 80.0), np.arange(80.0, SIZE[1], 80.0)
    display_px = np.dstack(np.meshgrid(x, y)).reshape(-1, 2)
    homogeneous = np.column_stack([display_px, np.ones(len(display_px))])
    rays = np.linalg.solve(display.K @ display.H0 @ R_E_C, homogeneous.T).T
    pixels = image_points(rays, CAMERA)
    pixels = pixels + np.random.default_rng(seed).normal(0.0, noise_px, pixels.shape)
    return GridView(display_px, pixels, (CAMERA.width, CAMERA.height))


def place(display: EyeDisplay, R_E_C: Float64) -> ViewpointPose:
    """The true place of the camera at C0."""
    T_H_C = invert(view_of_eye(display, np.eye(4))) @ rigid(R_E_C)
    return ViewpointPose(T_H_C, np.diag([1e-8] * 3 + [1e-9, 4e-9, 9e-9]), {"a": 0.1}, 0.1, GOOD)


def calibrate(
    display: EyeDisplay,
    R_E_C: Float64,
    settings: DisplaySettings,
    noise_px: float = 0.0,
    images: int = 2,
) -> DisplayCalibration:
    views = {str(n): seen(display, R_E_C, noise_px, n) for n in range(images)}
    homography = fit_homography(views, CAMERA, *SIZE)
    return calibrate_display(homography, CAMERA, place(display, R_E_C), SCREEN, settings)


@pytest.mark.parametrize("off_axis_m", [[0.0, 0.0, 0.0], [0.004, -0.003, 0.0], [0.0, 0.0, 0.015]])
def test_without_noise_the_display_is_exact(off_axis_m: list[float]) -> None:
    # E on the display's axis, C0 beside or before it.
    H0 = np.linalg.inv(DISPLAY.K) @ eye_projection(replace(DISPLAY, H0=np.eye(3)), off_axis_m)
    H0 = H0[:, :3] / H0[2, 2]
    display = replace(DISPLAY, H0=H0, z_C0_S_m=Z_E_S_M - off_axis_m[2])
    found = calibrate(display, R_E_C, DisplaySettings(pixel_m=PIXEL_M))
    assert found.verdict.name == "good"
    np.testing.assert_allclose(found.R_S_C, R_E_C, atol=1e-6)
    assert found.turn_rad < 1e-6
    assert found.display.z_C0_S_m == pytest.approx(Z_E_S_M - off_axis_m[2], rel=1e-6)
    np.testing.assert_allclose(found.display.t_C0_V_m, display.t_C0_V_m, atol=1e-12)
    np.testing.assert_allclose(found.display.K @ found.display.H0, display.K @ H0, atol=1e-3)
    # The split: K on the display's axis, as long as C0 is far; H0 shifts only.
    np.testing.assert_allclose(found.display.K[:2, 2], [(SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2])
    np.testing.assert_allclose(found.display.H0[:, :2], np.eye(3)[:, :2], atol=1e-6)


def test_a_display_turned_against_v_is_taken_up_by_h0() -> None:
    turn = rigid([0.01, -0.02, 0.005])[:3, :3]
    display = replace(DISPLAY, H0=DISPLAY.H0 @ turn / (DISPLAY.H0 @ turn)[2, 2])
    found = calibrate(display, R_E_C, DisplaySettings(distance_m=2.0))
    assert found.turn_rad == pytest.approx(Rotation.from_matrix(turn).magnitude(), abs=1e-6)
    points_m = np.random.default_rng(1).uniform([-0.1, -0.05, 0.4], [0.1, 0.05, 0.6], (20, 3))
    ours, theirs = (project(eye_projection(one), points_m) for one in (found.display, display))
    np.testing.assert_allclose(ours, theirs, atol=1e-4)


def test_the_homography_knows_how_well_it_is_known() -> None:
    truth = fit_homography({"a": seen(DISPLAY, R_E_C)}, CAMERA, *SIZE).H_C_S
    corner = np.array([0.0, 0.0, 1.0])
    off_px, told_px = [], []
    for seed in range(60):
        found = fit_homography({"a": seen(DISPLAY, R_E_C, 0.3, seed)}, CAMERA, *SIZE)
        back = np.linalg.inv(truth) @ found.H_C_S @ corner
        off_px.append(back[:2] / back[2])
        told_px.append(found.sigma_px)
    actual_px = np.sqrt(np.mean(np.sum(np.square(off_px), axis=1)))
    # The sandwich of a single image is a little small; told is the worst of four corners.
    assert 0.7 * actual_px < np.mean(told_px) < 1.5 * actual_px
    assert found.rms_px == pytest.approx(0.3 * np.sqrt(2.0), rel=0.15)


def test_the_distance_is_as_measured_with_its_uncertainty() -> None:
    settings = DisplaySettings(distance_m=1.95)
    found = calibrate(DISPLAY, R_E_C, settings, noise_px=0.1)
    assert found.display.z_C0_S_m == 1.95
    assert np.sqrt(found.covariance[3, 3]) == pytest.approx(0.0195)
    variances = np.diag(found.covariance)[:3]
    np.testing.assert_allclose(np.sort(variances), [1e-9, 4e-9, 9e-9], rtol=1e-3)


def test_the_size_of_a_pixel_follows_from_the_angle_of_a_grid() -> None:
    # 1000 pixels of 1 mm at 2 m.
    assert pixel_size_m(2.0 * np.arctan(0.25), 1000.0, 2.0) == pytest.approx(0.001)
    with pytest.raises(ValueError, match="positive"):
        pixel_size_m(0.0, 80.0, 2.0)


@pytest.mark.parametrize("settings", [{}, {"distance_m": 2.0, "pixel_m": PIXEL_M}])
def test_the_distance_must_come_from_one_source(settings: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="either"):
        DisplaySettings(**settings)


@pytest.mark.parametrize("settings", [{"distance_m": -2.0}, {"pixel_m": 0.0}])
def test_the_distance_must_be_positive(settings: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        DisplaySettings(**settings)


def test_few_and_noisy_corners_ask_for_more() -> None:
    found = calibrate(DISPLAY, R_E_C, DisplaySettings(distance_m=2.0), noise_px=0.8)
    assert found.verdict.name == "needs more views"


def test_a_camera_that_moved_between_images_is_bad() -> None:
    views = {"a.png": seen(DISPLAY, R_E_C), "b.png": seen(DISPLAY, rigid([0.01, 0, 0])[:3, :3])}
    homography = fit_homography(views, CAMERA, *SIZE)
    found = calibrate_display(
        homography, CAMERA, place(DISPLAY, R_E_C), SCREEN, DisplaySettings(distance_m=2.0)
    )
    assert found.verdict.name == "bad"
    assert "camera moved" in found.verdict.reason


@pytest.mark.parametrize(
    ("T", "problem"),
    [(rigid([0.2, 0.0, 0.0]), "turned by"), (rigid(None, [0.063, 0.0, 0.0]), "63 mm|6[0-9] mm")],
)
def test_poses_of_another_place_are_bad(T: Float64, problem: str) -> None:
    homography = fit_homography({"a": seen(DISPLAY, R_E_C)}, CAMERA, *SIZE)
    true = place(DISPLAY, R_E_C)
    wrong = replace(true, T_H_C=T @ true.T_H_C)
    found = calibrate_display(homography, CAMERA, wrong, SCREEN, DisplaySettings(distance_m=2.0))
    assert found.verdict.name == "bad"
    with pytest.raises(AssertionError, match=problem):
        raise AssertionError(found.verdict.reason)


def test_a_doubtful_place_makes_the_display_doubtful() -> None:
    homography = fit_homography({"a": seen(DISPLAY, R_E_C)}, CAMERA, *SIZE)
    doubtful = replace(
        place(DISPLAY, R_E_C), verdict=CalibrationVerdict("needs more views", "too few")
    )
    found = calibrate_display(homography, CAMERA, doubtful, SCREEN, DisplaySettings(distance_m=2.0))
    assert found.verdict == doubtful.verdict


def test_images_of_another_resolution_are_refused() -> None:
    other = replace(seen(DISPLAY, R_E_C), size=(640, 360))
    with pytest.raises(ViewsError, match=r"b\.png has 640×360"):
        fit_homography({"a.png": seen(DISPLAY, R_E_C), "b.png": other}, CAMERA, *SIZE)
    with pytest.raises(ViewsError, match="no image"):
        fit_homography({}, CAMERA, *SIZE)


def test_a_rendered_display_is_found_to_a_tenth_of_a_pixel() -> None:
    grid = Grid(*SIZE)
    image = photograph_display(
        draw_grid(grid),
        DISPLAY,
        R_E_C,
        CAMERA,
        np.random.default_rng(1),
        settings=PictureSettings(samples=1),
    )
    homography = fit_homography({"a": find_grid(image, grid)}, CAMERA, *SIZE)
    truth = fit_homography({"a": seen(DISPLAY, R_E_C)}, CAMERA, *SIZE)
    corners = np.array([[0.0, 0.0, 1.0], [SIZE[0] - 1.0, SIZE[1] - 1.0, 1.0]])
    back = corners @ (np.linalg.inv(truth.H_C_S) @ homography.H_C_S).T
    np.testing.assert_allclose(back[:, :2] / back[:, 2:], corners[:, :2], atol=0.1)


WARPED = Intrinsics(320, 240, 300.0, 302.0, 158.0, 121.0, (-0.1, 0.02, 0.001, -0.001, 0.0))
R_S_WARPED = rigid([0.03, -0.04, 0.08])[:3, :3]
DIRECTIONS = np.array([[0.1, 0.05, 1.0], [-0.2, -0.1, 1.0], [0.0, 0.2, 1.0]])


def test_a_frame_is_undistorted_and_turned() -> None:
    warp = RotationWarp(WARPED, R_S_WARPED)
    y, x = np.indices((240, 320))
    straight = replace(WARPED, distortion=())
    for direction in DIRECTIONS:
        u, v = image_points(direction[None], WARPED)[0]
        spot = 200.0 * np.exp(-((x - u) ** 2 + (y - v) ** 2) / 18.0)
        warped = warp.warp(spot.astype(np.uint8)).astype(float)
        found = [float((axis * warped).sum() / warped.sum()) for axis in (x, y)]
        expected = image_points((R_S_WARPED @ direction)[None], straight)[0]
        np.testing.assert_allclose(found, expected, atol=0.2)


def test_a_frame_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match="100×50, the camera 320×240"):
        RotationWarp(WARPED, R_S_WARPED).warp(np.zeros((50, 100, 3), np.uint8))
