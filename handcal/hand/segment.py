"""Segment the wearer's bare hand out of a depth image: mask, outer contour and cloud."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.errors import HandError
from handcal.geometry import camera_matrix, transform
from handcal.hand.locate import LocatedHand, locate_hand
from handcal.hand.surface import (
    NEIGHBOURS,
    behind_nearest,
    components,
    goes_on,
    on_border,
    solid_surface,
)
from handcal.hand.view import Box, DepthView, deproject, view_depth
from handcal.types import Bool, Float32, Frame, HandCloud, Intrinsics, UInt8

# The hand is located on a grid of about this pitch at this depth.
_COARSE_PITCH_M = 0.002
_COARSE_DEPTH_M = 0.5
# The hand's outline may touch the image border this much.
_BORDER_CONTACT_M = 0.01


@dataclass(frozen=True, slots=True)
class SegmentSettings:
    """How a hand is segmented.

    Attributes
    ----------
    depth_min_m, depth_max_m : float
        Depth gate: within arm's reach and the camera's range (paper, section on segmentation).
    edge_jump_m : float
        Neighbouring pixels this far apart in depth belong to different surfaces.
    flying_m : float
        A point this far behind a neighbour two pixels away is taken for a flying pixel.
    forearm_m : float
        How much of the forearm beyond the wrist counts as hand.
    cut_band_m : float
        Points this close to a cut edge are marked as cut.
    hole_area_m2 : float
        Holes in the hand up to this size are closed in the mask.
    roi_margin : float
        By how much a given region of interest is widened on each side, of its size: a detector's
        box ends at the wrist, but the way the arm leaves tells where the hand ends.
    points : int
        About how many points of the surface are kept.
    """

    depth_min_m: float = 0.35
    depth_max_m: float = 0.70
    edge_jump_m: float = 0.02
    flying_m: float = 0.01
    forearm_m: float = 0.02
    cut_band_m: float = 0.004
    hole_area_m2: float = 1e-4
    roi_margin: float = 0.25
    points: int = 5000


def segment_hand(frame: Frame, settings: SegmentSettings, roi_px: Box | None = None) -> HandCloud:
    """Find the hand in a frame.

    Parameters
    ----------
    frame : Frame
        Depth and, if there is any, colour: aligned or not, as the camera delivers them.
    settings : SegmentSettings
    roi_px : (x0, y0, x1, y1), optional
        Where a detector saw the hand, pixels of the depth image, x1 and y1 exclusive. Without it
        the nearest hand-sized thing in the whole image is taken.

    Returns
    -------
    HandCloud
        In frame D.

    Raises
    ------
    HandError
        If there is no hand, or the image does not show all of it.
    """
    camera = frame.depth_intrinsics
    window = _window(roi_px, camera, settings.roi_margin)
    step_px = max(1, round(_COARSE_PITCH_M * camera.fx / _COARSE_DEPTH_M))
    coarse = view_depth(frame, window, step_px)
    located = locate_hand(
        coarse,
        gate_m=(settings.depth_min_m, settings.depth_max_m),
        jump_m=settings.edge_jump_m,
        forearm_m=settings.forearm_m,
    )
    box, hand_region, arm_region = _full_resolution(located, coarse)
    view = view_depth(frame, box)
    solid = solid_surface(view.depth, round(settings.edge_jump_m / view.scale_m))
    surface = _hand_surface(view, settings, located, solid & hand_region, arm_region)
    return _cloud(frame, view, settings, solid, surface)


def _window(roi_px: Box | None, camera: Intrinsics, margin: float) -> Box:
    """Return the part of the image to look at."""
    if roi_px is None:
        return 0, 0, camera.width, camera.height
    x0, y0, x1, y1 = roi_px
    wider, higher = round(margin * (x1 - x0)), round(margin * (y1 - y0))
    x0, y0 = max(0, x0 - wider), max(0, y0 - higher)
    x1, y1 = min(camera.width, x1 + wider), min(camera.height, y1 + higher)
    if x0 >= x1 or y0 >= y1:
        raise ValueError(f"the region of interest {roi_px} is empty or outside the depth image")
    return x0, y0, x1, y1


def _full_resolution(located: LocatedHand, coarse: DepthView) -> tuple[Box, Bool, Bool]:
    """Return the hand's box in the image, and where in it the hand and the arm may be."""
    x, y, width, height = cv2.boundingRect(located.hand.astype(np.uint8))
    left, top = max(0, x - 2), max(0, y - 2)
    around = np.s_[top : y + height + 2, left : x + width + 2]
    x0, y0 = coarse.box[0] + left * coarse.step_px, coarse.box[1] + top * coarse.step_px
    regions = []
    for part in (located.hand, located.arm):
        region = cv2.dilate(part[around].astype(np.uint8), NEIGHBOURS) > 0
        region = region.repeat(coarse.step_px, axis=0).repeat(coarse.step_px, axis=1)
        regions.append(region[: coarse.box[3] - y0, : coarse.box[2] - x0])
    height, width = regions[0].shape
    return (x0, y0, x0 + width, y0 + height), regions[0], regions[1]


