"""Outlines without error: the rim of a hand as one eye or camera sees it, finely drawn."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.spatial import KDTree

from handcal.core.geometry import invert, transform
from handcal.core.types import Float64, Intrinsics
from handcal.hand.outline import inward_normals, moved_contour
from handcal.sim.hand import HandModel
from handcal.sim.raster import draw_hand
from handcal.sim.silhouette import silhouette

FINE = Intrinsics(6000, 6000, 3000.0, 3000.0, 2999.5, 2999.5)
"""A pixel is about one arcminute."""


def rim_outline(hand: HandModel, T_eye_hand: Float64, arm_m: float = 0.03) -> Float64:
    """Return the rim (N, 3) in the eye's frame, in order, with this much of the forearm."""
    image = draw_hand(hand, T_eye_hand, FINE)
    is_hand = np.pad(np.isfinite(image.depth_m), 1).astype(np.uint8)
    contours, _ = cv2.findContours(is_hand, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outer_px = max(contours, key=len)[:, 0] + np.array([image.x0 - 1.0, image.y0 - 1.0])
    rays = (outer_px - [FINE.cx, FINE.cy]) / FINE.fx
    # The mesh tells the depth; the pixels, whose centres are half a pixel inside, the rest.
    rim = transform(T_eye_hand, silhouette(hand, invert(T_eye_hand)[:3, 3]).points_m)
    nearest = KDTree(rim[:, :2] / rim[:, 2:]).query(rays)[1]
    outline_m = rim[nearest, 2:] * np.column_stack([rays, np.ones(len(rays))])
    outward_px = -0.5 * inward_normals(outer_px)
    outline_m = moved_contour(outline_m, FINE, outward_px, np.zeros(len(outline_m), bool))
    reach_m = (transform(invert(T_eye_hand), outline_m) - hand.wrist_m) @ hand.arm_axis
    return outline_m[reach_m < arm_m]
