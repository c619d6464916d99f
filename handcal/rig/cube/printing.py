"""The net of a cube, to scale on paper: cut it out, fold it, or glue it onto a cube."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from handcal.core.types import Float64
from handcal.rig.boards.print_page import Paper, write_page
from handcal.rig.boards.printing import marker_cells_m
from handcal.rig.cube.cube import FACES, Cube

# Column and row of each face in the net.
_PLACES = {
    "left": (0, 1),
    "front": (1, 1),
    "right": (2, 1),
    "back": (3, 1),
    "top": (1, 0),
    "bottom": (1, 2),
}
_LINE_M, _MARK_SHARE = 0.0002, 0.15
_TAB_M = 0.008


def write_cube_pdf(path: Path, cube: Cube, paper: Paper = "a4") -> None:
    """Write the cube's net as a PDF page at its true size, with marks for cutting and folding.

    Raises
    ------
    ValueError
        If the net does not fit on the paper.
    FileError
        If `path` does not end in ``.pdf``, or cannot be written.
    """
    size_m = np.array([4.0, 3.0]) * cube.side_m + [_TAB_M, 0.0]
    caption = (
        f"cube {1e3 * cube.side_m:g} mm, marker {1e3 * cube.marker_m:g} mm, {cube.dictionary}, "
        f"{', '.join(f'{face} {marker}' for face, marker in zip(FACES, cube.ids, strict=True))}"
    )
    write_page(path, size_m, net_rectangles_m(cube), caption, paper)


def net_rectangles_m(cube: Cube) -> Float64:
    """Return the black rectangles of the net: (N, 4) left, top, right, bottom."""
    margin_m = 0.5 * (cube.side_m - cube.marker_m)
    parts = []
    for face, marker in zip(FACES, cube.ids, strict=True):
        corner_m = cube.side_m * np.array(_PLACES[face])
        parts.append(_outline(corner_m, corner_m + cube.side_m))
        parts.append(
            marker_cells_m(cube.marker_dictionary, marker, corner_m + margin_m, cube.marker_m)
        )
    parts += [_outline(*corners) for corners in _tabs(cube.side_m)]
    return np.vstack(parts)


def _tabs(side_m: float) -> list[Float64]:
    """Return the tabs to glue, (2, 2) each: above, below and beside the middle row."""
    tabs = [
        [[column * side_m, y], [(column + 1) * side_m, y + _TAB_M]]
        for column in (0, 2, 3)
        for y in (side_m - _TAB_M, 2 * side_m)
    ]
    tabs.append([[4 * side_m, side_m], [4 * side_m + _TAB_M, 2 * side_m]])
    return [np.array(tab) for tab in tabs]


def _outline(first_m: Float64, last_m: Float64) -> Float64:
    """Return the ends of four thin lines just within a rectangle.

    Complete lines around a marker would form a square that OpenCV may mistake for the marker.
    """
    (left, top), (right, bottom) = first_m, last_m
    across, down = (_MARK_SHARE * (last_m - first_m)).tolist()
    return np.array(
        [
            [x, y, x + length, y + height]
            for length, height in ((across, _LINE_M), (_LINE_M, down))
            for x in (left, right - length)
            for y in (top, bottom - height)
        ]
    )
