"""Locate the wrist along the forearm's axis.

It is the narrowest place of the limb beyond the palm: a mean over all candidates, weighted by how
well they fit, so that it varies continuously with the image.
"""

from __future__ import annotations

import cv2
import numpy as np

from handcal.core.types import Bool, Float32, Float64
from handcal.hand.view import Box, DepthView

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


def arm_fit(
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
    the line of sight, so that nothing behind the palm is seen in its width.

    Parameters
    ----------
    from_palm_m, area_m2, at_end, palm_m, palm_radius_m, axis
        See `find_wrist_m`.
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


def box_exit_m(view: DepthView, box: Box, palm_m: Float32, axis: Float32) -> float:
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
    return min((one for one in exits_m if one > 0.0), default=np.inf)


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
