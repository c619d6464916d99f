"""Locate the hand in a coarse depth image: its surface, its palm, and the wrist.

The palm is the largest inscribed circle near the end of a limb, or in a detector's box. The wrist
is the narrowest place beyond it along the forearm. Both are means over all candidates, weighted by
how well they fit, so that they vary continuously with the image: no single pixel decides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.errors import HandError, OutOfViewError
from handcal.core.types import Bool, Float32, Float64
from handcal.hand.settings import NEARER_M, SegmentSettings
from handcal.hand.view import (
    NEIGHBOURS,
    Box,
    DepthView,
    Pixels,
    between,
    covered,
    crop_view,
    deproject,
    gate_problem,
    goes_on,
    on_border,
    pixels_of,
    solid_surface,
    widened,
)

_LEAST_COS = 0.5  # of the angle between the axis and the image plane
# Where the wrist is expected along the axis, from the palm's centre: the palm is 95 to 120 mm long
# (see the survey in locate.py), and an inscribed circle of 40 to 45 mm in radius touches its upper
# end.
_WRIST_M, _WRIST_SIGMA_M = 0.065, 0.02
# Inscribed radius of a palm seen from its edge, and of one seen from the front. Seen from its edge
# a hand is about as wide everywhere, so that neither the palm's centre nor the width says much.
EDGE_RADIUS_M, FACING_RADIUS_M = 0.018, 0.034
_SIGMA_MORE, _WIDTH_SCALE_MORE = 2.0, 2.0
# A detector's box ends at the wrist or up to _BEHIND_M behind it, with these errors in the image.
_BEYOND_BOX_M, _BEHIND_M, _BEHIND_SIGMA_M = 0.02, 0.03, 0.03
# Weight of the places that the palm or the box rules out: both are sometimes mistaken.
_MISTAKEN = 0.01
# The limb's width along the axis, in bins of this size, smoothed; a place this much wider than
# another is e times less likely the wrist.
_BIN_M, _SMOOTH_M, _WIDTH_SCALE_M = 0.0025, 0.004, 0.006
_PROFILE_M = (-0.035, 0.175)
# A narrower limb is no arm, as a finger is 24 mm wide; but none reaches to the profile's end.
_LIMB_WIDTH_M, _NOTHING_M = 0.03, 0.005
# From the wrist to the elbow an arm widens, but slowly: nowhere behind the wrist is it this much
# narrower, nor this much wider within so many bins. A wrist seen from its edge is 36 mm wide.
_NARROWER_M, _WIDER_M, _SHORTLY, _WRIST_WIDTH_M = 0.01, 0.025, 16, 0.036
_MISFIT_SCALE_M = 0.003  # a place that misses this by as much is e times less likely
# Where the arm leaves the view it is cut off at an angle; where it ends in view it is rounded.
_END_M, _ROUNDED_M = 0.005, 0.02
# The surface of a wrist is this far from its middle, toward the camera. The narrowest place is this
# far behind the wrist.
_HALF_THICKNESS_M, _NARROWEST_M = 0.017, 0.004
# An adult's palm has this inscribed radius. Which end of a limb is the hand is decided in units of
# the palm found there, for hands of these sizes; its centre is the less certain.
_USUAL_RADIUS_M, _SIZES, _FIT_SIGMA_M = 0.038, (0.5, 1.3), 0.03
_NEVER = 1e-30

_SMOOTHING = np.exp(-0.5 * (np.arange(-6, 7) * _BIN_M / _SMOOTH_M) ** 2)
_SMOOTHING /= _SMOOTHING.sum()
_BINS = round((_PROFILE_M[1] - _PROFILE_M[0]) / _BIN_M)
_AT_M = np.asarray(
    _PROFILE_M[0] + _BIN_M * (np.arange(_BINS - len(_SMOOTHING) + 1) + 0.5 * len(_SMOOTHING)),
    np.float64,
)


def _arm_fit(
    from_palm_m: Float32,
    area_m2: Float32,
    at_end: Bool,
    palm_m: Float32,
    palm_radius_m: float,
    axis: Float32,
) -> float:
    """Return how well a limb fits a forearm behind a wrist behind a palm: the log of a likelihood.

    It is that of all places of the wrist together, in units of the palm's size: a limb that begins
    with a forearm does not become narrower, and then suddenly wider. NaN if the axis points along
    the line of sight, so that nothing behind the palm is seen in its width. The parameters are
    those of `find_wrist_m`.
    """
    cosine = _cosine(axis, palm_m)
    if cosine <= _LEAST_COS:
        return np.nan
    size = float(np.clip(palm_radius_m / _USUAL_RADIUS_M, *_SIZES))
    along_m = axis @ from_palm_m / np.float32(size)
    width_m = _width_m(along_m, area_m2 / np.float32(size**2), cosine)
    likely = _gaussian(_AT_M - _WRIST_M, _FIT_SIGMA_M) + _MISTAKEN
    likely /= likely.sum()
    misfit_m = _misfit_m(width_m, _AT_M, along_m[at_end])
    likely *= np.exp(-width_m / _WIDTH_SCALE_M - misfit_m / _MISFIT_SCALE_M)
    likely *= np.minimum(width_m / _WRIST_WIDTH_M, 1.0) ** 4
    return float(np.log(likely.sum() + _NEVER))


def _box_exit_m(view: DepthView, box: Box, palm_m: Float32, axis: Float32) -> float:
    """Return the distance from the palm along the axis to the side of a box in the image."""
    camera = view.camera
    sides = (
        (0, (box[0] - camera.cx) / camera.fx),
        (1, (box[1] - camera.cy) / camera.fy),
        (0, (box[2] - camera.cx) / camera.fx),
        (1, (box[3] - camera.cy) / camera.fy),
    )
    rates = [float(axis[k] - tangent * axis[2]) for k, tangent in sides]
    gaps_m = [float(tangent * palm_m[2] - palm_m[k]) for k, tangent in sides]
    exits_m = (gap / rate for gap, rate in zip(gaps_m, rates, strict=True) if abs(rate) > 1e-6)
    return min((exit_m for exit_m in exits_m if exit_m > 0.0), default=np.inf)


def find_wrist_m(
    from_palm_m: Float32,
    area_m2: Float32,
    at_end: Bool,
    palm_m: Float32,
    palm_radius_m: float,
    axis: Float32,
    exit_m: float,
) -> tuple[float, float]:
    """Return the distance of the wrist from the palm along the axis, and its standard deviation.

    Infinite and zero without an arm. The standard deviation is infinite if the arm points along the
    line of sight.

    Parameters
    ----------
    from_palm_m : (3, N) float32
        Points of the limb's surface relative to the palm's centre, camera frame.
    area_m2 : (N,) float32
        Of the points, across the line of sight.
    at_end : (N,) bool
        Where the surface continues out of view.
    palm_m : (3,) float32
    palm_radius_m : float
    axis : (3,) float32
        From the palm to the elbow.
    exit_m : float
        Where the axis leaves the detector's box; infinite without one.
    """
    along_m, at_m = axis @ from_palm_m, _AT_M
    cosine = _cosine(axis, palm_m)
    width_m = _width_m(along_m, area_m2, cosine)
    if width_m[at_m > _WRIST_M].max() < _LIMB_WIDTH_M:
        return np.inf, np.inf if width_m[-1] > _NOTHING_M else 0.0
    edgewise = float(np.interp(palm_radius_m, (EDGE_RADIUS_M, FACING_RADIUS_M), (1.0, 0.0)))
    likely = _gaussian(at_m - _WRIST_M, _WRIST_SIGMA_M * (1.0 + _SIGMA_MORE * edgewise)) + _MISTAKEN
    likely *= _gaussian(np.maximum(at_m - exit_m, 0.0) * cosine, _BEYOND_BOX_M) + _MISTAKEN
    if exit_m < np.inf:
        before_m = np.maximum(exit_m - _BEHIND_M - at_m, 0.0) * cosine
        likely *= _gaussian(before_m, _BEHIND_SIGMA_M) ** edgewise
    likely *= np.exp(-width_m / (_WIDTH_SCALE_M * (1.0 + _WIDTH_SCALE_MORE * edgewise)))
    likely *= np.exp(-_misfit_m(width_m, at_m, along_m[at_end]) / _MISFIT_SCALE_M)
    likely *= np.minimum(width_m / _WRIST_WIDTH_M, 1.0) ** 4
    likely /= max(float(likely.sum()), 1e-300)
    wrist_m = float(likely @ at_m)
    sigma_m = float(np.sqrt(likely @ (at_m - wrist_m) ** 2))
    # The outline shows where the wrist's middle is; on the line of sight to it, the surface is
    # nearer, and so elsewhere along the axis.
    return (
        wrist_m + _HALF_THICKNESS_M * _forward(axis, palm_m) / cosine - _NARROWEST_M,
        sigma_m if cosine > _LEAST_COS else np.inf,
    )


def _forward(axis: Float32, palm_m: Float32) -> float:
    """Return the cosine of the angle between the axis and the line of sight."""
    return float(axis @ palm_m) / max(float(np.linalg.norm(palm_m)), 1e-9)


def _cosine(axis: Float32, palm_m: Float32) -> float:
    """Return the cosine of the angle between the axis and the image plane, at least one half."""
    return max(_LEAST_COS, float(np.sqrt(max(0.0, 1.0 - _forward(axis, palm_m) ** 2))))


def _width_m(along_m: Float32, area_m2: Float32, cosine: float) -> Float64:
    """Return a limb's width at each place of the profile.

    Seen at an angle, a limb's length is foreshortened, and so is its area.
    """
    place = np.floor((along_m - _PROFILE_M[0]) / _BIN_M).astype(int)
    kept = (place >= 0) & (place < _BINS)
    width_m = np.bincount(place[kept], area_m2[kept], _BINS) / (_BIN_M * cosine)
    return np.convolve(width_m, _SMOOTHING, "valid")


def _misfit_m(width_m: Float64, at_m: Float64, ends_m: Float32) -> Float64:
    """Return by how much the limb behind each place differs from a forearm behind a wrist.

    The difference is what it is narrower anywhere behind, and wider shortly behind, than a forearm
    may be.
    """
    last_m = float(at_m[width_m > _NOTHING_M].max(initial=0.0)) - _ROUNDED_M
    end_m = float(ends_m[ends_m > 0.0].min(initial=last_m)) - _END_M
    is_arm = (at_m < end_m) & (width_m > _WRIST_WIDTH_M)
    narrowest_m = np.minimum.accumulate(np.where(is_arm, width_m, np.inf)[::-1])[::-1]
    widest_m = cv2.dilate(width_m, np.ones(_SHORTLY, np.uint8), anchor=(0, 0)).ravel()
    misfit_m: Float64 = np.maximum(width_m - narrowest_m - _NARROWER_M, 0.0)
    misfit_m += np.maximum(widest_m - width_m - _WIDER_M, 0.0)
    return misfit_m


def _gaussian(deviation_m: Float64, sigma_m: float) -> Float64:
    return np.asarray(np.exp(-0.5 * (deviation_m / sigma_m) ** 2), np.float64)


# Sizes of adult hands, with a margin (Gordon et al., 2012 Anthropometric Survey of U.S. Army
# Personnel: hand breadth 68–100 mm, hand length 165–220 mm). Seen from its edge the inscribed
# circle of a palm is about 20 mm in radius.
_PALM_RADIUS_M, _FINGER_RADIUS_M = (0.018, 0.065), 0.012
_TIP_M = 0.05
_TIP_TO_PALM_M = 0.15
_HAND_REACH_M = 0.20
_AREA_MIN_M2 = 0.004
# The palm is the mean of the places whose inscribed radius is nearly the largest, weighted by the
# excess over this share of it.
_PALM_TOP = 0.75
_PALM_SIGMA_M, _PALM_STEPS = 0.04, 2
# The forearm's axis runs from the palm to the mean of the arm about this distance from it.
_ARM_M, _ARM_SIGMA_M = 0.11, 0.025
_AXIS_STEPS = 3
# The hand is at the end behind which a limb fits a forearm, and whose opposite end is the thicker
# (around its tip, with this sigma; with this power of the ratio). Each counts for e^3 at most, so
# that neither overrules the other. The end must be this much the likelier one (a log), unless both
# lead to the same palm.
_THICKER, _COUNTS, _SAME_PALM_M, _SURE = 10.0, 3.0, 0.04, 1.3
_THICKNESS_SIGMA_M = 0.03
# As much speaks for the end that leaves the image, over more than the width of a finger or two.
_LEAVES_M = 0.025
_ARM_RADIUS_M = 0.014  # a narrower limb is no arm; a finger is 24 mm wide
# A part of the hand that depth jumps or missing pixels separate from it, such as a bent finger.
_GAP_M, _JUMP_M = 0.015, 0.05
# One no larger than a finger may be as far before or behind as a finger is long.
_FINGER_M2, _FINGER_M = 0.002, 0.08
# Gaps that are closed before circles are inscribed, to each side.
_CLOSED_M = 0.0035
PART_M2 = 5e-5
"""Least area of such a part."""
# A detector's box weighs places by their distance from its middle, with this share of its sides as
# sigma; what this share of the pixels near the middle is behind by a hand's thickness is not seen.
_BOX_SIGMA, _IN_BOX, _NEAREST, _LAYER_M = 0.35, 0.35, 0.1, 0.12
_ARM_IN_BOX_MAX = 0.25

# With a larger standard deviation the wrist is not known well enough for a cut: of a palm seen from
# its edge, and from the front. A palm with a smaller inscribed circle is seen from its edge.
_LIMIT_SIGMAS_M, _FROM_EDGE_M = (0.026, 0.03), 0.03
# Unless the fingers reach less far beyond the palm's centre than this multiple of its radius (1.6
# to 2.9 of an open hand that faces the camera): then it may as well be small.
_SHORT = 2.8
# Length of the outline with something this far before it: about a palm's breadth if a thing hides
# half of the hand; by stray pixels it was 45 mm at most.
_COVERED_MAX_M, _COVER_JUMP_M = 0.065, 0.03
# A hand that leaves the depth gate along more than this length of its edge, half a finger's width,
# may go on beyond it, and does if more than this share of the whole hand is beyond. With more than
# that share beyond it is refused.
_ALONG_GATE_M, _BEYOND_MIN, _BEYOND_MAX = 0.008, 0.01, 0.5
# Within and without the gate it is the same hand if neither palm nor area differs by more.
_FAR_UNIT = 2.0  # with nothing nearer than so many times the gate's end its unit may be wrong
_ONE_HAND_M, _ONE_HAND_AREA = 0.01, 0.03
# What is wrong, and what to do about it.
_TURN = "turn its palm or its back to the camera"
_NOT_A_HAND = (
    "what the detector takes for a hand is not shaped like one in the depth image",
    "show the whole bare hand, clear of other things",
)
_TOO_SMALL = (
    "the hand is too small, or only a part of it is seen in the depth image",
    "show the whole bare hand, clear of other things",
)
_SMALL_OR_FROM_EDGE = "the hand is smaller than a six-year-old's, or seen from its edge", _TURN
_FROM_EDGE = "the hand is seen from its edge", _TURN
_EITHER_END = (
    "the hand cannot be told from the arm in the depth image",
    f"{_TURN}, spread the fingers, and show more of the arm",
)
_NO_WRIST = (
    "the wrist cannot be found in the depth image",
    "turn the palm or the back of the hand to the camera",
)

Labels: TypeAlias = NDArray[np.int32]


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
    axis: Float64
    """(3,); direction of the forearm, from hand to elbow."""
    limit_m: float
    """Distance from `palm_m` along `axis` to the start of the arm; infinite if none is seen."""
    limit_sigma_m: float
    """Standard deviation of the wrist along `axis`; infinite if an arm points along the line of
    sight."""
    gate_m: tuple[float, float]
    """Nearest and farthest depth at which it was looked for."""
    leaves_gate: bool = False
    """True if the hand's surface goes on beyond that gate."""
    is_sure: bool = True
    """True if it does not, and without a box no surface before the gate may be the hand."""
    end_log_odds: float = np.inf
    """Log of how much more the hand is at this end of its limb than at the other one."""


