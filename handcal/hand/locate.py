"""Locate the hand in a coarse depth image: its surface, its palm, and the start of the arm.

The palm is the largest inscribed circle near the end of a limb. A ball about its centre separates
the hand from the arm. It depends neither on the limb's direction nor on the visible length of the
forearm, so two frames of one hand are cut at the same place.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from handcal.errors import HandError
from handcal.hand.settings import SegmentSettings
from handcal.hand.surface import (
    NEIGHBOURS,
    component_of,
    components,
    goes_on,
    on_border,
    solid_surface,
)
from handcal.hand.view import DepthView, between, crop_view, deproject
from handcal.types import Bool, Float32, Float64

# Sizes of adult hands, with a margin (Gordon et al., 2012 Anthropometric Survey of U.S. Army
# Personnel: hand breadth 68–100 mm, hand length 165–220 mm). Seen from its edge the inscribed
# circle of a palm is about 20 mm in radius.
_PALM_RADIUS_M = (0.018, 0.065)
_TIP_M = 0.05
_TIP_TO_PALM_M = 0.15
_PALM_TO_ARM_M = 0.03
_PALM_TO_WRIST_MAX_M = 0.11
_HAND_REACH_M = 0.20
_AREA_MIN_M2 = 0.004
# The fall of the inscribed radius ends this close to its minimum, measured in shells of this
# thickness about the palm, in this cone about the arm, averaged over this many shells; the last
# value is the distance from there to the wrist.
_WRIST_NARROW = 1.1
_SHELL_M = 0.0025
_SMOOTH_SHELLS = 9
_ARMWARD_COS = 0.6
_WRIST_BEYOND_M = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class LocatedHand:
    """The place of the hand in a coarse depth image."""

    view: DepthView
    """The part of the image that holds the hand's surface."""
    hand: Bool
    arm: Bool
    """(h, w); the hand and the adjoining arm, in `view`."""
    palm_m: Float64
    """(3,); centre of the visible palm or back of the hand, camera frame."""
    palm_radius_m: float
    limit_m: float
    """Distance from `palm_m` to the start of the arm."""


def locate_hand(view: DepthView, settings: SegmentSettings) -> LocatedHand:
    """Find the nearest hand-sized end of a surface.

    Parameters
    ----------
    view : DepthView
        With a pitch of about 2 mm on a hand.
    settings : SegmentSettings

    Raises
    ------
    HandError
        If no such surface is found.
    """
    jump = round(settings.edge_jump_m / view.scale_m)
    solid = solid_surface(view.depth, jump)
    gated = solid & between(view, settings.depth_min_m, settings.depth_max_m)
    ends = on_border(gated) | goes_on(gated, solid & ~gated, view.depth, jump)
    radius_px = _inscribed_radius_px(view.depth > 0, solid)
    pitch = view.step_px / view.camera.fx

    found = None
    for surface in components(gated, _AREA_MIN_M2 / (pitch * settings.depth_max_m) ** 2):
        part, place = crop_view(view, surface, margin=3)
        radius_m = radius_px[place] * part.depth * np.float32(pitch * view.scale_m)
        located = _locate_on(part, surface[place], ends[place], radius_m, settings.forearm_m)
        nearest = found is None or located.palm_m[2] < found.palm_m[2]
        if nearest and _is_plausible(located, pitch):
            found = located
    if found is None:
        raise HandError(
            f"no hand-sized object between {settings.depth_min_m:.2f} and "
            f"{settings.depth_max_m:.2f} m; raise the bare hand in front of the camera"
        )
    return found


def _is_plausible(located: LocatedHand, pitch: float) -> bool:
    area_m2 = np.count_nonzero(located.hand) * (pitch * located.palm_m[2]) ** 2
    has_palm = _PALM_RADIUS_M[0] <= located.palm_radius_m <= _PALM_RADIUS_M[1]
    return bool(has_palm and area_m2 >= _AREA_MIN_M2)


def _locate_on(
    view: DepthView, surface: Bool, ends: Bool, radius_m: Float32, forearm_m: float
) -> LocatedHand:
    """Find palm and wrist on one surface, which continues out of view where `ends` is set."""
    rows, columns = np.ogrid[: surface.shape[0], : surface.shape[1]]
    points_m = deproject(view, rows, columns)
    arm_end = _arm_end(surface, ends, points_m, radius_m)
    tip_m = _farthest(surface, points_m, points_m[:, arm_end].mean(axis=1))
    near_tip = surface & (_distance(points_m, tip_m) < _TIP_TO_PALM_M)
    palm_m, palm_radius_m = _palm(near_tip, points_m, radius_m)

    from_palm_m = _distance(points_m, palm_m)
    arm = component_of(surface & (from_palm_m > palm_radius_m + _PALM_TO_ARM_M), arm_end)
    wrist_m = _palm_to_wrist(surface, arm, palm_m, points_m, from_palm_m, radius_m)
    limit_m = wrist_m + forearm_m
    arm = component_of(surface & (from_palm_m > limit_m), arm_end)
    if not (radius_m[arm] >= _PALM_RADIUS_M[0]).any():  # too thin for an arm: a finger
        arm = np.zeros_like(arm)
    hand = surface & ~arm & (from_palm_m < _HAND_REACH_M)
    return LocatedHand(view, hand, arm, palm_m.astype(np.float64), palm_radius_m, limit_m)


