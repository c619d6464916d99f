import numpy as np

from handcal.core.geometry import rigid, transform
from handcal.rig.cube import Cube, CubeFilter, cube_corners_m, face_pose, facing_corners_m

_FRAME_NS = 33_000_000


def test_the_filter_averages_at_rest_and_starts_again_after_a_jump() -> None:
    rng = np.random.default_rng(1)
    filter_ = CubeFilter()
    here, there = rigid([0.1, 0.2, 0.3], [0.0, 0.0, 0.5]), rigid(None, [0.1, 0.0, 0.6])
    off_m, raw_m, rested = [], [], []
    for number in range(60):
        T = here @ rigid(rng.normal(0, 0.002, 3), rng.normal(0, 0.001, 3))
        found = filter_.take(T, number * _FRAME_NS)
        rested.append(found.is_at_rest)
        if number > 30:
            off_m.append(np.linalg.norm(found.T_W_T[:3, 3] - here[:3, 3]))
            raw_m.append(np.linalg.norm(T[:3, 3] - here[:3, 3]))
    assert not any(rested[:18])
    assert all(rested[25:])
    assert np.mean(off_m) < 0.5 * np.mean(raw_m)
    moved = filter_.take(there, 60 * _FRAME_NS)
    assert not moved.is_at_rest
    assert moved.frames == 1
    np.testing.assert_allclose(moved.T_W_T, there)


def test_a_cube_in_slow_motion_is_not_at_rest() -> None:
    filter_ = CubeFilter()
    poses = (rigid(None, [0.002 * number, 0.0, 0.5]) for number in range(60))
    assert not any(filter_.take(T, n * _FRAME_NS).is_at_rest for n, T in enumerate(poses))


def test_a_cube_is_at_rest_again_after_the_camera_has_restarted() -> None:
    filter_, T = CubeFilter(), rigid(None, [0.0, 0.0, 0.5])
    before = [filter_.take(T, n * _FRAME_NS + 10**12) for n in range(40)]
    after = [filter_.take(T, n * _FRAME_NS) for n in range(40)]
    assert before[-1].is_at_rest
    assert not after[0].is_at_rest
    assert after[-1].is_at_rest


def test_the_cubes_faces_are_in_order() -> None:
    cube = Cube()
    corners_m = cube_corners_m(cube)
    np.testing.assert_allclose(np.abs(corners_m), 0.5 * cube.side_m)
    np.testing.assert_allclose(corners_m[4:] - corners_m[:4], [[0.0, 0.0, cube.side_m]] * 4)
    straight = rigid(None, [0.0, 0.0, 0.5])
    np.testing.assert_allclose(facing_corners_m(cube, straight), corners_m[:4])
    turned = rigid([0.0, 1.2, 0.0], [0.0, 0.0, 0.5])
    face_m = transform(turned, facing_corners_m(cube, turned))
    nearest_m = min((turned @ face_pose(cube, marker))[2, 3] for marker in cube.ids)
    np.testing.assert_allclose(face_m[:, 2].mean(), nearest_m)
