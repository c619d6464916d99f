"""A board to print or show: as an image for a screen, or to scale on paper."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike

from handcal.core.types import Float64, UInt8
from handcal.io.images import MAX_SIDE_PX
from handcal.rig.boards.board import Board, charuco
from handcal.rig.boards.print_page import Paper, write_page


def draw_board(board: Board, square_px: int, margin_squares: float = 1.0) -> UInt8:
    """Return the board as a grey image (H, W) with a white margin.

    Parameters
    ----------
    board : Board
    square_px : int
        Side of a square.
    margin_squares : float
        Width of the margin in squares; detection needs one.

    Raises
    ------
    ValueError
        If a side of the image would be more than `MAX_SIDE_PX`.
    """
    margin_px = round(margin_squares * square_px)
    width, height = (count * square_px + 2 * margin_px for count in board.squares)
    if square_px < 1 or max(width, height) > MAX_SIDE_PX:
        raise ValueError(f"an image of the board may have sides of 1 to {MAX_SIDE_PX} pixels")
    image = np.full((height, width), 255, np.uint8)
    edges = black_rectangles_m(board) / board.square_m * square_px + margin_px
    for left, top, right, bottom in np.rint(edges).astype(int):
        image[top:bottom, left:right] = 0
    return image


def write_board_pdf(path: Path, board: Board, paper: Paper = "a4") -> None:
    """Write the board as a PDF page at its true size, with a ruler to check the print with.

    Raises
    ------
    ValueError
        If the board does not fit on the paper.
    FileError
        If `path` does not end in ``.pdf``, or cannot be written.
    """
    size_m = np.array(board.squares) * board.square_m
    write_page(path, size_m, black_rectangles_m(board), _caption(board), paper)


def black_rectangles_m(board: Board) -> Float64:
    """Return the black rectangles of the board: (N, 4) left, top, right, bottom in its frame."""
    columns, rows = board.squares
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(columns), np.arange(rows)))
    # An older OpenCV began with a white square if the rows are even.
    is_black = (x + y + (board.legacy and rows % 2 == 0)) % 2 == 0
    starts = np.stack([x, y], axis=1)[is_black] * board.square_m
    squares = np.hstack([starts, starts + board.square_m])
    return np.vstack([squares, _marker_cells(board)]) if board.kind == "charuco" else squares


def _marker_cells(board: Board) -> Float64:
    """Return the black cells of all markers."""
    made = charuco(board)
    return np.vstack(
        [
            marker_cells_m(board.marker_dictionary, int(marker), corners[0, :2], board.marker_m)
            for marker, corners in zip(
                made.getIds(), np.reshape(made.getObjPoints(), (-1, 4, 3)), strict=True
            )
        ]
    )


def marker_cells_m(
    dictionary: cv2.aruco.Dictionary, marker: int, corner_m: ArrayLike, side_m: float
) -> Float64:
    """Return a marker's black cells, adjacent ones merged: (N, 4) left, top, right, bottom.

    Parameters
    ----------
    dictionary : cv2.aruco.Dictionary
    marker : int
    corner_m : (2,) array_like
        Its upper left corner.
    side_m : float
    """
    across = dictionary.markerSize + 2
    bits = cv2.aruco.generateImageMarker(dictionary, marker, across)
    cells = []
    for row, line in enumerate(bits):
        # Start and end of each black run: gaps between separate cells would be visible in print.
        ends = np.flatnonzero(np.diff(np.concatenate([[255], line, [255]]).astype(int)))
        cells += [[start, row, end, row + 1] for start, end in ends.reshape(-1, 2)]
    return np.tile(corner_m, 2) + np.array(cells) * side_m / across


def _caption(board: Board) -> str:
    """Return the caption below the board."""
    columns, rows = board.squares
    text = f"{board.kind} {columns}x{rows}, square {1e3 * board.square_m:g} mm"
    if board.kind == "charuco":
        text += f", marker {1e3 * board.marker_m:g} mm, {board.dictionary}"
        text += ", legacy" if board.legacy else ""
    return text
