import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from handcal.core.conventions import (
    opengl_projection,
    opengl_transform,
    openxr_view,
    pose,
    unity_camera,
)
from handcal.core.display import projection_matrix, update_matrix
from handcal.core.geometry import invert, project, rigid, transform
from handcal.core.types import EYES, Eye, Float64, Projection
from handcal.rig.example import example_rig
from tests.helpers import unity_transform

WIDTH_PX, HEIGHT_PX = 200, 100
HALF = np.sqrt(0.5)  # sine and cosine of 45°
QUARTER = np.pi / 2

SHIFTS = st.tuples(*[st.floats(-0.02, 0.02)] * 3)
VECTORS = st.tuples(*[st.floats(-2, 2)] * 3)
POSES = st.builds(rigid, VECTORS, VECTORS)
POINTS_V_M = np.random.default_rng(0).uniform([-0.1, -0.06, 0.3], [0.1, 0.06, 2.0], (20, 3))


def simple_projection(
    cx: float = 99.5, cy: float = 49.5, shift_m: tuple[float, ...] = (0.0, 0.0, 0.0)
) -> Projection:
    K = np.array([[100.0, 0.0, cx], [0.0, 100.0, cy], [0.0, 0.0, 1.0]])
    return Projection("left", K @ update_matrix(shift_m, 2.0)[:3], WIDTH_PX, HEIGHT_PX)


def example_projection(eye: Eye, shift_m: tuple[float, ...]) -> Projection:
    display = example_rig().eyes[eye]
    P = projection_matrix(display, shift_m)
    return Projection(eye, P, display.width_px, display.height_px)


def pixels_from_clip(clip: Float64, projection: Projection) -> Float64:
    ndc = clip[:, :3] / clip[:, 3:]
    return np.stack(
        [
            (ndc[:, 0] + 1) / 2 * projection.width_px - 0.5,
            (1 - ndc[:, 1]) / 2 * projection.height_px - 0.5,
        ],
        axis=1,
    )


def homogeneous(points: Float64) -> Float64:
    return np.column_stack([points, np.ones(len(points))])


def test_opengl_projection_of_a_moved_eye_by_hand() -> None:
    # φ = (0.01, -0.02, 0.03), φ4 = 0.5, so a = 1 - 0.03·0.5 = 0.985 and
    # UQ = [a 0 0.005 -0.01; 0 a -0.01 0.02; 0 0 1 -0.03]. On the axis, x_clip is its first row,
    # y_clip -2 times its second, w its third, z_clip 2w - 3; then y and z change sign.
    M = opengl_projection(simple_projection(shift_m=(0.01, -0.02, 0.03)), 1.0, 3.0)
    expected = [
        [0.985, 0, -0.005, -0.01],
        [0, 1.97, -0.02, -0.04],
        [0, 0, -2, -3.06],
        [0, 0, -1, -0.03],
    ]
    np.testing.assert_allclose(M, expected, atol=1e-15)


@given(SHIFTS)
def test_update_matrix_in_opengl_axes(shift: tuple[float, float, float]) -> None:
    phi_1, phi_2, phi_3 = shift
    phi_4 = 0.5
    a = 1 - phi_3 * phi_4
    expected = np.array(
        [
            [a, 0, -phi_1 * phi_4, -phi_1],
            [0, a, phi_2 * phi_4, phi_2],
            [0, 0, 1, phi_3],
            [0, 0, 0, 1],
        ]
    )
    np.testing.assert_allclose(opengl_transform(update_matrix(shift, 2.0)), expected, atol=1e-15)


@given(st.sampled_from(EYES), SHIFTS)
def test_opengl_draws_every_point_on_the_pixel_of_p(eye: Eye, shift_m: tuple[float, ...]) -> None:
    projection = example_projection(eye, shift_m)
    M = opengl_projection(projection, 0.1, 10.0)
    points_GL = POINTS_V_M * [1, -1, -1]
    pixels = pixels_from_clip(homogeneous(points_GL) @ M.T, projection)
    np.testing.assert_allclose(pixels, project(projection.P, POINTS_V_M), atol=1e-8)


def test_opengl_depth_runs_from_near_to_far_and_ignores_the_scale_of_p() -> None:
    projection = example_projection("left", (0.0, 0.0, 0.0))
    eye_z_m = -projection.P[2, 3]
    M = opengl_projection(projection, 0.2, 5.0)
    ends = homogeneous(np.array([[0, 0, -(eye_z_m + 0.2)], [0, 0, -(eye_z_m + 5.0)]])) @ M.T
    np.testing.assert_allclose(ends[:, 2] / ends[:, 3], [-1.0, 1.0])
    doubled = Projection("left", 2 * projection.P, projection.width_px, projection.height_px)
    np.testing.assert_allclose(opengl_projection(doubled, 0.2, 5.0), M)


