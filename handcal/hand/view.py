"""A part of a depth image, at full or reduced resolution, that still knows where it lies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.geometry import camera_matrix
from handcal.types import Float32, Frame, Intrinsics, UInt16

Box: TypeAlias = tuple[int, int, int, int]
"""x0, y0, x1, y1 in pixels, x1 and y1 exclusive."""


@dataclass(frozen=True, slots=True, eq=False)
class DepthView:
    """Every `step_px`-th pixel of a box of a depth image.

    Attributes
    ----------
    depth : (h, w) uint16
    scale_m : float
        Metres per unit of `depth`.
    camera : Intrinsics
        Of the whole image.
    box : Box
        In the whole image.
    step_px : int
    """

    depth: UInt16
    scale_m: float
    camera: Intrinsics
    box: Box
    step_px: int


def view_depth(frame: Frame, box: Box, step_px: int = 1) -> DepthView:
    """Return a view of a box of a frame's depth image."""
    x0, y0, x1, y1 = box
    depth = np.ascontiguousarray(frame.depth[y0:y1:step_px, x0:x1:step_px])
    return DepthView(depth, frame.depth_scale_m, frame.depth_intrinsics, box, step_px)


def deproject(view: DepthView, rows: NDArray[Any], columns: NDArray[Any]) -> Float32:
    """Return the points that pixels of a view show, lens distortion undone.

    Parameters
    ----------
    view : DepthView
    rows, columns : (N,) int
        Pixels of the view.

    Returns
    -------
    (3, N) float32
        Depth camera's frame.
    """
    camera = view.camera
    u = (view.box[0] + columns * view.step_px).astype(np.float32)
    v = (view.box[1] + rows * view.step_px).astype(np.float32)
    if any(camera.distortion):
        pixels = np.stack([u, v], axis=-1).reshape(-1, 1, 2)
        rays = cv2.undistortPoints(pixels, camera_matrix(camera), np.array(camera.distortion))
        x, y = rays.reshape(-1, 2).T
    else:
        x, y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    z_m = view.depth[rows, columns] * np.float32(view.scale_m)
    return np.stack([x * z_m, y * z_m, z_m]).astype(np.float32)
