import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from handcal.core.geometry import (
    camera_matrix,
    interpolate_pose,
    invert,
    is_rigid,
    project,
    rigid,
    rotation_matrix,
    rotation_vector,
    transform,
)
from handcal.core.types import Float64, Intrinsics

COORDINATE = st.floats(-3, 3, allow_subnormal=False)
VECTORS = st.tuples(COORDINATE, COORDINATE, COORDINATE)
TRANSFORMS = st.builds(rigid, VECTORS, VECTORS)
POINTS = np.random.default_rng(0).normal(size=(7, 3))


def close(A: Float64, B: Float64) -> bool:
    return np.allclose(A, B, rtol=0, atol=1e-12)


@given(TRANSFORMS)
def test_inverse_undoes_and_is_an_involution(T: Float64) -> None:
    assert close(invert(T) @ T, np.eye(4))
    assert close(T @ invert(T), np.eye(4))
    assert close(invert(invert(T)), T)


def test_rigid_takes_a_vector_or_a_matrix() -> None:
    # A quarter turn about z takes x to y.
    T = rigid([0.0, 0.0, np.pi / 2], [1.0, 2.0, 3.0])
    assert close(transform(T, [[1.0, 0.0, 0.0]]), np.array([[1.0, 3.0, 3.0]]))
    assert close(rigid(T[:3, :3], T[:3, 3]), T)
    assert close(rigid(), np.eye(4))


@given(VECTORS)
def test_a_rotation_vector_and_its_matrix_are_scipys(rotation_rad: tuple[float, ...]) -> None:
    # Below half a turn; shorter ones to where both are the identity.
    for scale in (0.5, 1e-5, 1e-12):
        vector = scale * np.array(rotation_rad)
        matrix = rotation_matrix(vector)
        assert close(matrix, Rotation.from_rotvec(vector).as_matrix())
        np.testing.assert_allclose(rotation_vector(matrix), vector, rtol=1e-9, atol=1e-15)


def test_project_by_hand() -> None:
    # u = 100 · 0.2/0.5 + 50 = 90, v = 200 · (-0.1)/0.5 + 60 = 20
    K = camera_matrix(Intrinsics(100, 120, 100.0, 200.0, 50.0, 60.0))
    P = K @ np.eye(3, 4)
    assert close(project(P, [[0.2, -0.1, 0.5]]), np.array([[90.0, 20.0]]))


def test_project_gives_nan_on_and_behind_the_principal_plane() -> None:
    pixels = project(np.eye(3, 4), [[0.1, 0.1, 0.0], [0.1, 0.1, -1.0], [0.1, 0.1, 1.0]])
    assert np.isnan(pixels).all(axis=1).tolist() == [True, True, False]


@given(TRANSFORMS, TRANSFORMS, st.floats(0, 1))
def test_interpolation_runs_evenly_from_one_pose_to_the_other(
    T_0: Float64, T_1: Float64, fraction: float
) -> None:
    T = interpolate_pose(T_0, T_1, fraction)
    assert close(interpolate_pose(T_0, T_1, 0.0), T_0)
    assert close(interpolate_pose(T_0, T_1, 1.0), T_1)
    assert close(T[:3, 3], (1 - fraction) * T_0[:3, 3] + fraction * T_1[:3, 3])
    whole = Rotation.from_matrix(T_1[:3, :3] @ T_0[:3, :3].T).magnitude()
    part = Rotation.from_matrix(T[:3, :3] @ T_0[:3, :3].T).magnitude()
    assert np.isclose(part, fraction * whole, atol=1e-7)


@pytest.mark.parametrize("fraction", [-0.001, 1.001, np.nan])
def test_poses_are_not_extrapolated(fraction: float) -> None:
    with pytest.raises(ValueError, match="not extrapolated"):
        interpolate_pose(np.eye(4), np.eye(4), fraction)


@given(TRANSFORMS)
def test_a_rigid_transform_is_known_even_through_float32(T: Float64) -> None:
    assert is_rigid(T, 3.1)
    assert is_rigid(T.astype(np.float32).astype(np.float64), 3.1)


@pytest.mark.parametrize(
    ("at", "value"),
    [((0, 0), 1.001), ((0, 0), -1.0), ((1, 2), np.nan), ((1, 2), 1e300), ((3, 0), 1e-9)]
    + [((0, 3), value) for value in (3.0, -3.0, np.nan, np.inf)],
)
def test_anything_else_is_not_rigid(at: tuple[int, int], value: float) -> None:
    T = np.eye(4)
    T[at] = value
    assert not is_rigid(T, 3.0)
