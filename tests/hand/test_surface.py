"""Surfaces that end where the depth jumps."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from handcal.core.types import UInt16
from handcal.hand.view import goes_on, on_border, solid_surface

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
