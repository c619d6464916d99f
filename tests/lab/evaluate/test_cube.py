import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.display import eye_projection
from handcal.core.geometry import image_points, project, rigid, transform
from handcal.core.types import Float64, Intrinsics
from handcal.lab.evaluate.cube_test import CubeMisalignment, compare_cubes
from handcal.rig.cube import Cube, CubeError, marker_corners_m
from handcal.rig.example import example_rig

CUBE = Cube()
CAMERA = Intrinsics(1280, 720, 1800.0, 1797.0, 644.0, 355.0)
DISPLAY = example_rig().eyes["left"]
FACES = [0, 1, 4]
TURNED = rigid([0.5, 0, 0]) @ rigid([0, 0.7, 0])
POSE = rigid(translation_m=[0.01, -0.005, 0.5]) @ TURNED


def by_marker(pixels: Float64) -> dict[int, Float64]:
    return dict(zip(FACES, pixels.reshape(-1, 4, 2), strict=True))


def seen(pose: Float64) -> dict[int, Float64]:
    return by_marker(image_points(transform(pose, marker_corners_m(CUBE, FACES)), CAMERA))


def drawn_and_seen(
    pose: Float64, shift_m: list[float], true_shift_m: list[float]
) -> CubeMisalignment:
    """Compare a cube seen by an eye at one φ with the same drawn with another, without images."""
    points_m = transform(pose, marker_corners_m(CUBE, FACES))
    drawn_px = project(eye_projection(DISPLAY, shift_m), points_m)
    # From the eye's rays through these pixels of the display to the camera in its place.
    homogeneous = np.column_stack([drawn_px, np.ones(len(drawn_px))])
    rays = np.linalg.solve(eye_projection(DISPLAY, true_shift_m)[:, :3], homogeneous.T).T
    real = by_marker(image_points(points_m - true_shift_m, CAMERA))
    return compare_cubes(real, by_marker(image_points(rays, CAMERA)), CUBE, CAMERA)


def test_the_same_cube_is_aligned() -> None:
    found = compare_cubes(seen(POSE), seen(POSE), CUBE, CAMERA)
    assert found.faces == 3
    assert found.depth_m == pytest.approx(0.5)
    for error in (found.offset_m, found.offset_rad, found.along_m, found.rotation_rad):
        np.testing.assert_allclose(error, 0.0, atol=1e-9)


@settings(deadline=None, max_examples=20)
@given(st.tuples(*[st.floats(-0.005, 0.005)] * 2))
def test_a_shift_across_the_line_of_sight_is_that_of_every_corner(aside: tuple[float, ...]) -> None:
    found = compare_cubes(seen(POSE), seen(rigid(translation_m=[*aside, 0.0]) @ POSE), CUBE, CAMERA)
    np.testing.assert_allclose(found.offset_m, np.tile(aside, (12, 1)), atol=1e-7)
    assert found.along_m == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(found.rotation_rad, 0.0, atol=1e-5)


@settings(deadline=None, max_examples=20)
@given(st.tuples(*[st.floats(-0.05, 0.05)] * 3), st.floats(-0.01, 0.01))
def test_a_turn_and_a_shift_along_are_told(turn: tuple[float, ...], along_m: float) -> None:
    moved = POSE.copy()
    moved[:3, :3] = rigid(turn)[:3, :3] @ POSE[:3, :3]
    moved[2, 3] += along_m
    found = compare_cubes(seen(POSE), seen(moved), CUBE, CAMERA)
    np.testing.assert_allclose(found.rotation_rad, turn, atol=1e-6)
    assert found.along_m == pytest.approx(along_m, abs=1e-6)


def test_an_eye_aside_misses_by_what_similar_triangles_say() -> None:
    """Drawn on S at distance z_S, a point at z misses by δ (1 - z / z_S) where the eye is off δ."""
    delta_m = np.array([0.004, -0.003])
    found = drawn_and_seen(POSE, [0.0, 0.0, 0.0], [*delta_m, 0.0])
    depths_m = transform(POSE, marker_corners_m(CUBE, FACES))[:, 2:]
    expected_m = delta_m * (1.0 - depths_m / DISPLAY.z_C0_S_m)
    np.testing.assert_allclose(found.offset_m, expected_m, atol=2e-5)
    # 3 mm of 4 at half a metre: about 20 arcminutes.
    assert found.offset_m[:, 0].mean() == pytest.approx(0.003, abs=0.0001)
    expected_rad = expected_m / depths_m
    np.testing.assert_allclose(found.offset_rad, expected_rad, atol=np.radians(0.5 / 60))


def test_a_true_shift_leaves_nothing() -> None:
    shift_m = [0.004, -0.003, 0.006]
    found = drawn_and_seen(POSE, shift_m, shift_m)
    np.testing.assert_allclose(found.offset_m, 0.0, atol=1e-12)
    assert found.along_m == pytest.approx(0.0, abs=1e-9)


def test_an_eye_nearer_sees_the_cube_farther() -> None:
    found = drawn_and_seen(POSE, [0.0, 0.0, 0.0], [0.0, 0.0, 0.005])
    # z is taken from the size: it grows by δ / z - δ / z_S too little.
    expected_m = 0.005 * (1.0 - 0.5 / DISPLAY.z_C0_S_m)
    assert found.along_m == pytest.approx(expected_m, rel=0.05)


def test_two_faces_must_be_seen_in_both() -> None:
    real, virtual = seen(POSE), seen(POSE)
    del real[0], virtual[1]
    with pytest.raises(CubeError, match="share 1 faces"):
        compare_cubes(real, virtual, CUBE, CAMERA)
