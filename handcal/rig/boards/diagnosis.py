"""Diagnosis of an image in which no board was found."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.types import Float64, UInt8
from handcal.rig.boards.board import MIN_CORNERS, Board, charuco

# Fewer markers than this may be false detections, as in leaves or carpets.
_ENOUGH_MARKERS = 4
# Places along each side of a square, and the most that its shades differ there, of the contrast.
_WITHIN = (0.25, 0.4, 0.5, 0.6, 0.75)
_PLAIN_SHARE = 0.15
# Of a marker's side: how far its corners may be from their places on a board.
_MARKER_OFF = 0.3
_FAMILIES = (
    "DICT_4X4_1000",
    "DICT_5X5_1000",
    "DICT_6X6_1000",
    "DICT_7X7_1000",
    "DICT_APRILTAG_36H11",
    "DICT_ARUCO_MIP_36H12",
    "DICT_ARUCO_ORIGINAL",
)
# Boards number their markers from 0; to compare candidates with all 1000 takes four times longer.
_COMPARED_MARKERS = 250

OTHER_BOARD = "show the board entered, or enter this one"
FindCorners: TypeAlias = Callable[[UInt8, Board], tuple[NDArray[np.int64], Float64]]


def explain_missing(gray: UInt8, board: Board, find: FindCorners) -> str:
    """Return one line that explains why `find` returned too few corners.

    Parameters
    ----------
    gray : (H, W) uint8
    board : Board
        The board to find.
    find : callable
        `handcal.rig.boards.finder.find_corners`.
    """
    light = light_trouble(gray)
    if light:
        return light
    if board.kind == "checkerboard":
        return _why_no_checkerboard(gray, board)
    return _why_no_charuco(gray, board, find)


def light_trouble(gray: UInt8) -> str:
    """Return the problem of an image's exposure; an empty text if there is none."""
    low, high = np.percentile(gray, (2, 98))
    if high - low >= 25:
        return ""
    if high < 60:
        return "the image is too dark: add light, or lengthen the exposure"
    if low > 195:
        return "the image is too bright: dim the light, or shorten the exposure"
    return "the image has no contrast: uncover and focus the lens, and see to the light"


def why_not_plain(gray: UInt8) -> str:
    """Return a message if the checkerboard found has markers; else an empty text."""
    seen = _markers_of_some_family(gray)
    found = f"a board with markers ({seen}) is seen, not a plain checkerboard: {OTHER_BOARD}"
    return found if seen else ""


def _why_no_checkerboard(gray: UInt8, board: Board) -> str:
    grid = _checkerboard(gray)
    # To look for markers of all families takes ten times longer than to find the checkerboard.
    markers = "" if grid is not None and _is_plain(gray, grid) else why_not_plain(gray)
    if markers:
        return markers
    other = _size(grid)
    if other and other != tuple(sorted(board.squares)):
        return (
            f"a checkerboard of {other[1]}×{other[0]} squares is seen, "
            f"not one of {board.squares[0]}×{board.squares[1]}: {OTHER_BOARD}"
        )
    return (
        "no checkerboard is seen: all of it must be in the image with a white margin, sharp and "
        "evenly lit"
    )


def _why_no_charuco(gray: UInt8, board: Board, find: FindCorners) -> str:
    mirrored = np.ascontiguousarray(gray[:, ::-1])
    if len(find(mirrored, board)[0]) >= MIN_CORNERS:
        return "the image is mirrored: switch that off in the camera"
    other_print = replace(board, legacy=not board.legacy)
    if len(find(gray, other_print)[0]) >= MIN_CORNERS:
        age = "before 4.6" if other_print.legacy else "4.6 or later"
        return f"the board was printed by OpenCV {age}: enter that"
    other = other_squares(gray, board)
    if other:
        return other
    ids = list(_markers(gray, board.marker_dictionary))
    on_board = (board.squares[0] * board.squares[1]) // 2
    if len(ids) >= _ENOUGH_MARKERS:
        if max(ids) >= on_board:
            return f"marker {max(ids)} is seen, but the board has only {on_board}: {OTHER_BOARD}"
        return (
            f"{len(ids)} markers are seen, but too few corners between them: check the number of "
            "squares, and that the board is flat and uncovered"
        )
    seen = _markers_of_some_family(gray)
    if seen and not seen.startswith(board.dictionary[:8]):
        found = f"markers of another dictionary are seen ({seen}), not {board.dictionary}"
        return f"{found}: {OTHER_BOARD}"
    size = _size(_checkerboard(gray))
    if size and not seen:
        found = f"a plain checkerboard of {size[1]}×{size[0]} squares is seen, without markers"
        return f"{found}: {OTHER_BOARD}"
    if ids:
        return f"only {len(ids)} markers are seen: come closer, or uncover and light the board"
    return "no board is seen: it must be sharp, evenly lit and large enough in the image"


