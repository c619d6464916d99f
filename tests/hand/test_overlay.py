from __future__ import annotations

from dataclasses import replace

import numpy as np

from handcal.core.geometry import rigid
from handcal.core.types import Frame, Intrinsics, UInt8
from handcal.hand.outline import contour_px
from handcal.hand.segment import segment_hand
from handcal.hand.settings import SegmentSettings

from .conftest import CAMERA, Shot

LENS = (0.1, -0.2, 0.001, -0.002, 0.05)


def black(camera: Intrinsics) -> UInt8:
    return np.zeros((camera.height, camera.width, 3), np.uint8)


def test_the_contour_lies_on_the_mask_s_border(shot: Shot) -> None:
    cloud = segment_hand(shot.frame, SegmentSettings())
    depth_px, color_px = contour_px(cloud, shot.frame)
    assert color_px is None
    columns, rows = np.rint(depth_px).astype(int).T
    np.testing.assert_allclose(depth_px, np.rint(depth_px), atol=1e-3)
    assert (cloud.mask[rows, columns] == 255).all()
    around = np.stack([cloud.mask[rows + dy, columns + dx] for dx, dy in
                       ((-1, 0), (1, 0), (0, -1), (0, 1))])  # fmt: skip
    assert (around == 0).any(axis=0).mean() > 0.99


def test_a_lens_moves_the_contour_back_to_its_pixels(shot: Shot) -> None:
    frame = replace(shot.frame, depth_intrinsics=replace(CAMERA, distortion=LENS))
    depth_px, _ = contour_px(segment_hand(frame, SegmentSettings()), frame)
    np.testing.assert_allclose(depth_px, np.rint(depth_px), atol=0.02)


def test_an_aligned_colour_image_has_it_at_the_same_pixels(shot: Shot) -> None:
    frame = replace(shot.frame, color=black(CAMERA), color_intrinsics=CAMERA)
    depth_px, color_px = contour_px(segment_hand(frame, SegmentSettings()), frame)
    assert color_px is not None
    np.testing.assert_allclose(color_px, depth_px)


def test_a_colour_camera_beside_the_depth_camera_sees_it_shifted(shot: Shot) -> None:
    beside_m = 0.015
    frame = with_color(shot.frame, beside_m)
    cloud = segment_hand(frame, SegmentSettings())
    depth_px, color_px = contour_px(cloud, frame)
    assert color_px is not None
    disparity_px = CAMERA.fx * beside_m / cloud.contour_m[:, 2]
    np.testing.assert_allclose(color_px[:, 0] - depth_px[:, 0], disparity_px, atol=1e-3)
    np.testing.assert_allclose(color_px[:, 1], depth_px[:, 1], atol=1e-3)


def with_color(frame: Frame, beside_m: float) -> Frame:
    T_C_D = rigid(translation_m=[beside_m, 0.0, 0.0])
    return replace(frame, color=black(CAMERA), color_intrinsics=CAMERA, T_C_D=T_C_D)
