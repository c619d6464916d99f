"""Detection of a calibration board's corners in an image, and the reason why there are none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from handcal.core.types import Float32, Float64, UInt8
from handcal.rig.boards.board import (
    MIN_CORNERS,
    Board,
    BoardError,
    BoardView,
    Int64,
    charuco,
    corners_m,
)

# In squares: corners farther than this from the place predicted by the others are rejected.
_STRAY_SQUARES = 0.5
_MIN_SIDE_PX = 64
_LEAST_RADIUS_PX = 4


def find_board(image: UInt8, board: Board, *, explain: bool = True) -> BoardView:
    """Find the board's inner corners to a fraction of a pixel.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
        Grey or RGB, with lens distortion, not mirrored. A mirrored checkerboard cannot be
        recognised from one image.
    board : Board
    explain : bool
        Also diagnose why no board was found; this takes longer than the detection.

    Raises
    ------
    BoardError
        If fewer than `MIN_CORNERS` are found; the text says why: no board, another board or
        dictionary, a mirrored image, one too dark …
    """
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or min(image.shape[:2]) < _MIN_SIDE_PX:
        raise ValueError(f"an image must be uint8 and at least {_MIN_SIDE_PX} pixels wide and high")
    gray: UInt8 = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) if image.ndim == 3 else image  # type: ignore[assignment]
    ids, pixels = find_corners(gray, board)
    points_m = corners_m(board)[ids]
    if len(ids) < MIN_CORNERS or np.linalg.matrix_rank(points_m[:, :2] - points_m[0, :2]) < 2:
        why = explain_missing(gray, board, find_corners) if explain else "no board is seen"
        raise BoardError(why)
    fits = _is_regular(ids, pixels, board)
    is_skipping = board.kind == "checkerboard" and not _alternates(gray, pixels, board)
    if np.mean(fits) < 0.8 or fits.sum() < MIN_CORNERS or is_skipping:
        other = other_squares(gray, board) if board.kind == "charuco" else ""
        raise BoardError(
            other
            or "the squares do not lie as on this board: check the number of squares and markers"
        )
    ids, pixels = ids[fits], pixels[fits]
    if board.kind == "checkerboard" and fits.all() and _goes_on(gray, pixels, board):
        columns, rows = board.squares
        if markers := why_not_plain(gray):
            raise BoardError(markers)
        goes_on = f"the checkerboard continues: it has more squares than {columns}×{rows}"
        raise BoardError(goes_on, OTHER_BOARD)
    pixels = _refine(gray, pixels, board)
    return BoardView(
        points_m=corners_m(board)[ids],
        pixels=pixels,
        size=(gray.shape[1], gray.shape[0]),
        ids=ids,
        blur_px=_blur_px(gray, ids, pixels, board),
    )


def shown_instead(image: UInt8, board: Board) -> Board | None:
    """Return the board that an image (H, W) or (H, W, 3) shows instead; None if it does not tell.

    Of a ChArUco board, the numbers and places of its markers tell the squares, and whether it was
    printed by OpenCV before 4.6; of a checkerboard, its corners.
    """
    gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) if image.ndim == 3 else image
    return shown_board(np.asarray(gray, np.uint8), board, find_corners)


def find_corners(gray: UInt8, board: Board) -> tuple[Int64, Float64]:
    """Return the detected corners: numbers (N,) and pixels (N, 2), not yet refined or checked."""
    if board.kind == "checkerboard":
        return _find_checkerboard(gray, board)
    pixels, ids, _, _ = cv2.aruco.CharucoDetector(charuco(board)).detectBoard(gray)
    if ids is None or not len(ids):
        return np.empty(0, np.int64), np.empty((0, 2))
    order = np.argsort(ids.ravel())
    return ids.ravel()[order].astype(np.int64), pixels.reshape(-1, 2)[order].astype(np.float64)


def _find_checkerboard(gray: UInt8, board: Board) -> tuple[Int64, Float64]:
    columns, rows = board.inner
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, corners = cv2.findChessboardCorners(gray, board.inner, flags=flags)
    if not found:  # slower, but sometimes the only one that finds it
        found, corners = cv2.findChessboardCornersSB(gray, board.inner)
    if not found:
        return np.empty(0, np.int64), np.empty((0, 2))
    grid = _upright(gray, corners.reshape(rows, columns, 2).astype(np.float64))
    return np.arange(columns * rows), grid.reshape(-1, 2)


def _upright(gray: UInt8, grid: Float64) -> Float64:
    """Turn a (rows, columns, 2) grid of pixels so that it begins at the board's upper left."""
    x, y = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    if x[0] * y[1] < x[1] * y[0]:  # numbered as in a mirror
        grid = grid[::-1]
    turns = range(4) if grid.shape[0] == grid.shape[1] else (0, 2)
    return max((np.rot90(grid, turn) for turn in turns), key=lambda g: _uprightness(gray, g))