def shown_board(gray: UInt8, board: Board, find: FindCorners) -> Board | None:
    """Return the board that an image shows in place of the one entered; None if it does not tell.

    Parameters
    ----------
    gray, board, find
        As for `explain_missing`.
    """
    if board.kind == "checkerboard":
        size = _size(_checkerboard(gray))
        if size is None or size == tuple(sorted(board.squares)):
            return None
        return replace(board, squares=size[::-1])
    other_print = replace(board, legacy=not board.legacy)
    if len(find(gray, other_print)[0]) >= MIN_CORNERS:
        return other_print
    return _board_of_markers(gray, board)


def other_squares(gray: UInt8, board: Board) -> str:
    """Return a message with the number of squares that the markers' numbers and places show.

    It is empty if they do not show it, or lie as on the board entered.
    """
    other = _board_of_markers(gray, board)
    if other is None:
        return ""
    (columns, rows), (width, height) = other.squares, board.squares
    return (
        f"the markers lie as on a board of {columns}×{rows} squares, not {width}×{height}: "
        f"{OTHER_BOARD}"
    )


def _board_of_markers(gray: UInt8, board: Board) -> Board | None:
    """Return the board of other squares on which the markers seen lie; None if none is certain."""
    seen = _markers(gray, board.marker_dictionary)
    if len(seen) < _ENOUGH_MARKERS or _fits(seen, board):
        return None
    fitting = []
    for columns in range(3, 41):
        # Rows up to that of the last marker seen; whether they are even says how they begin.
        for rows in {-(-2 * (max(seen) + 1) // columns) + more for more in (-1, 0, 1)}:
            with suppress(ValueError):
                tried = replace(board, squares=(columns, rows))
                if _fits(seen, tried):
                    fitting.append(tried)
    if len({one.squares[0] for one in fitting}) != 1:
        return None
    columns, rows = min(one.squares for one in fitting)
    if columns == board.squares[1]:  # exchanged; the last rows may be outside the image
        rows = max(rows, board.squares[0])
    return replace(board, squares=(columns, rows))


def _fits(seen: Mapping[int, Float64], board: Board) -> bool:
    """Return whether markers (4, 2), by number, lie as on a board, but for its pose."""
    places = charuco(board).getObjPoints()
    if max(seen) >= len(places):
        return False
    flat = np.concatenate([places[number] for number in seen])[:, :2].astype(np.float64)
    pixels = np.concatenate(list(seen.values()))
    H = cv2.findHomography(flat, pixels)[0]
    if H is None:
        return False
    off_px = np.linalg.norm(cv2.perspectiveTransform(flat[None], H)[0] - pixels, axis=1)
    side_px = np.linalg.norm(np.diff(pixels.reshape(-1, 4, 2), axis=1), axis=2)
    return bool(np.median(off_px) < _MARKER_OFF * np.median(side_px))


def _markers(gray: UInt8, dictionary: cv2.aruco.Dictionary) -> dict[int, Float64]:
    """Return the corners (4, 2) of the markers seen, by number."""
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(gray)
    if ids is None:
        return {}
    return {
        int(number): np.asarray(one, np.float64).reshape(4, 2)
        for number, one in zip(ids.ravel(), corners, strict=True)
    }


def _markers_of_some_family(gray: UInt8) -> str:
    """Return the dictionary family with the most markers detected, or an empty text."""
    counts = {}
    for name in _FAMILIES:
        whole = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
        part = cv2.aruco.Dictionary(
            whole.bytesList[:_COMPARED_MARKERS], whole.markerSize, whole.maxCorrectionBits
        )
        counts[name] = len(_markers(gray, part))
    best = max(counts, key=lambda name: counts[name])
    if counts[best] < _ENOUGH_MARKERS:
        return ""
    return best.removesuffix("_1000")


def _checkerboard(gray: UInt8) -> Float64 | None:
    """Return the inner corners (R, C, 2) of a checkerboard of any size; None if not found."""
    found, corners, meta = cv2.findChessboardCornersSBWithMeta(gray, (3, 3), cv2.CALIB_CB_LARGER)
    return np.asarray(corners, np.float64).reshape(*meta.shape[:2], 2) if found else None


def _size(grid: Float64 | None) -> tuple[int, int] | None:
    """Return the numbers of squares of a grid of corners, the smaller first."""
    if grid is None:
        return None
    few, many = sorted(grid.shape[:2])
    return few + 1, many + 1


def _is_plain(gray: UInt8, grid: Float64) -> bool:
    """Return whether each square of a checkerboard has one shade, as it has without markers."""
    upper, lower = grid[:-1], grid[1:]
    places = np.stack(
        [
            (1 - v) * ((1 - u) * upper[:, :-1] + u * upper[:, 1:])
            + v * ((1 - u) * lower[:, :-1] + u * lower[:, 1:])
            for u in _WITHIN
            for v in _WITHIN
        ]
    )
    x, y = np.rint(places).astype(int).reshape(-1, 2).T
    height, width = gray.shape
    inside = gray[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)]
    shades = inside.reshape(places.shape[:-1]).astype(np.float64)
    contrast = float(np.ptp(np.percentile(shades.mean(axis=0), (10, 90))))
    return bool(np.percentile(shades.std(axis=0), 90) < _PLAIN_SHARE * contrast)