@dataclass(frozen=True, slots=True, eq=False)
class _Parts:
    """Connected parts of the surface within the depth gate, on the coarse grid."""

    view: DepthView
    labels: Labels
    """(h, w); number of each pixel's part, 0 outside."""
    stats: Labels
    """(N, 5); as `cv2.connectedComponentsWithStats` gives them, the background's first."""
    ends: Bool
    borders: Bool
    leaves: Bool
    """(h, w); where the surface continues out of view, and where that is the border of the view, or
    beyond the gate."""


@dataclass(frozen=True, slots=True, eq=False)
class _Limb:
    """A surface that may be a hand with its arm, on the coarse grid; N pixels."""

    view: DepthView
    pixels: Pixels
    points_m: Float32
    """(3, N)"""
    radius_m: Float32
    """(N,); inscribed radius of the limb's silhouette."""
    at_end: Bool
    """(N,); where the surface continues out of view."""
    border_m: float
    """Length of its edge on the border of the view."""


def locate_hand(view: DepthView, settings: SegmentSettings, box: Box | None = None) -> LocatedHand:
    """Find the hand in a box, or else the nearest hand-sized end of a surface.

    A hand of which a part lies beyond the depth gate is found whole.

    Parameters
    ----------
    view : DepthView
        With a pitch of about 2 mm on a hand.
    settings : SegmentSettings
    box : Box, optional
        Of a detected hand, in the whole image. That hand may be `NEARER_M` nearer than the gate.

    Raises
    ------
    HandError
        If no such surface is found, or most of the hand lies beyond the gate.
    """
    near_m = settings.depth_min_m - (0.0 if box is None else NEARER_M)
    gate_m = near_m, settings.depth_max_m
    located: LocatedHand | None = None
    try:
        located = _locate_within(gate_m, view, settings, box)
        if located.is_sure:
            return located
        problem = None
    except HandError as error:
        problem = error
    try:
        wide_m = near_m - _HAND_REACH_M, settings.depth_max_m + _HAND_REACH_M
        whole = _locate_within(wide_m, view, settings, box)
    except HandError as error:
        if located is not None and not located.leaves_gate:
            return located
        raise problem or error from None
    depth_m = whole.view.depth[whole.hand] * whole.view.scale_m
    if not gate_problem(depth_m, gate_m, _BEYOND_MIN):
        if problem is not None:
            raise problem
        return located if located is not None and _are_one(located, whole) else whole
    if move := gate_problem(depth_m, gate_m, 0.0 if whole.leaves_gate else _BEYOND_MAX):
        hint = "" if box else _unit_hint(view, settings)
        raise OutOfViewError(move.what, move.advice + hint)
    return whole


