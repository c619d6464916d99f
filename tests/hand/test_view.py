"""Views of a part of a depth image."""

from __future__ import annotations

import cv2
import numpy as np

from handcal.core.geometry import camera_matrix
from handcal.core.types import Frame, Intrinsics
from handcal.hand.view import between, crop_view, deproject, pixels_of, view_depth

CAMERA = Intrinsics(64, 48, 60.0, 61.0, 30.0, 25.0, (0.1, -0.05, 0.001, 0.002, 0.01))


def make_frame() -> Frame:
    depth = np.random.default_rng(0).integers(300, 900, (48, 64), np.uint16)
    return Frame(0, 0, 0, depth, 0.001, CAMERA)


def test_points_project_back_to_their_pixels_through_the_lens() -> None:
    frame = make_frame()
    view = view_depth(frame, (10, 6, 50, 40), step_px=3)
    rows, columns = np.indices(view.depth.shape)
    points_m = deproject(view, rows.ravel(), columns.ravel()).T.astype(np.float64)
    pixels, _ = cv2.projectPoints(
        points_m, np.zeros(3), np.zeros(3), camera_matrix(CAMERA), np.array(CAMERA.distortion)
    )
    expected = np.stack([10 + 3 * columns.ravel(), 6 + 3 * rows.ravel()], axis=1)
    np.testing.assert_allclose(pixels.reshape(-1, 2), expected, atol=0.01)
    u, v = expected.T
    np.testing.assert_allclose(points_m[:, 2], frame.depth[v, u] * 0.001, rtol=1e-6)


def test_crop_knows_where_it_lies() -> None:
    view = view_depth(make_frame(), (10, 6, 50, 40), step_px=3)
    mask = np.zeros(view.depth.shape, bool)
    mask[5:8, 4:6] = True
    part, place = crop_view(view, mask, margin=2)
    np.testing.assert_array_equal(part.depth, view.depth[place])
    assert part.box == (10 + 2 * 3, 6 + 3 * 3, 10 + 8 * 3, 6 + 10 * 3)
    whole, _ = crop_view(view, np.ones_like(mask), margin=2)
    assert whole.box == view.box


def test_gate_and_pixels() -> None:
    view = view_depth(make_frame(), (0, 0, 64, 48))
    gated = between(view, 0.35, 0.7)
    np.testing.assert_array_equal(gated, (view.depth >= 350) & (view.depth <= 700))
    np.testing.assert_array_equal(pixels_of(gated), np.nonzero(gated))
