"""Views of a part of a depth image, and surfaces that end where the depth jumps."""

from __future__ import annotations

import cv2
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from handcal.core.geometry import camera_matrix
from handcal.core.types import Frame, Intrinsics, UInt16
from handcal.hand.view import (
    between,
    crop_view,
    deproject,
    goes_on,
    on_border,
    pixels_of,
    solid_surface,
    view_depth,
)

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


DEPTHS = arrays(np.uint16, (7, 8), elements=st.sampled_from([0, 1, 490, 500, 505, 520, 900, 65535]))


@given(DEPTHS, st.integers(1, 100))
def test_neighbours_on_a_solid_surface_are_never_a_jump_apart(depth: UInt16, jump: int) -> None:
    solid = solid_surface(depth, jump)
    assert not solid[depth == 0].any()
    values = np.where(solid, depth.astype(float), np.nan)
    for above, below in ((values[1:], values[:-1]), (values[:, 1:], values[:, :-1])):
        apart = np.abs(above - below)
        assert (apart[np.isfinite(apart)] <= jump).all()


def test_flying_pixels_are_not_solid_but_the_near_edge_is() -> None:
    depth = np.array([[500, 501, 650, 900, 901, 902]] * 3, np.uint16)
    np.testing.assert_array_equal(
        solid_surface(depth, 20)[1], [True, True, False, False, True, True]
    )


def test_surface_goes_on_beside_and_behind_something_nearer_but_not_before_something_farther() -> (
    None
):
    depth = np.array([[900, 500, 510, 300]] * 3, np.uint16)
    surface, other = np.zeros((3, 4), bool), np.zeros((3, 4), bool)
    surface[:, 1] = True
    for column, expected in ((0, False), (2, True)):
        other[:] = False
        other[:, column] = True
        assert goes_on(surface, other, depth, 20)[:, 1].all() == expected
    surface[:, 2], other[:] = True, False
    other[:, 3] = True
    assert goes_on(surface, other, depth, 20)[:, 2].all()


def test_border_is_one_pixel_wide() -> None:
    assert np.count_nonzero(on_border(np.ones((4, 5), bool))) == 2 * (4 + 5) - 4