def _locate_within(
    gate_m: tuple[float, float], view: DepthView, settings: SegmentSettings, box: Box | None
) -> LocatedHand:
    """Find the hand within a range of depths."""
    jump = round(settings.edge_jump_m / view.scale_m)
    solid = solid_surface(view.depth, jump)
    gated = solid & between(view, *gate_m)
    borders = on_border(gated)
    beyond = solid & ~gated
    leaves = goes_on(gated, beyond, view.depth, jump)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(gated.view(np.uint8), connectivity=8)
    parts = _Parts(view, np.asarray(labels), np.asarray(stats), borders | leaves, borders, leaves)
    if box is not None:
        within = _within(view, box)
        chosen = _seen_part(parts, within)
        candidates = [] if chosen is None else [chosen]
    else:
        within = None
        least_px = _AREA_MIN_M2 / (_pitch(view) * gate_m[1]) ** 2
        areas = parts.stats[:, cv2.CC_STAT_AREA]
        candidates = [part for part in range(1, len(areas)) if areas[part] >= least_px]

    found, problem = None, _NOT_A_HAND
    for part in candidates:
        limb, place = _limb(parts, part)
        likely = None if within is None else within[place][limb.pixels]
        located = _locate_on(limb, likely, box, settings, gate_m)
        nearest = found is None or located.palm_m[2] < found.palm_m[2]
        if nearest and _is_plausible(located):
            found, edge = located, parts.leaves[place]
            if within is not None:
                _check_arm(located, within[place])
        elif _FINGER_RADIUS_M < located.palm_radius_m < _PALM_RADIUS_M[0]:
            problem = _FROM_EDGE
        elif _has_palm(located):
            problem = _TOO_SMALL
    if found is None and box is not None:
        raise HandError(*problem)
    if found is None:
        raise HandError(
            f"no hand-sized object between {settings.depth_min_m:.2f} and "
            f"{settings.depth_max_m:.2f} m",
            f"raise the bare hand in front of the camera{_unit_hint(view, settings)}",
        )
    _check_wrist(found)
    _check_covered(found)
    edge_px = _ALONG_GATE_M / (_pitch(view) * float(found.palm_m[2]))
    leaves_gate = bool(np.count_nonzero(found.hand & edge) > edge_px)
    is_sure = not leaves_gate
    if box is None and is_sure:
        nearer_px = np.count_nonzero(beyond & between(view, 0.0, gate_m[0]))
        is_sure = bool(nearer_px * (_pitch(view) * gate_m[0]) ** 2 < _AREA_MIN_M2)
    return replace(found, leaves_gate=leaves_gate, is_sure=is_sure)


