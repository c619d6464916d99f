"""A board to put up: as an image for a screen, or to scale on paper."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, TypeAlias

import cv2
import numpy as np

from handcal.files import require_suffix, write_atomic
from handcal.rig.board import Board, charuco
from handcal.types import Float64, UInt8

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
MAX_SIDE_PX = 8192
_POINTS_PER_M = 72 / 0.0254
_EDGE_M = 0.005  # what printers cannot reach
_RULER_M, _CAPTION_M = 0.1, 0.012


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
    require_suffix(path, ".pdf")
    page_m = _page(board, paper)
    origin_m = (page_m - _size_m(board) - [0.0, _CAPTION_M]) / 2
    rectangles = [*(black_rectangles_m(board) + np.tile(origin_m, 2)), *_ruler(page_m)]
    drawn = "\n".join(_pdf_rectangle(rectangle, page_m[1]) for rectangle in rectangles)
    x, y = _points(np.array([_EDGE_M + _RULER_M + 0.005, _EDGE_M]))
    text = f"BT /F1 8 Tf {x:.3f} {y:.3f} Td ({_caption(board)}) Tj ET"
    write_atomic(path, _pdf(_points(page_m), f"{drawn}\n{text}\n".encode("ascii")))


def black_rectangles_m(board: Board) -> Float64:
    """Return what is black on the board: (N, 4) left, top, right, bottom in its frame."""
    columns, rows = board.squares
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(columns), np.arange(rows)))
    # An older OpenCV began with a white square if the rows are even.
    is_black = (x + y + (board.legacy and rows % 2 == 0)) % 2 == 0
    starts = np.stack([x, y], axis=1)[is_black] * board.square_m
    squares = np.hstack([starts, starts + board.square_m])
    return np.vstack([squares, _marker_cells(board)]) if board.kind == "charuco" else squares


def _marker_cells(board: Board) -> Float64:
    """Return the black cells of all markers, side by side ones in one rectangle."""
    made = charuco(board)
    across = board.marker_dictionary.markerSize + 2
    cell_m = board.marker_m / across
    cells = []
    for marker, corners in zip(made.getIds(), made.getObjPoints(), strict=True):
        left, top = np.asarray(corners).reshape(-1, 3)[0, :2]
        bits = cv2.aruco.generateImageMarker(board.marker_dictionary, int(marker), across)
        for row, line in enumerate(bits):
            # Where black begins and ends: gaps between cells of their own would show in print.
            ends = np.flatnonzero(np.diff(np.concatenate([[255], line, [255]]).astype(int)))
            for start, end in ends.reshape(-1, 2):
                cells.append(
                    [
                        left + start * cell_m,
                        top + row * cell_m,
                        left + end * cell_m,
                        top + (row + 1) * cell_m,
                    ]
                )
    return np.array(cells)


def _size_m(board: Board) -> Float64:
    return np.array(board.squares) * board.square_m


def _page(board: Board, paper: Paper) -> Float64:
    """Return the page's width and height, turned so that the board fits."""
    if paper not in PAPERS:
        raise ValueError(f"no paper {paper}; there is {', '.join(PAPERS)}")
    needed_m = _size_m(board) + 2 * _EDGE_M + [0.0, _CAPTION_M]
    upright = np.array(PAPERS[paper])
    for page_m in (upright, upright[::-1]):
        if (needed_m <= page_m).all():
            return page_m
    width_mm, height_mm = 1e3 * needed_m
    raise ValueError(
        f"with its margins the board takes {width_mm:.0f}×{height_mm:.0f} mm, more than {paper} has"
    )


def _ruler(page_m: Float64) -> Float64:
    """Return a line of exactly 100 mm at the lower left, with a tick every 10 mm."""
    bottom = page_m[1] - _EDGE_M
    line = [_EDGE_M, bottom - 0.0003, _EDGE_M + _RULER_M, bottom]
    places = np.linspace(_EDGE_M, _EDGE_M + _RULER_M - 0.0002, 11)
    ticks = [[place, bottom - 0.004, place + 0.0002, bottom] for place in places]
    return np.array([line, *ticks])


def _caption(board: Board) -> str:
    """Return what is printed on the board, in ASCII without parentheses: PDF's plain text."""
    columns, rows = board.squares
    text = f"{board.kind} {columns}x{rows}, square {1e3 * board.square_m:g} mm"
    if board.kind == "charuco":
        text += f", marker {1e3 * board.marker_m:g} mm, {board.dictionary}"
        text += ", legacy" if board.legacy else ""
    return f"{text}. Print at 100 %; the ruler is 100 mm long."


def _points(lengths_m: Float64) -> Float64:
    return lengths_m * _POINTS_PER_M


def _pdf_rectangle(rectangle_m: Float64, page_height_m: float) -> str:
    """Return PDF's words for a filled rectangle; its y axis points up."""
    left, top, right, bottom = rectangle_m
    x, y = _points(np.array([left, page_height_m - bottom]))
    width, height = _points(np.array([right - left, bottom - top]))
    return f"{x:.4f} {y:.4f} {width:.4f} {height:.4f} re f"


def _pdf(size_points: Float64, content: bytes) -> bytes:
    """Return a PDF file of one page (ISO 32000-1, 7.5)."""
    width, height = size_points
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        b"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 %.4f %.4f] /Contents 5 0 R "
        b"/Resources << /Font << /F1 4 0 R >> >> >>" % (width, height),
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
        b"<< /Length %d >>\nstream\n%s\nendstream" % (len(content), content),
    ]
    data, offsets = b"%PDF-1.4\n", []
    for number, text in enumerate(objects, 1):
        offsets.append(len(data))
        data += b"%d 0 obj\n%s\nendobj\n" % (number, text)
    table = b"".join(b"%010d 00000 n \n" % offset for offset in offsets)
    head = b"xref\n0 %d\n0000000000 65535 f \n%s" % (len(objects) + 1, table)
    trailer = b"trailer << /Size %d /Root 1 0 R >>\n" % (len(objects) + 1)
    return data + head + trailer + b"startxref\n%d\n%%%%EOF\n" % len(data)