def _uprightness(gray: UInt8, grid: Float64) -> tuple[bool, float]:
    """Return whether the first square is black, as printed, and the component of x to the right."""
    shades, is_black = _middle_shades(gray, grid)
    first_is_black = bool(shades[is_black].mean() < shades[~is_black].mean())
    return first_is_black, float(grid[0, -1, 0] - grid[0, 0, 0])


def _middle_shades(gray: UInt8, grid: Float64) -> tuple[Float64, NDArray[np.bool_]]:
    """Return the shades in the middles of a grid's squares, and which should be black."""
    middles = (grid[:-1, :-1] + grid[1:, 1:] + grid[:-1, 1:] + grid[1:, :-1]) / 4
    row, column = np.indices(middles.shape[:2])
    return shades_at(gray, middles), (row + column) % 2 == 0


def _is_regular(ids: Int64, pixels: Float64, board: Board) -> NDArray[np.bool_]:
    """Return which corners lie where their neighbours on the board predict them.

    Each pair of neighbours on a line predicts a corner, midway or beyond. Unlike one homography of
    the whole board, this also holds for the image of a wide-angle lens.
    """
    columns, rows = board.inner
    grid = np.full((rows + 4, columns + 4, 2), np.nan)
    row, column = np.divmod(ids, columns)
    grid[row + 2, column + 2] = pixels
    predicted = []
    for step in ((0, 1), (1, 0), (1, 1), (1, -1)):
        at = {k: grid[row + 2 + k * step[0], column + 2 + k * step[1]] for k in (-2, -1, 1, 2)}
        predicted += [(at[-1] + at[1]) / 2, 2 * at[1] - at[2], 2 * at[-1] - at[-2]]
    known = ~np.isnan(np.stack(predicted)).all(axis=(0, 2))
    off_px = np.full(len(ids), np.inf)
    middle = np.nanmedian(np.stack(predicted)[:, known], axis=0)
    off_px[known] = np.linalg.norm(middle - pixels[known], axis=1)
    return np.asarray(off_px < _STRAY_SQUARES * np.median(_spacings_px(pixels)))


def _alternates(gray: UInt8, pixels: Float64, board: Board) -> bool:
    """Return whether neighbouring squares of a whole grid differ.

    They do not on a grid that skips every other corner, as found on a board with more squares: the
    middles of its cells lie on edges.
    """
    columns, rows = board.inner
    shades, is_black = _middle_shades(gray, pixels.reshape(rows, columns, 2))
    x, y, width, height = cv2.boundingRect(pixels.astype(np.float32))
    dark, light = np.percentile(gray[max(y, 0) : y + height, max(x, 0) : x + width], (10, 90))
    contrast = abs(shades[is_black].mean() - shades[~is_black].mean())
    return bool(contrast > 0.5 * (light - dark))


def _goes_on(gray: UInt8, pixels: Float64, board: Board) -> bool:
    """Return whether there are corners beyond a side of a whole grid, as of a larger board."""
    columns, rows = board.inner
    grid = pixels.reshape(rows, columns, 2)
    sides = (grid, grid[::-1], grid.swapaxes(0, 1), grid[:, ::-1].swapaxes(0, 1))
    return any(
        np.median(_alternation(gray, np.stack([2 * side[0] - side[1], *side[:2]]))) > 0.5
        for side in sides
    )


