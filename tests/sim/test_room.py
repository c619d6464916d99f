import numpy as np
import pytest

from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import Float64, Intrinsics
from handcal.sim.room import Room, draw_room, make_room

CAMERA = Intrinsics(width=320, height=180, fx=251.0, fy=240.0, cx=160.5, cy=88.0)


@pytest.fixture(scope="module")
def room() -> Room:
    return make_room(0)


def _points_W(T_W_D: Float64, inverse_depth: Float64) -> Float64:
    v, u = np.indices(inverse_depth.shape)
    rays = np.stack(
        [(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], axis=-1
    )
    return transform(T_W_D, (rays / inverse_depth[..., None]).reshape(-1, 3))


@pytest.mark.parametrize("turn_rad", [(0, 0, 0), (-0.4, 0.7, 0.1), (0.2, 2.5, -0.3), (1.5, 0, 0)])
def test_every_pixel_sees_a_wall_from_inside(room: Room, turn_rad: tuple[float, ...]) -> None:
    T_W_D = rigid(np.array(turn_rad), [0.1, -0.2, 0.15])
    inverse, _ = draw_room(room, T_W_D, CAMERA)
    points_m = _points_W(T_W_D, inverse.astype(np.float64))
    to_walls_m = np.minimum(points_m - room.low_m, room.high_m - points_m)
    np.testing.assert_allclose(to_walls_m.min(axis=1), 0.0, atol=1e-5)


def test_texture_is_fixed_in_the_world(room: Room) -> None:
    """One wall point has one colour from two viewpoints, to interpolation."""
    T_0, T_1 = rigid([0.0, 0.02, 0.0]), rigid([0.03, -0.05, 0.02], [0.05, 0.02, 0.1])
    inverse_0, color_0 = draw_room(room, T_0, CAMERA)
    _, color_1 = draw_room(room, T_1, CAMERA)
    points_D1 = transform(invert(T_1), _points_W(T_0, inverse_0.astype(np.float64)))
    u = np.rint(points_D1[:, 0] / points_D1[:, 2] * CAMERA.fx + CAMERA.cx).astype(int)
    v = np.rint(points_D1[:, 1] / points_D1[:, 2] * CAMERA.fy + CAMERA.cy).astype(int)
    inside = (u >= 0) & (u < CAMERA.width) & (v >= 0) & (v < CAMERA.height)
    assert inside.mean() > 0.5
    before = color_0.reshape(-1, 3)[inside].astype(float)
    after = color_1[v[inside], u[inside]].astype(float)
    assert np.corrcoef(before.ravel(), after.ravel())[0, 1] > 0.9
    assert np.median(np.abs(before - after)) < 8.0
