from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.core.display import (
    arcmin_from_px,
    as_shifts,
    effect_at,
    eye_projection,
    projection_matrix,
    update_matrix,
    view_of_eye,
)
from handcal.core.geometry import project, rigid, transform
from handcal.core.types import EyeDisplay, Float64
from handcal.rig.example import example_rig
from tests.helpers import reprojection_error_px

DISPLAY = example_rig().eyes["right"]
SHIFTS = st.tuples(*[st.floats(-0.02, 0.02)] * 3)
POINTS = st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(0.3, 3.0))


def _on_axis(focal_px: float = 2456.0, distance_m: float = 2.0) -> EyeDisplay:
    K = np.array([[focal_px, 0.0, 633.5], [0.0, focal_px, 359.5], [0.0, 0.0, 1.0]])
    return EyeDisplay(K, np.eye(3), np.zeros(3), distance_m, 1268, 720, np.eye(4))


def test_update_matrix_by_hand() -> None:
    # φ4 = 1/2: 1 - 0.03/2 = 0.985, 0.01/2 = 0.005, -0.02/2 = -0.01
    expected: list[list[float]] = [
        [0.985, 0, 0.005, -0.01],
        [0, 0.985, -0.01, 0.02],
        [0, 0, 1, -0.03],
        [0, 0, 0, 1],
    ]
    np.testing.assert_allclose(update_matrix((0.01, -0.02, 0.03), 2.0), expected, atol=1e-15)


@given(SHIFTS, st.floats(0.5, 5.0))
def test_update_matrix_keeps_the_focal_plane_and_takes_the_eye_to_the_origin(
    shift: tuple[float, ...], distance_m: float
) -> None:
    UQ = update_matrix(shift, distance_m)
    on_plane = np.array([[0.1, -0.2, distance_m], [0.0, 0.0, distance_m]])
    moved = transform(UQ, on_plane)
    np.testing.assert_allclose(
        moved[:, :2] / moved[:, 2:], on_plane[:, :2] / distance_m, atol=1e-12
    )
    np.testing.assert_allclose(transform(UQ, [shift])[0], 0.0, atol=1e-15)


@given(SHIFTS, st.floats(0.5, 5.0), POINTS)
def test_the_true_eye_sees_world_and_pixel_on_one_ray(
    shift: tuple[float, float, float], distance_m: float, point: tuple[float, float, float]
) -> None:
    # The ray from the eye at φ through the point meets the focal plane, z = distance from C0, by
    # similar triangles; the display's pixel there is what C0 sees of that place.
    (e_x, e_y, e_z), (p_x, p_y, p_z) = shift, point
    stretch = (distance_m - e_z) / (p_z - e_z)
    x, y = e_x + stretch * (p_x - e_x), e_y + stretch * (p_y - e_y)
    expected = [633.5 + 2456.0 * x / distance_m, 359.5 + 2456.0 * y / distance_m]
    drawn = project(eye_projection(_on_axis(distance_m=distance_m), shift), [point])[0]
    np.testing.assert_allclose(drawn, expected, atol=1e-7)


@given(SHIFTS)
def test_projection_matrix_is_the_product_of_the_paper(shift: tuple[float, ...]) -> None:
    t = np.eye(4)
    t[:3, 3] = DISPLAY.t_C0_V_m
    I_0 = np.eye(3, 4)
    P1 = DISPLAY.K @ DISPLAY.H0 @ I_0 @ update_matrix(shift, DISPLAY.z_C0_S_m) @ t
    np.testing.assert_allclose(projection_matrix(DISPLAY, shift), P1, atol=1e-12)


@given(SHIFTS, POINTS)
def test_rendering_from_v_and_seeing_from_e_agree(
    shift: tuple[float, ...], point: tuple[float, ...]
) -> None:
    T_W_H = rigid([0.1, 0.2, -0.3], [1.0, -2.0, 0.5])
    T_H_V = np.linalg.inv(DISPLAY.T_V_H)
    world_m = transform(T_W_H @ T_H_V, [point])
    seen = project(eye_projection(DISPLAY, shift), transform(view_of_eye(DISPLAY, T_W_H), world_m))
    np.testing.assert_allclose(seen, project(projection_matrix(DISPLAY, shift), [point]), atol=1e-6)


def test_arcminutes_of_the_paper() -> None:
    assert float(arcmin_from_px(_on_axis(), 7.71)) == pytest.approx(10.79, abs=0.005)
    np.testing.assert_allclose(arcmin_from_px(_on_axis(100.0), [0.0, 100.0]), [0.0, 45 * 60])


def test_reprojection_error_by_hand() -> None:
    # The eye 1 mm to the right of where it is thought, a point at 0.5 m, a plane at 2 m: the ray
    # meets the plane 0.001·(1 - 4) m away, 3 mm, which is 2456·0.003/2 px from C0.
    points_m: Float64 = np.array([[0.0, 0.0, 0.5], [0.0, 0.0, 2.0]])
    error_px = reprojection_error_px(_on_axis(), (0, 0, 0), (0.001, 0, 0), points_m)
    np.testing.assert_allclose(error_px, [2456.0 * 0.003 / 2.0, 0.0], atol=1e-9)


@pytest.mark.parametrize(
    ("shift", "distance_m", "message"),
    [
        ((0.0, np.nan, 0.0), 2.0, "three finite numbers"),
        ((0.0, 0.0, np.inf), 2.0, "three finite numbers"),
        ((0.0, 0.0), 2.0, "three finite numbers"),
        ([[0.0, 0.0, 0.0]], 2.0, "three finite numbers"),
        ((0.0, 0.0, 0.0), 0.0, "display_distance_m must be positive, got 0"),
        ((0.0, 0.0, 0.0), -1.0, "display_distance_m must be positive"),
        ((0.0, 0.0, 0.0), np.nan, "display_distance_m must be positive"),
        ((0.0, 0.0, 2.0), 2.0, "on or beyond the display's focal plane"),
    ],
)
def test_update_matrix_refuses(shift: Sequence[float], distance_m: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        update_matrix(shift, distance_m)


@pytest.mark.parametrize(
    ("shift_m", "right_px", "up_px", "size_ratio"),
    [
        # f φ1 (z/z_S - 1)/z = 2456 · 0.001 · (0.25 - 1)/0.5
        ((0.001, 0.0, 0.0), -3.684, 0.0, 1.0),
        ((0.0, 0.001, 0.0), 0.0, 3.684, 1.0),
        # (1 - φ3/z_S) z/(z - φ3) = 0.995 · 0.5/0.49
        ((0.0, 0.0, 0.01), 0.0, 0.0, 0.995 / 0.98),
    ],
)
def test_effect_of_a_shift_by_hand(
    shift_m: tuple[float, float, float], right_px: float, up_px: float, size_ratio: float
) -> None:
    effect = effect_at(_on_axis(), (0.0, 0.0, 0.0), shift_m, 0.5)
    assert effect.right_px == pytest.approx(right_px, abs=1e-9)
    assert effect.up_px == pytest.approx(up_px, abs=1e-9)
    assert effect.size_ratio == pytest.approx(size_ratio)
    arcmin = 60 * np.degrees(np.arctan(np.array([right_px, up_px]) / 2456))
    np.testing.assert_allclose((effect.right_arcmin, effect.up_arcmin), arcmin, atol=1e-9)


def test_shifts_are_read_only_and_in_the_order_of_the_eyes() -> None:
    read = as_shifts({"right": [1, 2, 3], "left": [0, 0, 0]})
    assert list(read) == ["left", "right"]
    np.testing.assert_array_equal(read["right"], [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="read-only"):
        read["right"][0] = 0.0
