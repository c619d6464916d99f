"""Point rendering in plain NumPy, on every platform and without OpenGL."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QColor, QImage

from handcal.core.types import Float64, UInt8, UInt16

_FARTHEST = 65535
"""Depth level of the farthest point; the nearest has 0."""
_FARTHEST_SHADE = 0.6
"""Share of its own colour that the farthest point keeps; the rest is background."""


def splat(
    points_px: Float64,
    colors: UInt8,
    background: tuple[int, int, int],
    size_px: tuple[int, int],
    point_px: int,
) -> QImage:
    """Draw points as small squares, nearer over farther ones, faded with distance.

    Parameters
    ----------
    points_px : (N, 3) float64
        Right, down and away, in device pixels; only relative distances matter for the third.
    colors : (N, 3) uint8
        RGB.
    background : (3,) int
        RGB that distant points fade to; the background itself is not drawn.
    size_px : (int, int)
        Width and height of the image.
    point_px : int
        Side of a point's square.

    Returns
    -------
    QImage
        Transparent except at the points.
    """
    width, height = size_px
    image = QImage(width, height, QImage.Format.Format_ARGB32_Premultiplied)
    image.fill(0)
    corner = np.floor(points_px[:, :2] - 0.5 * (point_px - 1)).astype(np.intp)
    x, y = corner.T
    is_inside = (x >= 0) & (x <= width - point_px) & (y >= 0) & (y <= height - point_px)
    away = points_px[is_inside, 2]
    if not len(away):
        return image
    level = (_FARTHEST * (away - away.min()) / max(float(np.ptp(away)), 1e-9)).astype(np.uint16)
    far_to_near = np.argsort(_FARTHEST - level, kind="stable")  # 16 bits: radix sort, the fastest
    argb = _argb(colors[is_inside], background, level)[far_to_near]
    first = (y * width + x)[is_inside][far_to_near]
    square = np.add.outer(np.arange(point_px) * width, np.arange(point_px)).ravel()
    # NumPy keeps the last of the values assigned to one pixel: the nearest.
    pixels = np.frombuffer(image.bits(), np.uint32)
    pixels[np.add.outer(first, square)] = argb[:, None]
    return image


def _argb(colors: UInt8, background: tuple[int, int, int], level: UInt16) -> NDArray[np.uint32]:
    """Return (N,) opaque pixels, faded by distance."""
    lost = (1.0 - _FARTHEST_SHADE) / _FARTHEST * level[:, None].astype(np.float32)
    faded = (colors + lost * (np.array(background, np.float32) - colors)).astype(np.uint32)
    r, g, b = faded.T
    argb: NDArray[np.uint32] = np.uint32(0xFF000000) | r << 16 | g << 8 | b
    return argb


def rgb(color: str) -> tuple[int, int, int]:
    """Return red, green and blue of a colour given by name or ``#rrggbb``, 0 to 255."""
    named = QColor(color)
    return named.red(), named.green(), named.blue()
