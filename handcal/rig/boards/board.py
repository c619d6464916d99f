"""Flat calibration boards, ChArUco or checkerboard, and their corners as seen in an image."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from handcal.core.errors import HandcalError
from handcal.core.frozen import freeze
from handcal.core.types import Float64

BoardKind: TypeAlias = Literal["charuco", "checkerboard"]
Int64: TypeAlias = NDArray[np.int64]

DICTIONARIES = {name: getattr(cv2.aruco, name) for name in dir(cv2.aruco) if name[:5] == "DICT_"}
MIN_CORNERS = 8
_NEIGHBOURS = 6
"""Minimum number of corners for a view to be used."""


class BoardError(HandcalError):
    """The board was not found in an image; the text says why."""


@dataclass(frozen=True, slots=True)
class Board:
    """A flat calibration board.

    Its frame has the origin at the outer corner of its upper left square, x to the right and y
    down along the print, and z into it. Inner corners are numbered row by row from the upper left.
    """

    kind: BoardKind = "charuco"
    """A ChArUco board may be partly visible, and its orientation is unambiguous. A checkerboard
    must be fully visible. Its orientation is unambiguous if one side has an even and the other an
    odd number of squares; otherwise the most upright orientation is assumed."""
    squares: tuple[int, int] = (10, 7)
    """(int, int); columns and rows of squares, 3 to 40."""
    square_m: float = 0.025
    marker_m: float = 0.016
    """Sides of a square and of a marker."""
    dictionary: str = "DICT_5X5_100"
    """OpenCV's name of the marker dictionary."""
    legacy: bool = False
    """True for a board printed by OpenCV before 4.6: with an even number of rows, it begins with a
    white square."""

    def __post_init__(self) -> None:
        columns, rows = self.squares
        if not (3 <= columns <= 40 and 3 <= rows <= 40):
            raise ValueError(f"a board has 3 to 40 squares along each side, not {columns}×{rows}")
        if not 0.001 <= self.square_m <= 1.0:
            raise ValueError("the side of a square must lie between 1 mm and 1 m")
        if self.kind == "checkerboard":
            return
        if not 0.3 * self.square_m <= self.marker_m <= 0.95 * self.square_m:
            raise ValueError("the markers' side must be 0.3 to 0.95 of the squares' side")
        if self.dictionary not in DICTIONARIES:
            raise ValueError(
                f"unknown dictionary {self.dictionary}; choose one such as DICT_5X5_100"
            )
        markers = len(self.marker_dictionary.bytesList)
        if columns * rows // 2 > markers:
            raise ValueError(
                f"{self.dictionary} has {markers} markers, too few for {columns}×{rows} squares"
            )

    @property
    def marker_dictionary(self) -> cv2.aruco.Dictionary:
        """The marker dictionary named by `dictionary`."""
        return cv2.aruco.getPredefinedDictionary(DICTIONARIES[self.dictionary])

    @property
    def inner(self) -> tuple[int, int]:
        """Columns and rows of inner corners."""
        return self.squares[0] - 1, self.squares[1] - 1


@dataclass(frozen=True, slots=True, eq=False)
class BoardView:
    """The corners of a board seen in one image."""

    points_m: Float64
    """(N, 3); corners in the board's frame; z is 0."""
    pixels: Float64
    """(N, 2); the same corners in the image."""
    size: tuple[int, int]
    """(int, int); width and height of the image."""
    ids: Int64
    """(N,); their numbers on the board, ascending."""
    blur_px: float
    """Blur width of the squares' edges in the image: 1 to 3 in a sharp image."""

    def __post_init__(self) -> None:
        freeze(self, "points_m", np.float64, None, 3)
        freeze(self, "pixels", np.float64, len(self.points_m), 2)
        freeze(self, "ids", np.int64, len(self.points_m))

    def only(self, which: NDArray[np.int64] | NDArray[np.bool_]) -> BoardView:
        """Return the view with some of its corners, by index or mask; itself if these are all."""
        ids = self.ids[which]
        if len(ids) == len(self.ids):
            return self
        return replace(self, points_m=self.points_m[which], pixels=self.pixels[which], ids=ids)

    @property
    def beside(self) -> Int64:
        """The nearest corners of each corner in the image, the nearest first, (N, 6 or fewer)."""
        return _beside(self)


def corners_m(board: Board) -> Float64:
    """Return all inner corners, (N, 3), in the board's frame."""
    columns, rows = board.inner
    row, column = np.divmod(np.arange(columns * rows), columns)
    return board.square_m * np.stack([column + 1.0, row + 1.0, np.zeros(len(row))], axis=1)


def square_m(points_m: Float64) -> float:
    """Return the side of a square of which (N, 3) are corners; unseen ones may be NaN."""
    return float(np.diff(np.unique(points_m[np.isfinite(points_m[:, 0]), 0].round(6))).min())


@lru_cache(maxsize=256)
def _beside(seen: BoardView) -> Int64:
    count = min(_NEIGHBOURS, len(seen.pixels) - 1)
    return np.asarray(cKDTree(seen.pixels).query(seen.pixels, k=count + 1)[1])[:, 1:]


@lru_cache(maxsize=8)
def charuco(board: Board) -> cv2.aruco.CharucoBoard:
    """Return a ChArUco board as OpenCV's own type."""
    made = cv2.aruco.CharucoBoard(
        board.squares, board.square_m, board.marker_m, board.marker_dictionary
    )
    made.setLegacyPattern(board.legacy)
    return made
