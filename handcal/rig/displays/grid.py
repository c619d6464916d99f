"""Patterns on a display and what a camera sees of them: the grid, and Gray code.

The grid is a ChArUco board in the display's pixels. The Gray code is stripes of halving width that
name each cell of the display by a binary number in which neighbours differ in one digit (Gray, US
patent 2,632,058, 1953; Sansoni et al., Appl. Opt. 36, 1997). Each pattern is shown with its
inverse, so that brightness does not matter. Unlike the grid's corners, the cells cover the display,
and show if it is a flat virtual screen.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.errors import FileError, HandcalError
from handcal.core.frozen import freeze
from handcal.core.types import Float64, Intrinsics, UInt8
from handcal.io.images import image_named, read_image
from handcal.rig.boards.board import Board, BoardError, BoardView, charuco
from handcal.rig.boards.finder import find_board
from handcal.rig.lens.lens import to_plane
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


STRIPE_PX = 8
"""Width of the narrowest stripe, in pixels of the display."""
_BLOCK = 8  # cells along each side of what becomes one point
_LEAST_LIGHT = 20.0  # of 255, between white and black
_LEAST_CONTRAST = 0.1  # of a pattern against its inverse, in that light
_LEAST_PIXELS = 3  # in a cell
_LEAST_POINTS = 12
_DEGREE = 3
_FIELDS = 6


def gray_patterns(
    width_px: int, height_px: int, stripe_px: int = STRIPE_PX
) -> Iterator[tuple[str, UInt8]]:
    """Yield the patterns to show, (height_px, width_px) uint8, by the names of their images."""
    whole = np.zeros((height_px, width_px), np.uint8)
    yield "white", whole + np.uint8(255)
    yield "black", whole
    for axis, size in (("x", width_px), ("y", height_px)):
        for digit, on in enumerate(_digits(size, stripe_px)):
            stripes = on[None, :] if axis == "x" else on[:, None]
            pattern = np.where(stripes, 255, whole).astype(np.uint8)
            yield f"{axis}-{digit}", pattern
            yield f"{axis}-{digit}-inverse", 255 - pattern


def read_gray_code(
    folder: Path, width_px: int, height_px: int, stripe_px: int = STRIPE_PX
) -> GridView:
    """Read the camera's images of all patterns, named as in `gray_patterns`, and decode them.

    Raises
    ------
    FileError
        If an image is missing or cannot be read.
    BoardError
        If the images are not of one size, or show too little of the display.
    """
    names = [name for name, _ in gray_patterns(width_px, height_px, stripe_px)]
    paths = {name: image_named(folder, name) for name in names}
    missing = [name for name, path in paths.items() if not path.exists()]
    if missing:
        raise FileError(
            f"{folder}: {len(missing)} of {len(names)} images are missing, such as "
            f"{missing[0]}.png: name each as the pattern that it shows"
        )
    images = {name: read_image(path, cv2.IMREAD_GRAYSCALE) for name, path in paths.items()}
    return decode_gray_code(images, width_px, height_px, stripe_px)


def decode_gray_code(
    images: Mapping[str, UInt8], width_px: int, height_px: int, stripe_px: int = STRIPE_PX
) -> GridView:
    """Find the display's pixels in a camera's images of all patterns.

    Each point is the mean of the centroids of 8×8 cells, all of which must be seen.

    Parameters
    ----------
    images : mapping of name to (H, W) uint8
        By the names of `gray_patterns`; grey, by a camera that does not move.
    width_px, height_px : int
        Size of the display.
    stripe_px : int

    Raises
    ------
    BoardError
        If the images are not of one size, or show too little of the display.
    """
    if len({image.shape for image in images.values()}) > 1:
        raise BoardError("the images of the patterns have different sizes")
    light = images["white"].astype(np.float32) - images["black"]
    is_seen = light > _LEAST_LIGHT
    cells: list[NDArray[np.int64]] = []
    counts: list[int] = []
    for axis, size in (("x", width_px), ("y", height_px)):
        binary = np.zeros(light.shape, np.int64)
        before = np.zeros(light.shape, np.bool_)
        for digit in range(len(_digits(size, stripe_px))):
            difference = images[f"{axis}-{digit}"].astype(np.float32)
            difference = difference - images[f"{axis}-{digit}-inverse"]
            is_seen &= np.abs(difference) > _LEAST_CONTRAST * light
            before = before ^ (difference > 0)
            binary = 2 * binary + before
        cells.append(binary)
        counts.append(size // stripe_px)  # whole ones
    columns, rows = counts
    is_seen &= (cells[0] < columns) & (cells[1] < rows)
    y, x = np.nonzero(is_seen)
    index = cells[1][y, x] * columns + cells[0][y, x]
    pixels, sum_x, sum_y = (
        np.bincount(index, weights, columns * rows).reshape(rows, columns)
        for weights in (None, x.astype(np.float64), y.astype(np.float64))
    )
    centres = np.dstack([sum_x, sum_y]) / np.maximum(pixels, 1)[:, :, None]
    found, shown = [], []
    for row in range(0, rows - _BLOCK + 1, _BLOCK):
        for column in range(0, columns - _BLOCK + 1, _BLOCK):
            block = np.s_[row : row + _BLOCK, column : column + _BLOCK]
            if pixels[block].min() >= _LEAST_PIXELS:
                found.append(centres[block].mean(axis=(0, 1)))
                shown.append(stripe_px * np.array([column, row]) + (stripe_px * _BLOCK - 1) / 2)
    if len(found) < _LEAST_POINTS:
        raise BoardError(
            f"{len(found)} parts of the display are seen, at least {_LEAST_POINTS} are needed: "
            "darken the room, focus on the display, and do not move the camera"
        )
    return GridView(np.array(shown), np.array(found), (light.shape[1], light.shape[0]))


def flatness_arcmin(
    seen: GridView, camera: Intrinsics, width_px: int, height_px: int
) -> tuple[float, float]:
    """Return the RMS error of a display as a flat screen, and with a distortion by its pixels.

    Parts of the display in a chequered pattern of 6×6 fields are predicted from the others, by a
    homography, and by that and a polynomial of degree 3 in the display's pixels.

    Parameters
    ----------
    seen : GridView
    camera : Intrinsics
    width_px, height_px : int
        Size of the display.
    """
    rays = to_plane(seen.pixels, camera)
    return held_out_arcmin(seen.display_px / [width_px, height_px], rays)


def held_out_arcmin(display: Float64, rays: Float64, degree: int = _DEGREE) -> tuple[float, float]:
    """Return `flatness_arcmin` of points (N, 2), 0 to 1, and rays (N, 2) at z = 1."""
    field = np.floor(_FIELDS * display).sum(axis=1).astype(int) % 2 == 0
    flat, bent = [], []
    for half in (field, ~field):
        H = cv2.findHomography(display[half], rays[half])[0]
        plane = np.asarray(cv2.perspectiveTransform(display[:, None], H), np.float64)[:, 0]
        terms = _terms(display, degree)
        bend = np.linalg.lstsq(terms[half], (rays - plane)[half], rcond=None)[0]
        flat.append(_arcmin(plane, rays)[~half])
        bent.append(_arcmin(plane + terms @ bend, rays)[~half])
    first, second = (float(np.sqrt(np.mean(np.concatenate(off) ** 2))) for off in (flat, bent))
    return first, second


def _terms(display: Float64, degree: int) -> Float64:
    x, y = (2.0 * display - 1.0).T
    powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
    return np.stack([x**i * y**j for i, j in powers], axis=1)


def _arcmin(a: Float64, b: Float64) -> Float64:
    a, b = (np.column_stack([rays, np.ones(len(rays))]) for rays in (a, b))
    sines = np.linalg.norm(np.cross(a, b), axis=1)
    off: Float64 = 60.0 * np.degrees(np.arctan2(sines, np.sum(a * b, axis=1)))
    return off


def _digits(size_px: int, stripe_px: int) -> list[UInt8]:
    """Return for each digit of the code, coarse to fine, which pixels along an axis are lit."""
    cells = np.arange(size_px) // stripe_px
    count = max(1, int(cells[-1]).bit_length())
    gray = cells ^ (cells >> 1)
    return [((gray >> digit) & 1).astype(np.uint8) for digit in range(count)[::-1]]