@pytest.mark.parametrize(("near", "far"), [(0.0, 1.0), (1.0, 1.0), (2.0, 1.0), (0.1, np.inf)])
def test_opengl_projection_refuses_bad_clipping(near: float, far: float) -> None:
    with pytest.raises(ValueError, match="near_m < far_m"):
        opengl_projection(simple_projection(), near, far)


def test_poses_by_hand() -> None:
    # Turning right by 90° about the axis that points down, at 1 m right, 2 m down, 3 m ahead.
    T = rigid([0.0, QUARTER, 0.0], [1.0, 2.0, 3.0])
    # Unity: up is -down; a turn to the right is positive about its y.
    unity = pose(unity_transform(T))
    np.testing.assert_allclose(unity.position_m, [1, -2, 3])
    np.testing.assert_allclose(unity.quaternion_xyzw, [0, HALF, 0, HALF], atol=1e-15)
    # OpenXR: back is -ahead; a turn to the right is negative about its y, which points up.
    openxr = pose(opengl_transform(T))
    np.testing.assert_allclose(openxr.position_m, [1, -2, -3])
    np.testing.assert_allclose(openxr.quaternion_xyzw, [0, -HALF, 0, HALF], atol=1e-15)


@given(POSES, POSES)
def test_conversions_keep_products_and_undo_themselves(A: Float64, B: Float64) -> None:
    for convert in (opengl_transform, unity_transform):
        np.testing.assert_allclose(convert(A) @ convert(B), convert(A @ B), atol=1e-12)
        np.testing.assert_array_equal(convert(convert(A)), A)


@given(st.sampled_from(EYES), SHIFTS, POSES)
def test_unity_draws_every_point_on_the_pixel_of_p(
    eye: Eye, shift_m: tuple[float, ...], T_V_W: Float64
) -> None:
    projection = example_projection(eye, shift_m)
    points_unity = transform(invert(T_V_W), POINTS_V_M) * [1, -1, 1]
    camera = unity_camera(projection, T_V_W, 0.1, 10.0)
    assert camera.projection[3].tolist() == [0.0, 0.0, -1.0, 0.0]  # as of any perspective camera
    M = camera.projection @ camera.view_from_head
    pixels = pixels_from_clip(homogeneous(points_unity) @ M.T, projection)
    np.testing.assert_allclose(pixels, project(projection.P, POINTS_V_M), atol=1e-8)


def test_openxr_angles_by_hand() -> None:
    # f = 100 px; the axis meets the image 150 px from its left, 50 from its right, 25 from its
    # top and 75 from its bottom edge.
    at, fov = openxr_view(simple_projection(cx=149.5, cy=24.5))
    np.testing.assert_allclose(at.position_m, [0, 0, 0], atol=1e-15)
    np.testing.assert_allclose(at.quaternion_xyzw, [0, 0, 0, 1])
    angles = np.tan([fov.left_rad, fov.right_rad, fov.up_rad, fov.down_rad])
    np.testing.assert_allclose(angles, [-1.5, 0.5, 0.25, -0.75])


@given(st.sampled_from(EYES), SHIFTS)
def test_openxr_draws_every_point_on_the_pixel_of_p(eye: Eye, shift_m: tuple[float, ...]) -> None:
    projection = example_projection(eye, shift_m)
    at, fov = openxr_view(projection)
    R = Rotation.from_quat(at.quaternion_xyzw).as_matrix()
    seen = (POINTS_V_M * [1, -1, -1] - at.position_m) @ R
    tangents = seen[:, :2] / -seen[:, 2:]
    left, right, up, down = np.tan([fov.left_rad, fov.right_rad, fov.up_rad, fov.down_rad])
    pixels = np.stack(
        [
            (tangents[:, 0] - left) / (right - left) * projection.width_px - 0.5,
            (up - tangents[:, 1]) / (up - down) * projection.height_px - 0.5,
        ],
        axis=1,
    )
    np.testing.assert_allclose(pixels, project(projection.P, POINTS_V_M), atol=1e-8)


@pytest.mark.parametrize(("row", "column"), [(0, 1), (1, 0), (2, 0), (2, 1)])
def test_openxr_refuses_skew_and_rotation(row: int, column: int) -> None:
    P = simple_projection().P.copy()
    P[row, column] += 0.01
    with pytest.raises(ValueError, match="skew or rotation"):
        openxr_view(Projection("left", P, WIDTH_PX, HEIGHT_PX))
