import numpy as np
import pytest

from handcal.core.geometry import invert, rigid
from handcal.sim.hand import make_hand
from handcal.sim.raster import D415, draw_hand
from handcal.sim.render import World, render
from handcal.sim.room import make_room

T_W_D = rigid([-0.2, 0.1, 0.0], [0.05, 0.0, 0.1])
T_W_HAND = T_W_D @ rigid([0.1, 0.1, 0.0], [0.0, 0.02, 0.5])


@pytest.fixture(scope="module")
def world() -> World:
    return World(make_hand(1), make_room(0))


def test_hand_stands_before_the_room(world: World) -> None:
    empty_m, empty_rgb = render(world, T_W_D, None, D415)
    depth_m, rgb = render(world, T_W_D, T_W_HAND, D415)
    image = draw_hand(world.hand, invert(T_W_D) @ T_W_HAND, D415)
    height, width = image.depth_m.shape
    expected_m = empty_m.copy()
    box = expected_m[image.y0 : image.y0 + height, image.x0 : image.x0 + width]
    np.minimum(box, image.depth_m, out=box)
    np.testing.assert_array_equal(depth_m, expected_m)
    on_hand = depth_m < empty_m
    changed = (rgb != empty_rgb).any(axis=2)
    assert changed[on_hand].mean() > 0.97
    # The lens blurs by one pixel around the hand, no farther.
    assert changed[~on_hand].sum() < 0.1 * on_hand.sum()