def _hand_surface(
    view: DepthView, settings: SegmentSettings, located: LocatedHand, region: Bool, arm: Bool
) -> Bool:
    """Return the largest surface within the gate and the forearm limit."""
    gate = np.array([settings.depth_min_m, settings.depth_max_m]) / view.scale_m
    within = region & (view.depth >= np.uint16(gate[0])) & (view.depth <= np.uint16(gate[1]))
    maybe_arm = np.nonzero(within & arm)
    points_m = deproject(view, *maybe_arm).T
    within[maybe_arm] = np.linalg.norm(points_m - located.palm_m, axis=1) <= located.limit_m
    return components(within)[0]


def _cloud(
    frame: Frame, view: DepthView, settings: SegmentSettings, solid: Bool, surface: Bool
) -> HandCloud:
    """Measure the hand's surface: its outline, its points, and which of them lie at a cut."""
    median_depth_m = float(np.median(view.depth[surface])) * view.scale_m
    pitch_m = median_depth_m / view.camera.fx
    jump = round(settings.edge_jump_m / view.scale_m)
    cut = on_border(surface) | goes_on(surface, solid & ~surface, view.depth, jump)
    _refuse_hand_cut_by_image(surface, view, pitch_m)

    flying = behind_nearest(view.depth, surface, 5) > round(settings.flying_m / view.scale_m)
    good = surface & ~flying
    chosen = np.nonzero(good & _even_choice(good.shape, settings.points / np.count_nonzero(good)))
    points_m = deproject(view, *chosen).T
    outline, mask = _outline(surface, settings.hole_area_m2 / pitch_m**2)
    outline = tuple(axis[good[outline]] for axis in outline)
    x0, y0, x1, y1 = view.box
    whole_mask = np.zeros(frame.depth.shape, np.uint8)
    whole_mask[y0:y1, x0:x1] = mask
    x, y, width, height = cv2.boundingRect(mask)
    return HandCloud(
        t_camera_ns=frame.t_camera_ns,
        t_host_ns=frame.t_host_ns,
        points_m=points_m,
        is_cut=_within(cut, settings.cut_band_m / pitch_m)[chosen],
        colors=_colors(frame, points_m),
        contour_m=deproject(view, *outline).T,
        contour_is_cut=cut[outline],
        mask=whole_mask,
        box_px=(x0 + x, y0 + y, x0 + x + width, y0 + y + height),
        median_depth_m=median_depth_m,
    )


def _refuse_hand_cut_by_image(surface: Bool, view: DepthView, pitch_m: float) -> None:
    """Raise HandError if the hand itself, not the forearm, runs out of the image."""
    x0, y0, x1, y1 = view.box
    contact = sum(
        np.count_nonzero(line)
        for line, at_border in (
            (surface[0], y0 == 0),
            (surface[-1], y1 == view.camera.height),
            (surface[:, 0], x0 == 0),
            (surface[:, -1], x1 == view.camera.width),
        )
        if at_border
    )
    if contact * pitch_m > _BORDER_CONTACT_M:
        raise HandError("hand cut by the image border; move it toward the middle")


def _outline(
    surface: Bool, hole_area_px: float
) -> tuple[tuple[NDArray[np.intp], NDArray[np.intp]], UInt8]:
    """Return the outer contour, rows and columns in order, and the mask with small holes closed.

    Borders are followed as in Suzuki & Abe, "Topological structural analysis of digitized binary
    images by border following", 1985.
    """
    mask = np.where(surface, np.uint8(255), np.uint8(0))
    contours, hierarchy = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    is_hole = hierarchy.reshape(-1, 4)[:, 3] >= 0
    small_holes = [
        contour
        for contour, hole in zip(contours, is_hole, strict=True)
        if hole and cv2.contourArea(contour) <= hole_area_px
    ]
    cv2.drawContours(mask, small_holes, -1, 255, cv2.FILLED)
    outer = contours[int(np.flatnonzero(~is_hole)[0])].reshape(-1, 2).astype(np.intp)
    return (outer[:, 1], outer[:, 0]), mask


def _even_choice(shape: tuple[int, ...], fraction: float) -> Bool:
    """Choose a fraction of an image's pixels, evenly.

    Thresholds a rank-1 lattice: Roberts, "The unreasonable effectiveness of quasirandom
    sequences", 2018 (R2), in 16-bit fractions.
    """
    rows = np.arange(shape[0], dtype=np.uint16) * np.uint16(37345)
    columns = np.arange(shape[1], dtype=np.uint16) * np.uint16(49472)
    chosen: Bool = rows[:, None] + columns <= np.uint16(min(fraction, 1.0) * 65535)
    return chosen


def _within(mask: Bool, distance_px: float) -> Bool:
    """Mark the pixels at most that far from one of `mask`."""
    apart_px = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 3)
    near: Bool = apart_px <= distance_px
    return near


def _colors(frame: Frame, points_m: Float32) -> UInt8 | None:
    """Look up the points' colours; black outside the colour image."""
    camera = frame.color_intrinsics
    if frame.color is None or camera is None:
        return None
    pixels, _ = cv2.projectPoints(
        transform(frame.T_C_D, points_m),
        np.zeros(3),
        np.zeros(3),
        camera_matrix(camera),
        np.array(camera.distortion),
    )
    columns, rows = np.rint(pixels.reshape(-1, 2)).astype(int).T
    seen = (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
    colors = np.zeros((len(points_m), 3), np.uint8)
    colors[seen] = frame.color[rows[seen], columns[seen]]
    return colors
