"""Detection of a calibration board's corners in an image."""

from __future__ import annotations

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
from handcal.rig.boards.diagnosis import (
    OTHER_BOARD,
    explain_missing,
    other_squares,
    shown_board,
    why_not_plain,
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
        goes_on = f"the checkerboard continues: it has more squares than {columns}×{rows}"
        raise BoardError(why_not_plain(gray) or f"{goes_on}; {OTHER_BOARD}")
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
