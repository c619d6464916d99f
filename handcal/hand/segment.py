"""Segmentation of the wearer's bare hand in a depth image: mask, outer contour and cloud."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from handcal.core.errors import HandError, OutOfViewError
from handcal.core.geometry import image_points, transform
from handcal.core.types import Bool, Float32, Frame, HandCloud, Intrinsics, UInt8
from handcal.hand.locate import PART_M2, LocatedHand, locate_hand
from handcal.hand.settings import SegmentSettings
from handcal.hand.view import (
    NEIGHBOURS,
    Box,
    DepthView,
    Pixels,
    behind_nearest,
    between,
    crop_view,
    deproject,
    goes_on,
    on_border,
    pixels_of,
    solid_surface,
    view_depth,
    widened,
)

# Share of the hand's outline that may touch the image border.
_BORDER_CONTACT_M = 0.01
# An arm shows at most this area beside its hand: 0.1 m times 0.5 m (see the survey in locate.py).
_ARM_AREA_M2 = 0.05
# Share of a part's contour on the coarse hand.
_PART_MIN = 0.4
_HAND, _MAY_BE_HAND, _MAY_BE_ARM = np.uint8(1), np.uint8(2), np.uint8(4)
_LEAST_CONTOUR_PX = 4  # a shorter contour encloses nothing


@dataclass(frozen=True, slots=True, eq=False)
class _HandMask:
    """The hand in the depth image."""

    view: DepthView
    """The part of the image around the hand, at full resolution."""
    surface: Bool
    """(h, w); measured pixels of the hand."""
    filled: UInt8
    """(h, w); 255 on the hand, small holes closed."""
    outline: Pixels
    """The outer contour, in order."""
    cut: Bool
    """(h, w); cut edges, beyond which the arm, the region of interest or the surface behind the
    depth gate continues."""
    pitch_m: float
    """Approximate distance between neighbouring pixels on the hand."""


def _mask_hand(frame: Frame, located: LocatedHand, settings: SegmentSettings) -> _HandMask:
    """Mask a located hand at full resolution; raises as `segment_hand`."""
    view, is_hand, may_be_hand, may_be_arm = _full_resolution(located, frame)
    jump = round(settings.edge_jump_m / view.scale_m)
    pitch_m = float(located.palm_m[2]) / view.camera.fx
    solid = solid_surface(view.depth, jump)
    within = solid & may_be_hand & between(view, *located.gate_m)
    near_wrist = pixels_of(within & may_be_arm)
    along_m = (deproject(view, *near_wrist).T - located.palm_m) @ located.axis
    within[near_wrist] = along_m <= located.limit_m
    outlined = _outline(within, is_hand, settings.hole_area_m2 / pitch_m**2, PART_M2 / pitch_m**2)
    if outlined is None:
        raise HandError("the depth image is too sparse where the hand is", "check the camera")
    outline, filled = outlined
    surface = within & (filled > 0)
    if _border_contact_px(surface, view) * pitch_m > _BORDER_CONTACT_M:
        if np.count_nonzero(located.arm) * (pitch_m * located.view.step_px) ** 2 > _ARM_AREA_M2:
            raise HandError(
                "arm and body cannot be told apart in the depth image",
                "hold the arm clear of the body and of other things",
            )
        raise OutOfViewError("hand cut by the image border", "move it toward the middle")
    cut = on_border(surface) | goes_on(surface, solid & ~surface, view.depth, jump)
    return _HandMask(view, surface, filled, outline, cut, pitch_m)


def _full_resolution(located: LocatedHand, frame: Frame) -> tuple[DepthView, Bool, Bool, Bool]:
    """Return the image around the hand, the coarse hand in it, and candidates of hand and arm."""
    coarse, place = crop_view(located.view, located.hand, margin=3)
    view = view_depth(frame, coarse.box)
    hand, arm = (mask[place].astype(np.uint8) for mask in (located.hand, located.arm))
    # Together, as each resampling takes as long as the rest.
    coded = _HAND * hand + _MAY_BE_HAND * _wider(hand) + _MAY_BE_ARM * _wider(arm)
    height, width = view.depth.shape
    size = coarse.step_px * coded.shape[1], coarse.step_px * coded.shape[0]
    coded = cv2.resize(coded, size, interpolation=cv2.INTER_NEAREST)[:height, :width]
    is_hand, may_be_hand, may_be_arm = (
        (coded & part) != 0 for part in (_HAND, _MAY_BE_HAND, _MAY_BE_ARM)
    )
    return view, is_hand, may_be_hand, may_be_arm


def _wider(mask: UInt8) -> UInt8:
    """Dilate a coarse mask by two pixels."""
    return np.asarray(cv2.dilate(mask, NEIGHBOURS, iterations=2), np.uint8)


def _outline(
    within: Bool, is_hand: Bool, hole_area_px: float, part_px: float
) -> tuple[Pixels, UInt8] | None:
    """Return the outer contour of the largest part, and all parts with small holes closed.

    Parts with most of their contour outside `is_hand` are of something beside the hand. None if no
    part is left, of at least `part_px`. Border following as in Suzuki & Abe, "Topological
    structural analysis of digitized binary images by border following", 1985.
    """
    mask = within.view(np.uint8) * np.uint8(255)
    contours, hierarchy = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    parts, small_holes = [], []
    for contour, (_, _, _, parent) in zip(contours, hierarchy[0] if contours else (), strict=True):
        area_px = cv2.contourArea(contour) if len(contour) > _LEAST_CONTOUR_PX else 0.0
        if parent >= 0:
            if area_px <= hole_area_px:
                small_holes.append(contour)
        elif area_px >= part_px:
            columns, rows = contour.reshape(-1, 2).T
            if is_hand[rows, columns].mean() >= _PART_MIN:
                parts.append(contour)
    if not parts:
        return None
    cv2.drawContours(mask, small_holes, -1, 255, cv2.FILLED)
    inside = np.zeros_like(mask)
    cv2.drawContours(inside, parts, -1, 255, cv2.FILLED)
    mask &= inside
    if len(parts) > 1:  # the gap that a depth jump leaves between two parts of a hand
        mask = np.asarray(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, NEIGHBOURS), np.uint8)
        parts = list(cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0])
    columns, rows = max(parts, key=cv2.contourArea).reshape(-1, 2).astype(np.intp).T
    return (rows, columns), mask


def _border_contact_px(surface: Bool, view: DepthView) -> int:
    """Count the pixels of the hand on the border of the whole image."""
    x0, y0, x1, y1 = view.box
    sides = (
        (y0 == 0, surface[0]),
        (y1 == view.camera.height, surface[-1]),
        (x0 == 0, surface[:, 0]),
        (x1 == view.camera.width, surface[:, -1]),
    )
    return sum(int(np.count_nonzero(side)) for at_border, side in sides if at_border)


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
    return _cloud(frame, _mask_hand(frame, located, settings), settings)


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


def _cloud(frame: Frame, hand: _HandMask, settings: SegmentSettings) -> HandCloud:
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
        is_cut=widened(hand.cut, round(settings.cut_band_m / hand.pitch_m))[chosen],
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
