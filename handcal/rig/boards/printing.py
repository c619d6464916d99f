"""A board to print or show: as an image for a screen, or to scale on paper, with a ruler."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import ArrayLike

from handcal.core.types import Float64, UInt8
from handcal.io.files import require_suffix, write_atomic
from handcal.io.images import MAX_SIDE_PX
from handcal.rig.boards.board import Board, charuco

Paper: TypeAlias = Literal["a4", "a3", "a2", "a1", "a0", "letter", "tabloid"]
# Width and height in metres, upright.
PAPERS: dict[Paper, tuple[float, float]] = {
    "a4": (0.210, 0.297),
    "a3": (0.297, 0.420),
    "a2": (0.420, 0.594),
    "a1": (0.594, 0.841),
    "a0": (0.841, 1.189),
    "letter": (0.2159, 0.2794),
    "tabloid": (0.2794, 0.4318),
}
_INCH_M = 0.0254
_EDGE_M = 0.005  # margin outside the printable area
_RULER_M, _CAPTION_M = 0.1, 0.012


def write_page(
    path: Path, size_m: Float64, rectangles_m: Float64, caption: str, paper: Paper
) -> None:
    """Write a PDF page with the print in its middle, and a ruler and a caption below.

    Parameters
    ----------
    path : Path
    size_m : (2,) float64
        Width and height of the print.
    rectangles_m : (N, 4) float64
        Black rectangles: left, top, right, bottom, from the upper left corner of the print.
    caption : str
        One line of text.
    paper : Paper
        Used in landscape if necessary.

    Raises
    ------
    ValueError
        If it does not fit on the paper.
    FileError
        If `path` does not end in ``.pdf``, or cannot be written.
    """
    require_suffix(path, ".pdf")
    # Imported late: matplotlib is slow to import, and the commands' options need only PAPERS.
    from matplotlib.collections import PatchCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    page_m = _page(size_m, paper)
    origin_m = (page_m - size_m - [0.0, _CAPTION_M]) / 2
    black_m = [*(rectangles_m + np.tile(origin_m, 2)), *_ruler(page_m)]
    figure = Figure(figsize=tuple(page_m / _INCH_M))
    axes = figure.add_axes((0, 0, 1, 1), xlim=(0, page_m[0]), ylim=(page_m[1], 0))
    axes.set_axis_off()
    patches = [Rectangle((x0, y0), x1 - x0, y1 - y0) for x0, y0, x1, y1 in black_m]
    axes.add_collection(PatchCollection(patches, facecolor="black", linewidth=0))
    text = f"{caption}. Print at 100 %; the ruler is 100 mm long."
    axes.text(_EDGE_M + _RULER_M + 0.005, page_m[1] - _EDGE_M, text, fontsize=8, parse_math=False)
    data = BytesIO()
    figure.savefig(data, format="pdf", metadata={"CreationDate": None})
    write_atomic(path, data.getvalue())


def _page(size_m: Float64, paper: Paper) -> Float64:
    """Return the page's width and height, in the orientation in which the print fits."""
    if paper not in PAPERS:
        raise ValueError(f"unknown paper {paper}; choose from {', '.join(PAPERS)}")
    needed_m = size_m + 2 * _EDGE_M + [0.0, _CAPTION_M]
    upright = np.array(PAPERS[paper])
    for page_m in (upright, upright[::-1]):
        if (needed_m <= page_m).all():
            return page_m
    width_mm, height_mm = 1e3 * needed_m
    raise ValueError(
        f"with its margins this takes {width_mm:.0f}×{height_mm:.0f} mm, more than {paper} has"
    )


def _ruler(page_m: Float64) -> Float64:
    """Return a line of exactly 100 mm at the lower left, with a tick every 10 mm."""
    bottom = page_m[1] - _EDGE_M
    line = [_EDGE_M, bottom - 0.0003, _EDGE_M + _RULER_M, bottom]
    places = np.linspace(_EDGE_M, _EDGE_M + _RULER_M - 0.0002, 11)
    ticks = [[place, bottom - 0.004, place + 0.0002, bottom] for place in places]
    return np.array([line, *ticks])


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
