from dataclasses import replace

import numpy as np
import pytest

from handcal.core.display import eye_projection
from handcal.core.geometry import image_points, project, rigid, transform
from handcal.core.types import Float64, Intrinsics
from handcal.lab.evaluate.cube_test import CubeMisalignment, compare_cubes
from handcal.rig.cube.cube import Cube, find_cube, marker_corners_m
from handcal.rig.example import example_rig
from handcal.sim.boards import PictureSettings
from handcal.sim.cube import CubePainter, draw_cube
from handcal.sim.viewpoint import photograph_display

CUBE = Cube()
WHOLE = example_rig().eyes["right"]
# Half as fine, that it does not take long.
DISPLAY = replace(WHOLE, K=np.diag([0.5, 0.5, 1.0]) @ WHOLE.K, width_px=634, height_px=360)
CAMERA = Intrinsics(640, 360, 900.0, 900.0, 320.0, 180.0)
PICTURES = PictureSettings(samples=2)
T_E_T = (
    rigid([0.0, 0.0, 0.1], [0.01, -0.005, 0.5]) @ rigid([0.5, 0.0, 0.0]) @ rigid([0.0, -0.7, 0.0])
)
TRUE_M = np.array([0.003, -0.002, 0.002])


@pytest.fixture(scope="module")
def real() -> dict[int, Float64]:
    painter = CubePainter(CUBE, CAMERA, PICTURES)
    image = painter.paint(rigid(translation_m=-TRUE_M) @ T_E_T, np.random.default_rng(1))
    return dict(find_cube(image, CUBE))


def rendered(real: dict[int, Float64], shift_m: Float64) -> CubeMisalignment:
    """Compare the real cube, seen by a camera at the true φ, with one drawn with another."""
    shown = draw_cube(CUBE, DISPLAY, T_E_T, shift_m)
    image = photograph_display(
        shown,
        DISPLAY,
        np.eye(3),
        CAMERA,
        np.random.default_rng(2),
        shift_m=TRUE_M,
        settings=PICTURES,
    )
    return compare_cubes(real, find_cube(image, CUBE), CUBE, CAMERA)


def predicted(shift_m: Float64, markers: list[int]) -> CubeMisalignment:
    """Return the same by geometry alone."""
    points_m = transform(T_E_T, marker_corners_m(CUBE, markers))
    drawn_px = project(eye_projection(DISPLAY, shift_m), points_m)
    homogeneous = np.column_stack([drawn_px, np.ones(len(drawn_px))])
    rays = np.linalg.solve(eye_projection(DISPLAY, TRUE_M)[:, :3], homogeneous.T).T
    real_px, virtual_px = (
        dict(zip(markers, image_points(points, CAMERA).reshape(-1, 4, 2), strict=True))
        for points in (points_m - TRUE_M, rays)
    )
    return compare_cubes(real_px, virtual_px, CUBE, CAMERA)


def test_a_display_drawn_for_the_eye_covers_the_cube(real: dict[int, Float64]) -> None:
    assert list(real) == [0, 3, 4]
    found = rendered(real, TRUE_M)
    assert found.faces == 3
    assert np.linalg.norm(found.offset_m, axis=1).mean() < 0.0001
    assert abs(found.along_m) < 0.001
    assert np.linalg.norm(found.rotation_rad) < np.radians(0.1)


@pytest.mark.parametrize("off_m", [(0.003, 0.0, 0.0), (-0.002, 0.004, -0.005)])
def test_a_wrong_shift_gives_the_error_that_geometry_predicts(
    real: dict[int, Float64], off_m: tuple[float, ...]
) -> None:
    shift_m = TRUE_M + np.array(off_m)
    found, expected = rendered(real, shift_m), predicted(shift_m, list(real))
    np.testing.assert_allclose(found.offset_m, expected.offset_m, atol=0.0002)
    assert found.along_m == pytest.approx(expected.along_m, abs=0.001)
    np.testing.assert_allclose(found.rotation_rad, expected.rotation_rad, atol=np.radians(0.1))


def test_the_display_shows_nothing_beside_the_cube() -> None:
    shown = draw_cube(CUBE, DISPLAY, T_E_T, TRUE_M)
    assert shown.shape == (DISPLAY.height_px, DISPLAY.width_px)
    assert not shown[:20].any()
    assert shown.max() > 200