def _are_one(located: LocatedHand, other: LocatedHand) -> bool:
    """Return whether two results in one image are the same hand."""
    areas = [np.count_nonzero(hand.hand) for hand in (located, other)]
    apart_m = float(np.linalg.norm(located.palm_m - other.palm_m))
    return apart_m < _ONE_HAND_M and bool(min(areas) > (1.0 - _ONE_HAND_AREA) * max(areas))


def _unit_hint(view: DepthView, settings: SegmentSettings) -> str:
    """Return whether all depths suggest a wrong unit: most rooms begin behind a raised hand."""
    measured = view.depth[view.depth > 0]
    if not len(measured):
        return ""
    nearest_m, farthest_m = np.quantile(measured, [0.02, 0.98]) * view.scale_m
    if nearest_m > _FAR_UNIT * settings.depth_max_m:
        where = f"nearer than {nearest_m:.1f} m"
    elif farthest_m < settings.depth_min_m:
        where = f"farther than {farthest_m:.2f} m"
    else:
        return ""
    return f" (nothing is measured {where}: if a hand is in view, correct the unit of depth)"


def _pitch(view: DepthView) -> float:
    """Return the distance of neighbouring pixels of a view at a depth of 1 m."""
    return view.step_px / view.camera.fx


def _is_plausible(located: LocatedHand) -> bool:
    area_m2 = np.count_nonzero(located.hand) * (_pitch(located.view) * located.palm_m[2]) ** 2
    return bool(_has_palm(located) and area_m2 >= _AREA_MIN_M2)


