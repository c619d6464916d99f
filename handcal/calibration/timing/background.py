"""Points of the background, followed from frame to frame of the colour image."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from handcal.core.geometry import transform
from handcal.core.types import Float32, Float64, Frame, UInt8

_WIDTH_PX = 320
"""Width of the pictures in which points are followed."""
_FAR_M = 0.9
"""Farther than a hand."""
_STRIDE_PX = 16
"""Between the depth pixels from which points are chosen."""
_CELLS = 8, 5
"""The point with most texture is followed in each cell of this grid."""
_FEWEST = 8
_TEXTURE = 1e-4
"""Smallest eigenvalue of the gradients' matrix, as OpenCV scales it."""
_WINDOW_PX, _BORDER_PX = 15, 8


@dataclass(slots=True, eq=False)
class Background:
    """Points of the background in a key frame, and their movement since."""

    gray: UInt8
    points_C_m: Float64
    """(N, 3); in the colour camera's frame."""
    start_px: Float32
    newest_px: Float32
    """(N, 2); in the small picture of the key frame, and of the newest frame that showed them."""
    focal_px: Float64
    """(2,); of the small picture."""
    T_C_D: Float64
    times_ns: list[int]
    """Camera times of the key frame and of those that followed."""
    moved: list[Float32]
    """each (N, 2); movement in units of the focal length, of those that followed; NaN where a
    point is lost."""


def make_background(frame: Frame) -> Background | None:
    """Return the background of a frame with colour; None if too little is far or has texture.

    Points whose depth is unknown are not used. Lens distortion is ignored: points move little.
    """
    assert frame.color is not None
    assert frame.color_intrinsics is not None
    gray = _small(frame.color)
    depth, color = frame.depth_intrinsics, frame.color_intrinsics
    z_m = frame.depth[::_STRIDE_PX, ::_STRIDE_PX] * np.float64(frame.depth_scale_m)
    rows, columns = np.nonzero(z_m > _FAR_M)
    z_m = z_m[rows, columns]
    x = (_STRIDE_PX * columns - depth.cx) / depth.fx
    y = (_STRIDE_PX * rows - depth.cy) / depth.fy
    points_C_m = transform(frame.T_C_D, np.column_stack([x * z_m, y * z_m, z_m]))
    scale = _WIDTH_PX / color.width
    focal_px = scale * np.array([color.fx, color.fy])
    center_px = scale * (np.array([color.cx, color.cy]) + 0.5) - 0.5
    pixels = points_C_m[:, :2] / points_C_m[:, 2:] * focal_px + center_px
    height, width = gray.shape
    limit_px = np.array([width, height]) - _BORDER_PX
    inside = ((pixels > _BORDER_PX) & (pixels < limit_px)).all(axis=1)
    points_C_m, pixels = points_C_m[inside], pixels[inside]
    u, v = np.rint(pixels).astype(int).T
    texture = cv2.cornerMinEigenVal(gray, 7)[v, u]
    cell = u * _CELLS[0] // width * _CELLS[1] + v * _CELLS[1] // height
    order = np.lexsort((texture, cell))
    is_last = np.append(np.diff(cell[order]) > 0, True)[: len(order)]
    best = order[is_last]
    best = best[texture[best] > _TEXTURE]
    if len(best) < _FEWEST:
        return None
    start_px = pixels[best].astype(np.float32)
    return Background(
        gray, points_C_m[best], start_px, start_px, focal_px, frame.T_C_D, [frame.t_camera_ns], []
    )


def follow(background: Background, frame: Frame) -> bool:
    """Add the points' movement in a frame with colour; return False if half of them are lost."""
    assert frame.color is not None
    pixels, found, _ = cv2.calcOpticalFlowPyrLK(
        background.gray,
        _small(frame.color),
        background.start_px[:, None],
        background.newest_px[:, None].copy(),
        winSize=(_WINDOW_PX, _WINDOW_PX),
        maxLevel=2,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    is_found = found[:, :1] > 0
    if is_found.sum() < max(_FEWEST, len(is_found) / 2):
        return False
    moved = np.where(is_found, pixels[:, 0] - background.start_px, np.nan)
    background.newest_px = np.where(is_found, pixels[:, 0], background.newest_px)
    background.times_ns.append(frame.t_camera_ns)
    background.moved.append((moved / background.focal_px).astype(np.float32))
    return True


def _small(color: UInt8) -> UInt8:
    every = max(1, color.shape[1] // (2 * _WIDTH_PX))
    green = np.ascontiguousarray(color[::every, ::every, 1])
    height = round(_WIDTH_PX * green.shape[0] / green.shape[1])
    return np.asarray(cv2.resize(green, (_WIDTH_PX, height), interpolation=cv2.INTER_AREA))
