"""Locate the wrist along the forearm's axis.

It is the narrowest place of the limb beyond the palm: a mean over all candidates, weighted by how
well they fit, so that it varies continuously with the image.
"""

from __future__ import annotations

import numpy as np

from handcal.hand.view import Box, DepthView
from handcal.types import Float32

_LEAST_COS = 0.5  # of the angle between the axis and the image plane
# Where the wrist is expected along the axis, from the palm's centre: the palm is 95 to 120 mm long
# (see the survey in locate.py), and an inscribed circle of 40 to 45 mm in radius touches its upper
# end.
_WRIST_M, _WRIST_SIGMA_M = 0.065, 0.02
# A detector's box ends at the wrist or behind it, with this error.
_BEYOND_BOX_M = 0.025
# The limb's width along the axis, in bins of this size, smoothed; a place this much wider than
# another is e times less likely the wrist.
_BIN_M, _SMOOTH_M, _WIDTH_SCALE_M = 0.0025, 0.004, 0.006
_PROFILE_M = (-0.02, 0.16)
_LIMB_WIDTH_M = 0.03  # a narrower limb is no arm; a finger is 24 mm wide

_SMOOTHING = np.exp(-0.5 * (np.arange(-6, 7) * _BIN_M / _SMOOTH_M) ** 2)
_SMOOTHING /= _SMOOTHING.sum()


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
    from_palm_m: Float32, area_m2: Float32, palm_m: Float32, axis: Float32, exit_m: float
) -> float:
    """Return the distance of the wrist along the axis, at most a little beyond the box's side.

    Infinite without an arm.
    """
    along_m = axis @ from_palm_m
    # Seen at an angle, a limb's length is foreshortened, and so is its area.
    forward = float(axis @ palm_m) / max(float(np.linalg.norm(palm_m)), 1e-9)
    cosine = max(_LEAST_COS, float(np.sqrt(max(0.0, 1.0 - forward**2))))
    start_m, end_m = _PROFILE_M
    bins = round((end_m - start_m) / _BIN_M)
    place = np.floor((along_m - start_m) / _BIN_M).astype(int)
    kept = (place >= 0) & (place < bins)
    width_m = np.bincount(place[kept], area_m2[kept], bins) / (_BIN_M * cosine)
    width_m = np.convolve(width_m, _SMOOTHING, "same")
    at_m = start_m + _BIN_M * (np.arange(bins) + 0.5)
    if width_m[at_m > _WRIST_M].max() < _LIMB_WIDTH_M:
        return np.inf
    likely = np.exp(-0.5 * ((at_m - _WRIST_M) / _WRIST_SIGMA_M) ** 2 - width_m / _WIDTH_SCALE_M)
    likely *= np.exp(-0.5 * (np.maximum(at_m - exit_m, 0.0) / _BEYOND_BOX_M) ** 2)
    likely *= np.minimum(width_m / _LIMB_WIDTH_M, 1.0) ** 2
    return float(likely @ at_m / likely.sum())
