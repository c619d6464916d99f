"""Surfaces in depth images, separated by depth jumps."""

from __future__ import annotations

import cv2
import numpy as np

from handcal.core.types import Bool, UInt16

NEIGHBOURS = np.ones((3, 3), np.uint8)
_UNMEASURED = np.uint16(65535)


def solid_surface(depth: UInt16, jump: int) -> Bool:
    """Mark the measured pixels that are not on the far side of a depth jump.

    Of two neighbouring pixels of a surface neither is more than `jump` behind the other, so
    surfaces at different depths never touch. Flying pixels, between a silhouette and its
    background, are on the far side.

    Parameters
    ----------
    depth : (h, w) uint16
        0 where there is no measurement.
    jump : int
        In the units of `depth`.

    Returns
    -------
    (h, w) bool
    """
    shifted = depth - np.uint16(1)  # unmeasured pixels become the farthest
    behind = cv2.subtract(shifted, cv2.erode(shifted, NEIGHBOURS))
    solid: Bool = (behind <= jump) & (depth > 0)
    return solid


def behind_nearest(depth: UInt16, surface: Bool, size_px: int = 3) -> UInt16:
    """Return the distance of each pixel of `surface` behind the nearest one around it.

    The result is undefined outside the surface.

    Parameters
    ----------
    depth : (h, w) uint16
    surface : (h, w) bool
    size_px : int
        Side of the square around each pixel, odd.
    """
    on_surface = _only(depth, surface)
    around = np.ones((size_px, size_px), np.uint8)
    return np.asarray(cv2.subtract(on_surface, cv2.erode(on_surface, around)), np.uint16)


def goes_on(surface: Bool, other: Bool, depth: UInt16, jump: int) -> Bool:
    """Mark the pixels of `surface` at which `other` continues: adjoins or occludes it.

    Parameters
    ----------
    surface, other : (h, w) bool
        Disjoint parts of a solid surface.
    depth : (h, w) uint16
    jump : int
        In the units of `depth`.

    Returns
    -------
    (h, w) bool
    """
    nearest_other = cv2.erode(_only(depth, other), NEIGHBOURS)
    not_behind = cv2.subtract(nearest_other, depth) <= jump  # saturates at 0 for nearer pixels
    beside: Bool = surface & not_behind & (nearest_other != _UNMEASURED)
    return beside


def covered(surface: Bool, other: Bool, depth: UInt16, jump: int) -> Bool:
    """Mark the pixels of `surface` with one of `other` before them, two pixels away or less.

    Parameters
    ----------
    surface, other : (h, w) bool
        Disjoint parts of a depth image.
    depth : (h, w) uint16
    jump : int
        Least distance in front, in the units of `depth`.

    Returns
    -------
    (h, w) bool
    """
    nearest_other = cv2.erode(_only(depth, other), np.ones((5, 5), np.uint8))
    before: Bool = surface & (cv2.subtract(depth, nearest_other) > jump)  # saturates at 0
    return before


def _only(depth: UInt16, mask: Bool) -> UInt16:
    """Return the depth on a mask, _UNMEASURED elsewhere; five times faster than np.where."""
    return depth | (mask.astype(np.uint16) - np.uint16(1))


def on_border(mask: Bool) -> Bool:
    """Mark the pixels of `mask` that lie on the border of the image."""
    inner = np.zeros_like(mask)
    inner[1:-1, 1:-1] = True
    return mask & ~inner
