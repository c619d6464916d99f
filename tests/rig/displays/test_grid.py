import numpy as np
import pytest

from handcal.rig.boards.board import BoardError
from handcal.rig.displays.grid import Grid, draw_grid, find_grid

GRID = Grid(660, 370, square_px=50)


def test_corners_are_found_where_they_are_drawn() -> None:
    view = find_grid(draw_grid(GRID), GRID)
    columns, rows = GRID.squares
    assert (columns, rows) == (13, 7)
    assert len(view.pixels) == (columns - 1) * (rows - 1)
    np.testing.assert_allclose(view.display_px, view.pixels, atol=0.02)
    # The grid's first inner corner lies between pixels, one square from the grid's edge.
    np.testing.assert_allclose(view.display_px[0], [5 + 50 - 0.5, 10 + 50 - 0.5])


def test_a_part_of_the_grid_tells_where_it_belongs() -> None:
    image = draw_grid(GRID)
    view = find_grid(np.ascontiguousarray(image[100:, 300:]), GRID)
    shift_px = view.display_px - view.pixels
    np.testing.assert_allclose(shift_px, np.tile([300.0, 100.0], (len(shift_px), 1)), atol=0.3)


def test_a_dark_display_is_refused() -> None:
    with pytest.raises(BoardError):
        find_grid(np.zeros((360, 640), np.uint8), GRID)


@pytest.mark.parametrize(
    ("size", "square_px", "problem"),
    [
        ((640, 360), 130, "no room for 3 squares"),
        ((640, 360), 19, "20 to 2000 pixels"),
        ((10**6, 360), 80, "at most 16384"),
    ],
)
def test_an_impossible_grid_is_refused(size: tuple[int, int], square_px: int, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        Grid(*size, square_px)