def _has_palm(located: LocatedHand) -> bool:
    return _PALM_RADIUS_M[0] <= located.palm_radius_m <= _PALM_RADIUS_M[1]


def _check_wrist(located: LocatedHand) -> None:
    """Raise HandError if it is too uncertain at which end the hand is, and where the wrist."""
    if located.limit_sigma_m == np.inf:
        raise HandError(
            "the arm points along the camera's line of sight",
            "raise the hand so that its palm or its back faces the camera",
        )
    seen_m = (EDGE_RADIUS_M, FACING_RADIUS_M)
    if located.limit_sigma_m > np.interp(located.palm_radius_m, seen_m, _LIMIT_SIGMAS_M):
        if located.palm_radius_m >= _FROM_EDGE_M:
            raise HandError(*_NO_WRIST)
        points_m = deproject(located.view, *pixels_of(located.hand)).T
        reach_m = -np.percentile((points_m - located.palm_m) @ located.axis, 1.0)
        is_short = reach_m < _SHORT * located.palm_radius_m
        raise HandError(*(_SMALL_OR_FROM_EDGE if is_short else _FROM_EDGE))
    if located.end_log_odds < _SURE:
        raise HandError(*_EITHER_END)


def _check_covered(located: LocatedHand) -> None:
    """Raise HandError if much of the hand's outline is that of something before it."""
    view, hand = located.view, located.hand
    other = (view.depth > 0) & ~(hand | located.arm)
    jump = round(_COVER_JUMP_M / view.scale_m)
    # The surface ends one pixel beside what is before it, so one of two is marked.
    most_px = _COVERED_MAX_M / (_pitch(view) * float(located.palm_m[2]))
    if np.count_nonzero(covered(hand, other, view.depth, jump)) <= most_px:
        return
    # Without stray pixels.
    other = cv2.morphologyEx(other.view(np.uint8), cv2.MORPH_OPEN, NEIGHBOURS).view(bool)
    if np.count_nonzero(covered(hand, other, view.depth, jump)) > most_px:
        raise HandError(
            "part of the hand is hidden behind something",
            "hold it clear of other things",
        )


