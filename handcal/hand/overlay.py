"""Projection of a segmented hand into its frame's images, for drawing it over them."""

from __future__ import annotations

import numpy as np

from handcal.core.geometry import image_points, transform
from handcal.core.types import Float64, Frame, HandCloud


def contour_px(cloud: HandCloud, frame: Frame) -> tuple[Float64, Float64 | None]:
    """Project a hand's contour into the depth and the colour image, lens distortion included.

    Parameters
    ----------
    cloud : HandCloud
    frame : Frame
        The frame of the cloud, or a later one of the same camera.

    Returns
    -------
    depth_px : (M, 2) float64
    color_px : (M, 2) float64 or None
        The same array if both images are aligned; None if the frame has no colour.
    """
    depth_px = image_points(cloud.contour_m, frame.depth_intrinsics)
    if frame.color_intrinsics is None:
        return depth_px, None
    if frame.color_intrinsics == frame.depth_intrinsics and (np.eye(4) == frame.T_C_D).all():
        return depth_px, depth_px
    return depth_px, image_points(transform(frame.T_C_D, cloud.contour_m), frame.color_intrinsics)