def _alternation(gray: UInt8, grid: Float64) -> Float64:
    """Return how the squares beyond a grid's first row alternate, of those beyond its second.

    It is 1 on a board that goes on and 0 at its margin, however bright or glaring the margin is.
    """
    down, right = (0.3 * np.gradient(grid, axis=axis)[:2] for axis in (0, 1))
    shades = shades_at(gray, grid[:2] + np.stack([right - down, -right - down]))
    beyond, within = shades[0] - shades[1]
    usual = np.median(np.abs(within))
    share: Float64 = -beyond * np.sign(within) / np.maximum(np.abs(within), usual)
    return share


def _refine(gray: UInt8, pixels: Float64, board: Board) -> Float64:
    """Refine corners in windows that contain no other corner, also of a marker.

    OpenCV's usual radius of 11 pixels reaches the edges of the next squares on a small, steep or
    rotated board. On OpenCV's own stereo sample this more than doubles the calibration's residual.
    A window that only fits between markers if it is smaller than `_LEAST_RADIUS_PX` is worse than
    OpenCV's own refinement of ChArUco corners, which then remains.
    """
    gap = (1 - board.marker_m / board.square_m) / 2 if board.kind == "charuco" else 1.0
    radii = np.clip(min(0.3, 0.9 * gap) * _spacings_px(pixels), 2, 11).astype(int)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 40, 0.001)
    refined = pixels.copy()
    for radius in np.unique(radii).tolist():
        if board.kind == "checkerboard" or radius >= _LEAST_RADIUS_PX:
            inside = radii == radius
            places = pixels[inside, None].astype(np.float32)
            found = cv2.cornerSubPix(gray, places, (radius, radius), (-1, -1), criteria)
            refined[inside] = found.reshape(-1, 2)
    return refined


def _spacings_px(pixels: Float64) -> Float64:
    """Return each corner's distance to the nearest other."""
    distances = np.asarray(cKDTree(pixels).query(pixels, k=2)[0])
    return distances[:, 1]


def _blur_px(gray: UInt8, ids: Int64, pixels: Float64, board: Board) -> float:
    """Return the blur width of the squares' edges, in pixels: contrast divided by gradient."""
    starts, ends = _neighbours(ids, pixels, board.inner[0])
    across = (ends - starts)[:, ::-1] * [1, -1]
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    offsets_px = np.arange(-4.0, 4.5, 0.5)
    places = (starts + ends)[:, None] / 2 + offsets_px[:, None] * across[:, None]
    shades = shades_at(gray, places)
    steepness = np.abs(np.diff(shades, axis=1)).max(axis=1) / 0.5
    widths_px = np.ptp(shades, axis=1) / np.maximum(steepness, 1e-3)
    # A motion blurs the edges across it only: the wider half counts.
    return float(np.percentile(widths_px, 75)) if len(widths_px) else float("nan")


def _neighbours(ids: Int64, pixels: Float64, columns: int) -> tuple[Float64, Float64]:
    """Return the two ends, (M, 2) each, of all edges between corners that are both seen."""
    at = dict(zip(ids.tolist(), pixels, strict=True))
    pairs = [
        (at[i], at[j])
        for i in at
        for j in (i + 1, i + columns)
        if j in at and not (j == i + 1 and j % columns == 0)
    ]
    edges: Float64 = np.array(pairs).reshape(-1, 2, 2)
    return edges[:, 0], edges[:, 1]


def shades_at(gray: UInt8 | Float32, places: Float64) -> Float64:
    """Return an image's grey values at positions of shape (..., 2), in pixels."""
    x, y = places.reshape(-1, 1, 2).astype(np.float32).T
    shades = cv2.remap(gray, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(shades, dtype=np.float64).reshape(places.shape[:-1])


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
