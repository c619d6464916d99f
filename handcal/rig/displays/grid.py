"""The grid that a display shows to the viewpoint camera behind it, and its detection."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handcal.core.errors import HandcalError
from handcal.core.frozen import freeze
from handcal.core.types import Float64, UInt8
from handcal.rig.boards.board import Board, BoardView, charuco
from handcal.rig.boards.finder import find_board
from handcal.rig.plausible import MAX_DEVICE_SIDE_PX

# Boards are described in metres, grids in pixels: any constant scale works.
_BOARD_M = 1e-4
_MARKER_SHARE = 0.7
_SMALLEST_SQUARE_PX, _LARGEST_SQUARE_PX = 20, 2000


@dataclass(frozen=True, slots=True)
class Grid:
    """A ChArUco grid in the middle of a display.

    Any part of it determines position and orientation, so the camera need not see the whole
    display.
    """

    width_px: int
    height_px: int
    """Size of the display."""
    square_px: int = 80
    """Side of a square; the grid has as many squares as fit, at most 40 in each direction. A
    multiple of 10 gives markers whose edges lie between pixels."""
    dictionary: str = "DICT_5X5_1000"
    """OpenCV's name of the marker dictionary."""

    def __post_init__(self) -> None:
        if not _SMALLEST_SQUARE_PX <= self.square_px <= _LARGEST_SQUARE_PX:
            raise ValueError(
                f"a square must be {_SMALLEST_SQUARE_PX} to {_LARGEST_SQUARE_PX} pixels wide"
            )
        if max(self.width_px, self.height_px) > MAX_DEVICE_SIDE_PX:
            raise ValueError(f"a display has at most {MAX_DEVICE_SIDE_PX} pixels along each side")
        if min(self.width_px, self.height_px) < 3 * self.square_px:
            raise ValueError(
                f"the display, {self.width_px}×{self.height_px} pixels, has no room for 3 squares "
                f"of {self.square_px} pixels each way: choose smaller ones"
            )

    @property
    def squares(self) -> tuple[int, int]:
        """Columns and rows of squares."""
        return min(40, self.width_px // self.square_px), min(40, self.height_px // self.square_px)

    @property
    def corner_px(self) -> tuple[int, int]:
        """The upper left pixel of the grid."""
        columns, rows = self.squares
        across, down = columns * self.square_px, rows * self.square_px
        return (self.width_px - across) // 2, (self.height_px - down) // 2

    @property
    def board(self) -> Board:
        """The grid as a board."""
        side_m = _BOARD_M * self.square_px
        return Board("charuco", self.squares, side_m, _MARKER_SHARE * side_m, self.dictionary)


@dataclass(frozen=True, slots=True, eq=False)
class GridView:
    """The corners of a display's grid seen in one image."""

    display_px: Float64
    """(N, 2); corners on the display."""
    pixels: Float64
    """(N, 2); the same corners in the camera's image, with lens distortion."""
    size: tuple[int, int]
    """(int, int); width and height of the image."""

    def __post_init__(self) -> None:
        freeze(self, "display_px", np.float64, None, 2)
        freeze(self, "pixels", np.float64, len(self.display_px), 2)


def grid_on(width_px: int, height_px: int, square_px: int) -> Grid:
    """Return the grid for a display of a size; HandcalError if the display has no room for it."""
    try:
        return Grid(width_px, height_px, square_px)
    except ValueError as error:
        raise HandcalError(str(error)) from error


def draw_grid(grid: Grid) -> UInt8:
    """Return the image for the display to show, pixel for pixel, (height_px, width_px) uint8."""
    image = np.zeros((grid.height_px, grid.width_px), dtype=np.uint8)
    columns, rows = grid.squares
    x, y = grid.corner_px
    size = columns * grid.square_px, rows * grid.square_px
    image[y : y + size[1], x : x + size[0]] = charuco(grid.board).generateImage(size)
    return image


def find_grid(image: UInt8, grid: Grid) -> GridView:
    """Find the grid's corners in the viewpoint camera's image, (H, W) or (H, W, 3) uint8.

    Raises
    ------
    BoardError
        If too few are seen; the text says why.
    """
    return on_display(find_board(image, grid.board), grid)


def on_display(found: BoardView, grid: Grid) -> GridView:
    """Return the corners found of `grid.board` as corners on the display."""
    # A board begins at the outer edge of its first pixel, half a pixel before the centre.
    display_px = found.points_m[:, :2] / _BOARD_M + np.array(grid.corner_px) - 0.5
    return GridView(display_px, found.pixels, found.size)