def _check_arm(located: LocatedHand, within: Float32) -> None:
    """Raise HandError if much of what is in the middle of a hand's box would be arm."""
    arm, hand = (float(within[part].sum()) for part in (located.arm, located.hand))
    if arm > _ARM_IN_BOX_MAX * (arm + hand):
        raise HandError(*_NO_WRIST)


def _within(view: DepthView, box: Box) -> Float32:
    """Return how well each pixel of a view lies within a box: 1 in its middle, (h, w)."""
    height, width = view.depth.shape
    across, down = (
        np.exp(-0.5 * ((low + view.step_px * np.arange(count) - middle) / sigma) ** 2)
        for low, count, middle, sigma in (
            (view.box[0], width, (box[0] + box[2]) / 2, _BOX_SIGMA * (box[2] - box[0])),
            (view.box[1], height, (box[1] + box[3]) / 2, _BOX_SIGMA * (box[3] - box[1])),
        )
    )
    within: Float32 = down.astype(np.float32)[:, None] * across.astype(np.float32)
    return within


def _seen_part(parts: _Parts, within: Float32) -> int | None:
    """Return the part that fills the middle of a box, of those nearest in it."""
    in_box = np.flatnonzero((within > _IN_BOX) & (parts.labels > 0))
    if not len(in_box):
        return None
    depth = parts.view.depth.ravel()[in_box]
    rank = int(_NEAREST * len(depth))
    nearest = depth < np.partition(depth, rank)[rank] + _LAYER_M / parts.view.scale_m
    chosen = in_box[nearest]
    labels, weights = parts.labels.ravel()[chosen], within.ravel()[chosen]
    return int(np.argmax(np.bincount(labels, weights)))


