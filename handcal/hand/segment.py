"""Segmentation of the wearer's bare hand in a depth image: mask, outer contour and cloud."""

from __future__ import annotations

import cv2
import numpy as np

from handcal.core.geometry import image_points, transform
from handcal.core.types import Bool, Float32, Frame, HandCloud, Intrinsics, UInt8
from handcal.hand.locate import locate_hand
from handcal.hand.mask import HandMask, mask_hand
from handcal.hand.settings import SegmentSettings
from handcal.hand.surface import behind_nearest
from handcal.hand.view import Box, Pixels, deproject, pixels_of, view_depth

__all__ = ["SegmentSettings", "segment_hand", "segmented_window"]

# Approximate pitch of the grid on which the hand is located, at this depth.
_COARSE_PITCH_M = 0.002
_COARSE_DEPTH_M = 0.5


def segment_hand(frame: Frame, settings: SegmentSettings, roi_px: Box | None = None) -> HandCloud:
    """Find the hand in a frame.

    Parameters
    ----------
    frame : Frame
        Depth and, optionally, colour, aligned or not.
    settings : SegmentSettings
    roi_px : Box, optional
        Detected region of the hand: x0, y0, x1, y1 in the depth image, x1 and y1 exclusive.
        Without it the nearest hand-sized object in the whole image is used.

    Returns
    -------
    HandCloud
        In frame D.

    Raises
    ------
    HandError
        If there is no hand, or the image does not show the whole hand.
    ValueError
        If `roi_px` does not overlap the image.
    """
    camera = frame.depth_intrinsics
    window = segmented_window(roi_px, camera, settings)
    located = locate_hand(view_depth(frame, window, _coarse_step_px(camera)), settings, roi_px)
    return _cloud(frame, mask_hand(frame, located, settings), settings)


def segmented_window(roi_px: Box | None, camera: Intrinsics, settings: SegmentSettings) -> Box:
    """Return the part of the depth image that `segment_hand` examines.

    It is aligned with the coarse grid of the whole image, so that both give the same hand.
    """
    if roi_px is None:
        return 0, 0, camera.width, camera.height
    x0, y0, x1, y1 = roi_px
    wider, higher = (round(settings.roi_margin * side) for side in (x1 - x0, y1 - y0))
    step_px = _coarse_step_px(camera)
    x0, y0 = (max(0, low) // step_px * step_px for low in (x0 - wider, y0 - higher))
    x1, y1 = min(camera.width, x1 + wider), min(camera.height, y1 + higher)
    if x0 >= x1 or y0 >= y1:
        raise ValueError(f"the region of interest {roi_px} is empty or outside the depth image")
    return x0, y0, x1, y1


def _coarse_step_px(camera: Intrinsics) -> int:
    return max(1, round(_COARSE_PITCH_M * camera.fx / _COARSE_DEPTH_M))


def _cloud(frame: Frame, hand: HandMask, settings: SegmentSettings) -> HandCloud:
    """Select points of the masked hand and compute their coordinates."""
    view = hand.view
    flying_behind = round(settings.flying_m / view.scale_m)
    good = hand.surface & (behind_nearest(view.depth, hand.surface, 5) <= flying_behind)
    even = _even_choice(good.shape, settings.points / int(np.count_nonzero(good)))
    chosen = pixels_of(good & even)
    points_m = deproject(view, *chosen).T
    rows, columns = hand.outline
    is_good = good[rows, columns]
    outline = rows[is_good], columns[is_good]
    x0, y0, x1, y1 = view.box
    mask = np.zeros(frame.depth.shape, np.uint8)
    mask[y0:y1, x0:x1] = hand.filled
    x, y, width, height = cv2.boundingRect(hand.filled)
    return HandCloud(
        t_camera_ns=frame.t_camera_ns,
        t_host_ns=frame.t_host_ns,
        points_m=points_m,
        is_cut=_widened(hand.cut, round(settings.cut_band_m / hand.pitch_m))[chosen],
        colors=_colors(frame, points_m, (chosen[0] + y0, chosen[1] + x0)),
        contour_m=deproject(view, *outline).T,
        contour_is_cut=hand.cut[outline],
        mask=mask,
        box_px=(x0 + x, y0 + y, x0 + x + width, y0 + y + height),
        median_depth_m=float(np.median(points_m[:, 2])),
    )


def _even_choice(shape: tuple[int, ...], fraction: float) -> Bool:
    """Select an evenly spread fraction of an image's pixels.

    Thresholds a rank-1 lattice: Roberts, "The unreasonable effectiveness of quasirandom
    sequences", 2018 (R2), in 16-bit fractions.
    """
    rows = np.arange(shape[0], dtype=np.uint16) * np.uint16(37345)
    columns = np.arange(shape[1], dtype=np.uint16) * np.uint16(49472)
    chosen: Bool = rows[:, None] + columns <= np.uint16(min(fraction, 1.0) * 65535)
    return chosen


def _widened(mask: Bool, by_px: int) -> Bool:
    """Dilate a mask by a square with the given half side."""
    square = np.ones((2 * by_px + 1, 2 * by_px + 1), np.uint8)
    return cv2.dilate(mask.astype(np.uint8), square).astype(bool)


def _colors(frame: Frame, points_m: Float32, pixels: Pixels) -> UInt8 | None:
    """Look up the colours of points measured at pixels; black outside the colour image."""
    camera = frame.color_intrinsics
    if frame.color is None or camera is None:
        return None
    if camera == frame.depth_intrinsics and (np.eye(4) == frame.T_C_D).all():
        rows, columns = pixels
        # Two times faster than with two indices.
        return frame.color.reshape(-1, 3).take(rows * camera.width + columns, axis=0)
    seen_at = image_points(transform(frame.T_C_D, points_m), camera)
    columns, rows = np.rint(seen_at).astype(int).T
    seen = (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
    colors = np.zeros((len(points_m), 3), np.uint8)
    colors[seen] = frame.color[rows[seen], columns[seen]]
    return colors