def _arm_end(surface: Bool, ends: Bool, points_m: Float32, radius_m: Float32) -> Bool:
    """Return where the arm leaves the view: the widest place at which the surface continues.

    If it continues nowhere, this is the thicker of the surface's two tips, as fingers are thin.
    """
    places = components(surface & ends)
    if places:
        return places[0]
    tip_m = points_m[:, surface].mean(axis=1)
    tips = []
    for _ in range(2):
        tip_m = _farthest(surface, points_m, tip_m)
        tips.append(surface & (_distance(points_m, tip_m) < _TIP_M))
    return max(tips, key=lambda tip: float(radius_m[tip].mean()))


def _farthest(surface: Bool, points_m: Float32, from_m: Float32) -> Float32:
    distance_m = np.where(surface, _distance(points_m, from_m), 0)
    farthest: Float32 = points_m.reshape(3, -1)[:, np.argmax(distance_m)]
    return farthest


def _palm(near_tip: Bool, points_m: Float32, radius_m: Float32) -> tuple[Float32, float]:
    """Return centre and radius of the largest inscribed circle."""
    inscribed_m = np.where(near_tip, radius_m, 0)
    best = np.unravel_index(np.argmax(inscribed_m), inscribed_m.shape)
    palm_radius_m = float(inscribed_m[best])
    # Averaged over the top of the distance map: a single pixel is too coarse for the cut.
    top = (inscribed_m > 0.95 * palm_radius_m) & (
        _distance(points_m, points_m[:, best[0], best[1]]) < palm_radius_m
    )
    return points_m[:, top].mean(axis=1), palm_radius_m


def _palm_to_wrist(
    surface: Bool,
    arm: Bool,
    palm_m: Float32,
    points_m: Float32,
    from_palm_m: Float32,
    radius_m: Float32,
) -> float:
    """Return the distance from the palm's centre to the wrist, along the arm.

    In shells about the palm the inscribed radius falls to that of the wrist, then grows along the
    forearm. The wrist is placed where the fall ends, because the minimum itself is too flat to be
    located repeatably.
    """
    near_palm = surface & (from_palm_m < _PALM_TO_WRIST_MAX_M)
    near_arm = arm & near_palm
    if not near_arm.any():
        return _PALM_TO_WRIST_MAX_M
    weight = radius_m[near_arm] ** 2  # a thumb next to the arm is thin
    axis = (points_m[:, near_arm] - palm_m[:, None]) @ weight
    axis /= np.linalg.norm(axis)
    along_axis_m = np.tensordot(axis, points_m, 1) - axis @ palm_m
    armward = near_palm & (along_axis_m > _ARMWARD_COS * from_palm_m)
    shell = (from_palm_m[armward] / _SHELL_M).astype(int)
    # Same type as radius_m: ufunc.at is thirty times slower otherwise.
    profile_m = np.zeros(1 + int(_PALM_TO_WRIST_MAX_M / _SHELL_M), radius_m.dtype)
    np.maximum.at(profile_m, shell, radius_m[armward])
    return _end_of_fall(profile_m.astype(np.float64)) * _SHELL_M + _WRIST_BEYOND_M


def _end_of_fall(profile_m: Float64) -> float:
    """Return the shell at which the smoothed profile has nearly fallen to its minimum."""
    kernel = np.ones(_SMOOTH_SHELLS)
    seen = np.convolve(profile_m > 0, kernel, "same")
    smooth_m = np.convolve(profile_m, kernel, "same") / np.maximum(seen, 1)
    smooth_m[profile_m == 0] = np.inf
    narrowest = int(np.argmin(smooth_m))
    level_m = _WRIST_NARROW * smooth_m[narrowest]
    wide = np.flatnonzero(smooth_m[:narrowest] > level_m)
    if not len(wide) or not np.isfinite(smooth_m[wide[-1]]):
        return narrowest + 0.5
    last = wide[-1]
    drop_m = smooth_m[last] - smooth_m[last + 1]
    return float(last + 0.5 + (smooth_m[last] - level_m) / drop_m)


def _inscribed_radius_px(measured: Bool, solid: Bool) -> Float32:
    """Return each pixel's distance in pixels to the surface's edge, pinholes closed."""
    closed = cv2.morphologyEx(solid.astype(np.uint8), cv2.MORPH_CLOSE, NEIGHBOURS)
    closed[measured & ~solid] = 0
    distance_px = cv2.distanceTransform(closed, cv2.DIST_L2, 5)
    return np.minimum(distance_px, np.float32(max(solid.shape)))  # infinite without an edge


def _distance(points_m: Float32, from_m: Float32) -> Float32:
    x_m, y_m, z_m = (axis_m - from_axis for axis_m, from_axis in zip(points_m, from_m, strict=True))
    distance_m: Float32 = np.sqrt(x_m * x_m + y_m * y_m + z_m * z_m)
    return distance_m