def _limb(parts: _Parts, main: int) -> tuple[_Limb, tuple[slice, slice]]:
    """Return a part with those that belong to the same limb, and its place in the view."""
    view = parts.view
    surface = parts.labels == main
    pitch_m = _pitch(view) * float(view.depth[surface].mean()) * view.scale_m
    size_px = parts.stats[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1)
    areas_m2 = parts.stats[:, cv2.CC_STAT_AREA] * pitch_m**2
    may_join = areas_m2 >= PART_M2
    may_join &= size_px <= _HAND_REACH_M / pitch_m
    may_join[[0, main]] = False
    if may_join.any():
        jump_m = np.where(areas_m2 <= _FINGER_M2, _FINGER_M, _JUMP_M)
        surface = _joined(parts, surface, may_join, max(1, round(_GAP_M / pitch_m)), jump_m)
    part_view, place = crop_view(view, surface, margin=3)
    surface = np.ascontiguousarray(surface[place])
    closed = cv2.morphologyEx(
        surface.view(np.uint8),
        cv2.MORPH_CLOSE,
        NEIGHBOURS,
        iterations=max(1, round(_CLOSED_M / pitch_m)),
    )
    pixels = pixels_of(surface)
    points_m = deproject(part_view, *pixels)
    # Infinite without an edge.
    radius_px = np.minimum(cv2.distanceTransform(closed, cv2.DIST_L2, 5)[pixels], max(closed.shape))
    radius_m = radius_px * points_m[2] * np.float32(_pitch(view))
    border_m = pitch_m * np.count_nonzero(parts.borders & (parts.labels == main))
    return _Limb(part_view, pixels, points_m, radius_m, parts.ends[place][pixels], border_m), place


def _joined(parts: _Parts, surface: Bool, may_join: Bool, gap_px: int, jump_m: Float64) -> Bool:
    """Return a surface with those parts beside it that are no more than `jump_m`, (N,), off it."""
    view, is_limb = parts.view, np.zeros(len(parts.stats), bool)
    near = widened(surface, gap_px)
    beside = np.bincount(parts.labels[near], minlength=len(parts.stats)) > 0
    for part in np.flatnonzero(may_join & beside):
        other = near & (parts.labels == part)
        opposite = surface & widened(other, gap_px)
        jump = view.depth[other].mean() - view.depth[opposite].mean()
        is_limb[part] = abs(jump) * view.scale_m <= jump_m[part]
    return surface | is_limb[parts.labels]


def _locate_on(
    limb: _Limb,
    likely: Float32 | None,
    box: Box | None,
    settings: SegmentSettings,
    gate_m: tuple[float, float],
) -> LocatedHand:
    """Find palm and wrist on one surface; the palm where `likely` (N,), or near its tip."""
    points_m = limb.points_m
    area_m2 = (np.float32(_pitch(limb.view)) * points_m[2]) ** 2
    if likely is None:
        palm_m, palm_radius_m, axis, end_log_odds = _hand_end(limb, area_m2)
    else:
        end_log_odds = np.inf
        palm_m, palm_radius_m = _palm(limb, likely)
        axis = _axis(points_m - palm_m[:, None], area_m2, _arm_end(limb) - palm_m)
    from_palm_m = points_m - palm_m[:, None]
    exit_m = np.inf if box is None else _box_exit_m(limb.view, box, palm_m, axis)
    wrist_m, wrist_sigma_m = find_wrist_m(
        from_palm_m, area_m2, limb.at_end, palm_m, palm_radius_m, axis, exit_m
    )
    limit_m = wrist_m + settings.forearm_m
    is_arm = axis @ from_palm_m > limit_m
    if not (limb.radius_m[is_arm] >= _ARM_RADIUS_M).any():  # too thin for an arm: fingers
        is_arm, limit_m = np.zeros_like(is_arm), np.inf
    hand, arm = (np.zeros(limb.view.depth.shape, bool) for _ in range(2))
    hand[limb.pixels] = ~is_arm & (_distance(points_m, palm_m) < _HAND_REACH_M)
    arm[limb.pixels] = is_arm
    return LocatedHand(
        limb.view,
        hand,
        arm,
        palm_m.astype(np.float64),
        palm_radius_m,
        axis.astype(np.float64),
        limit_m,
        wrist_sigma_m,
        gate_m,
        end_log_odds=end_log_odds,
    )


def _hand_end(limb: _Limb, area_m2: Float32) -> tuple[Float32, float, Float32, float]:
    """Return palm, its radius, the forearm's axis and `end_log_odds` at the hand's end of a limb.

    Either end may be it: fingers can be thicker than what is seen of the arm, and a hand may reach
    out of the depth gate as an arm does.
    """
    points_m = limb.points_m
    found: list[tuple[Float32, float, Float32]] = []
    scores = []
    for end_m, thickness_m in _ends(limb):
        likely = _distance(points_m, _farthest(limb, end_m)) < _TIP_TO_PALM_M
        palm_m, radius_m = _palm(limb, likely.astype(np.float32))
        from_palm_m = points_m - palm_m[:, None]
        axis = _axis(from_palm_m, area_m2, end_m - palm_m)
        fit = _arm_fit(from_palm_m, area_m2, limb.at_end, palm_m, radius_m, axis)
        found.append((palm_m, radius_m, axis))
        scores.append((fit, _THICKER * float(np.log(thickness_m))))
    fits, thicker = np.subtract(scores[0], scores[1]).clip(-_COUNTS, _COUNTS).tolist()
    if float(np.linalg.norm(found[0][0] - found[1][0])) < _SAME_PALM_M:
        return *found[thicker < 0.0 and not limb.at_end.any()], np.inf
    leaves = _COUNTS if limb.border_m > _LEAVES_M else 0.0
    log_odds = (0.0 if np.isnan(fits) else fits) + thicker + leaves
    return *found[log_odds < 0.0], abs(log_odds)


