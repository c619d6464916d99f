from dataclasses import replace

import numpy as np
import pytest

from handcal.core.geometry import camera_matrix, image_points, project, rigid
from handcal.core.types import Intrinsics
from handcal.rig.displays.homography import RotationWarp, rotation_homography

CAMERA = Intrinsics(320, 240, 300.0, 302.0, 158.0, 121.0, (-0.1, 0.02, 0.001, -0.001, 0.0))
R_S_C = rigid([0.03, -0.04, 0.08])[:3, :3]
DIRECTIONS = np.array([[0.1, 0.05, 1.0], [-0.2, -0.1, 1.0], [0.0, 0.2, 1.0]])


def test_the_homography_takes_a_direction_to_where_the_turned_camera_sees_it() -> None:
    K = camera_matrix(CAMERA)
    seen = project(K @ np.eye(3, 4), DIRECTIONS)
    turned = project(K @ np.eye(3, 4), DIRECTIONS @ R_S_C.T)
    mapped = np.column_stack([seen, np.ones(3)]) @ rotation_homography(CAMERA, R_S_C).T
    np.testing.assert_allclose(mapped[:, :2] / mapped[:, 2:], turned, atol=1e-9)


def test_a_frame_is_undistorted_and_turned() -> None:
    warp = RotationWarp(CAMERA, R_S_C)
    y, x = np.indices((240, 320))
    straight = replace(CAMERA, distortion=())
    for direction in DIRECTIONS:
        u, v = image_points(direction[None], CAMERA)[0]
        spot = 200.0 * np.exp(-((x - u) ** 2 + (y - v) ** 2) / 18.0)
        warped = warp.warp(spot.astype(np.uint8)).astype(float)
        found = [float((axis * warped).sum() / warped.sum()) for axis in (x, y)]
        expected = image_points((R_S_C @ direction)[None], straight)[0]
        np.testing.assert_allclose(found, expected, atol=0.2)


def test_a_frame_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match="100×50, the camera 320×240"):
        RotationWarp(CAMERA, R_S_C).warp(np.zeros((50, 100, 3), np.uint8))
