"""Corners of square markers, as the intersections of their edges.

OpenCV's refinement pulls the corners of a marker inwards where the lens blurs: 0.3 px on rendered
images, 0.05 px with this one. The marker then seems farther away than it is.
"""

from __future__ import annotations

import numpy as np

from handcal.rig.board_finder import shades_at
from handcal.types import Float32, Float64, UInt8

_ALONG = np.linspace(0.1, 0.9, 40)  # the parts of an edge next to the corners are blurred round
_STEP_PX, _MOST_PX = 0.25, 5.0
_CELLS = 0.4  # another edge is one cell away
_FAINT = 0.3  # slopes below this share of the steepest are noise


def refine_corners(gray: UInt8, corners_px: Float64, cells: int) -> Float64:
    """Return a marker's corners, (4, 2), found again by a line through each of its edges.

    Parameters
    ----------
    gray : (H, W) uint8
    corners_px : (4, 2) float64
        In order around the marker, known to a pixel or so.
    cells : int
        Along each side of the marker, its border included.
    """
    exact = gray.astype(np.float32)  # shades between those of pixels are not rounded
    edges = [_line(exact, np.roll(corners_px, -i, axis=0), cells) for i in range(4)]
    meeting = np.cross(np.roll(edges, 1, axis=0), edges)
    return np.asarray(meeting[:, :2] / meeting[:, 2:])


def _line(gray: Float32, corners_px: Float64, cells: int) -> Float64:
    """Return the line (a, b, c), a x + b y + c = 0, where the edge between the first two is."""
    start_px = corners_px[0]
    along = corners_px[1] - start_px
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    height_px = np.abs((corners_px[2:] - start_px) @ across).min()
    reach_px = min(_MOST_PX, _CELLS * height_px / cells)
    offsets_px = np.arange(-reach_px, reach_px + _STEP_PX, _STEP_PX)
    on_edge = start_px + _ALONG[:, None] * along
    places = on_edge[:, None] + offsets_px[:, None] * across
    slopes = np.abs(np.diff(shades_at(gray, places), axis=1))
    slopes[slopes <= _FAINT * slopes.max(axis=1, keepdims=True)] = 0.0
    middles_px = offsets_px[:-1] + 0.5 * _STEP_PX
    steepest_px = slopes @ middles_px / np.maximum(slopes.sum(axis=1), 1e-9)
    points = on_edge + steepest_px[:, None] * across
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle)[2][1]
    return np.array([*normal, -normal @ middle])