def _arm_end(limb: _Limb) -> Float32:
    """Return where the arm leaves the view, or else the thicker of the limb's two tips."""
    if limb.at_end.any():
        return _leaves_m(limb)
    return max(_ends(limb), key=lambda end: end[1])[0]


def _ends(limb: _Limb) -> list[tuple[Float32, float]]:
    """Return a limb's two tips, each with its thickness.

    If the limb continues out of view, the first is where it does.
    """
    tip_m = limb.points_m.mean(axis=1)
    ends = []
    for _ in range(2):
        tip_m = _farthest(limb, tip_m)
        near = _distance(limb.points_m, tip_m) < _TIP_M
        end_m = np.asarray(limb.points_m[:, near].mean(axis=1), np.float32)
        ends.append((end_m, _thickness_m(limb, tip_m)))
    if limb.at_end.any():
        leaves_m = _leaves_m(limb)
        ends.sort(key=lambda end: float(np.linalg.norm(end[0] - leaves_m)))
        ends[0] = leaves_m, ends[0][1]
    return ends


def _leaves_m(limb: _Limb) -> Float32:
    """Return the mean of the places where a limb continues out of view.

    Wide places count more, as fingers are thin.
    """
    weight = limb.radius_m[limb.at_end] ** 2 + np.float32(1e-9)
    return np.asarray(limb.points_m[:, limb.at_end] @ weight / weight.sum(), np.float32)


def _thickness_m(limb: _Limb, around_m: Float32) -> float:
    """Return the mean inscribed radius around a place."""
    weight = np.exp(-0.5 * (_distance(limb.points_m, around_m) / _THICKNESS_SIGMA_M) ** 2)
    return float(weight @ limb.radius_m / max(float(weight.sum()), 1e-12))


def _farthest(limb: _Limb, from_m: Float32) -> Float32:
    farthest: Float32 = limb.points_m[:, np.argmax(_distance(limb.points_m, from_m))]
    return farthest


def _palm(limb: _Limb, likely: Float32) -> tuple[Float32, float]:
    """Return centre and radius of the palm: the mean place of nearly the largest circles.

    It is looked for where it is likely, then near the one found, so that it depends on the limb.
    """
    inner = limb.radius_m > _PALM_TOP * (limb.radius_m * likely).max()
    points_m, radius_m, likely = limb.points_m[:, inner], limb.radius_m[inner], likely[inner]
    for _ in range(_PALM_STEPS):
        fit_m = radius_m * likely
        top = fit_m > _PALM_TOP * fit_m.max()
        weight = (fit_m[top] - _PALM_TOP * fit_m.max()) ** 2
        weight /= max(float(weight.sum()), 1e-12)
        palm_m = points_m[:, top] @ weight
        likely = np.exp(-0.5 * (_distance(points_m, palm_m) / _PALM_SIGMA_M) ** 2)
    return palm_m, float(weight @ radius_m[top])


def _axis(from_palm_m: Float32, area_m2: Float32, toward_arm_m: Float32) -> Float32:
    """Return the forearm's axis, from the palm to the elbow."""
    axis = toward_arm_m / max(float(np.linalg.norm(toward_arm_m)), 1e-9)
    for _ in range(_AXIS_STEPS):
        along_m = axis @ from_palm_m
        weight = area_m2 * np.exp(-0.5 * ((along_m - _ARM_M) / _ARM_SIGMA_M) ** 2)
        center_m = from_palm_m @ weight
        axis = center_m / max(float(np.linalg.norm(center_m)), 1e-12)
    return np.asarray(axis, np.float32)


def _distance(points_m: Float32, from_m: Float32) -> Float32:
    x_m, y_m, z_m = (axis_m - from_axis for axis_m, from_axis in zip(points_m, from_m, strict=True))
    distance_m: Float32 = np.sqrt(x_m * x_m + y_m * y_m + z_m * z_m)
    return distance_m
