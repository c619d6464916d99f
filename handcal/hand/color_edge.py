"""The hand's edge in the colour image, near the border of its depth mask.

Along each normal of the border the colours at the inner end are the hand's, those at the outer end
the background's. Between them every sample is more likely of one or the other, and the edge lies
where that changes: the cheapest path around the hand, by dynamic programming.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.geometry import image_points, transform
from handcal.core.types import Bool, Float32, Float64, Frame

# Every pixel or two of a border in 640x480. More would take longer and tell no more.
_MOST_RAYS = 400
_STEP_PX = 0.5
# The edge is searched this far to both sides; less where a finger, 8 mm to its middle, is thin.
_REACH_PX, _REACH_M = 6.0, 0.006
_MARGIN = 2  # steps at the ends of the search
# Samples beyond it at each end of a ray, and rays to both sides, that tell the colours.
_ENDS, _ALONG_M = 8, 0.010
# Least standard deviation of a colour, in shades of 255.
_NOISE = 8.0
# A sample tells at most this much (log of the likelihood ratio): shadows and nails are neither.
_CLIP = 3.0
# Cost of a step of the edge between neighbouring rays, and spread about where it is expected.
_TURN_COST, _PRIOR_PX = 0.5, 7.0
# Least squared distance of the two colours, in their standard deviations.
_LEAST_CONTRAST = 2.0
# The path is found in this many parts at once, each with neighbours in which it settles.
_PARTS, _SETTLE = 16, 16

_Steps: TypeAlias = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class ColorEdge:
    """The edge in colour beside a contour."""

    inward_px: Float64
    """(N,); from each point of the contour, in pixels of the depth image."""
    is_told: Bool
    """(N,); False where hand and background have too similar colours: the place expected."""
    beyond: float
    """Share of the rays told at whose ends the edge is, or beyond: much if the two images do not
    show the same place or time."""


def find_color_edge(
    frame: Frame, contour_m: Float64, inward_m: Float64, px_m: float, expected_px: float
) -> ColorEdge:
    """Find the hand's edge in colour beside the border of its mask.

    Parameters
    ----------
    frame : Frame
        With colour.
    contour_m : (N, 3) float64
        Closed, in order, in frame D.
    inward_m : (N, 3) float64
        Normals of the contour, as long as a pixel of the depth image is wide.
    px_m : float
        That width.
    expected_px : float
        Where the edge is expected, inward from the contour.
    """
    stride = -(-len(contour_m) // _MOST_RAYS)
    chosen = np.arange(0, len(contour_m), stride)
    reach = round(min(_REACH_PX, _REACH_M / px_m) / _STEP_PX)
    samples_px: Float64 = _STEP_PX * np.arange(-reach - _ENDS, reach + _ENDS + 1.0)
    colors, is_seen = _sample(frame, contour_m[chosen], inward_m[chosen], samples_px)
    along = round(_ALONG_M / (stride * px_m))
    ratio, contrast = _likelihood_ratio(colors, min(along, (len(chosen) - 1) // 2))
    is_told = is_seen & (contrast > _LEAST_CONTRAST)
    # An edge before sample s makes the samples up to s the background's.
    edges = np.arange(_ENDS, len(samples_px) - _ENDS + 1)
    inward_px = samples_px[edges] - 0.5 * _STEP_PX
    cost = np.cumsum(ratio, axis=1)[:, edges - 1] * is_told[:, None]
    cost += (0.5 * ((inward_px - expected_px) / _PRIOR_PX) ** 2).astype(np.float32)
    path = _cheapest_path(cost)
    found_px = inward_px[path]
    at_ends = is_told & ((path < _MARGIN) | (path >= len(edges) - _MARGIN))
    at, turn = np.arange(len(contour_m)), len(contour_m)
    return ColorEdge(
        np.interp(at, chosen, found_px, period=turn),
        np.interp(at, chosen, is_told.astype(np.float64), period=turn) > 0.5,
        float(at_ends.sum() / max(1, is_told.sum())),
    )


def _sample(
    frame: Frame, contour_m: Float64, inward_m: Float64, samples_px: Float64
) -> tuple[Float32, Bool]:
    """Return colours (N, K, 3) at distances (K,) inward, and whether (N,) the image shows them."""
    camera = frame.color_intrinsics
    assert frame.color is not None
    assert camera is not None
    start_px, next_px = np.split(
        image_points(transform(frame.T_C_D, np.vstack([contour_m, contour_m + inward_m])), camera),
        2,
    )
    # In a straight line: lenses bend it by nothing in ten pixels.
    places_px = start_px[:, None] + samples_px[:, None] * (next_px - start_px)[:, None]
    x, y = np.moveaxis(places_px.astype(np.float32), -1, 0)
    ends_px = places_px[:, [0, -1]]
    is_seen = ((ends_px >= 0) & (ends_px <= [camera.width - 1, camera.height - 1])).all(axis=(1, 2))
    colors = cv2.remap(frame.color, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(colors, np.float32), np.asarray(is_seen)


def _likelihood_ratio(colors: Float32, along: int) -> tuple[Float32, Float64]:
    """Return how much likelier each sample (N, K) is of the hand, and the contrast (N,).

    Both colours are normal distributions, of the ends of `along` rays to both sides, with their
    mean covariance: a pixel that shows half of each is as likely of one as of the other.
    """
    background, spread_0 = _normal(colors[:, :_ENDS], along)
    hand, spread_1 = _normal(colors[:, -_ENDS:], along)
    apart = hand - background
    weights = np.linalg.solve(0.5 * (spread_0 + spread_1), apart[..., None])[..., 0]
    middle = np.einsum("ni,ni->n", 0.5 * (hand + background), weights)
    ratio = np.matmul(colors, weights.astype(np.float32)[..., None])[..., 0]
    ratio -= middle.astype(np.float32)[:, None]
    return np.clip(ratio, -_CLIP, _CLIP), np.einsum("ni,ni->n", apart, weights)


def _normal(colors: Float32, along: int) -> tuple[Float64, Float64]:
    """Return mean (N, 3) and covariance (N, 3, 3) of the colours (N, k, 3) of neighbouring rays."""
    colors = colors.astype(np.float64)
    squares = np.matmul(colors.swapaxes(1, 2), colors) / colors.shape[1]
    rows = np.column_stack([colors.mean(axis=1), squares.reshape(-1, 9)])
    rows = np.concatenate([rows[len(rows) - along :], rows, rows[:along]])
    sums = np.cumsum(np.concatenate([np.zeros((1, 12)), rows]), axis=0)
    moments = (sums[2 * along + 1 :] - sums[: -2 * along - 1]) / (2 * along + 1)
    mean = moments[:, :3]
    spread = moments[:, 3:].reshape(-1, 3, 3) - mean[:, :, None] * mean[:, None]
    return mean, spread + _NOISE**2 * np.eye(3)


def _cheapest_path(cost: Float32) -> _Steps:
    """Return the column of each row (N,) of a closed path that changes by one step at most."""
    rows, columns = cost.shape
    size = -(-rows // _PARTS)
    length = size + 2 * _SETTLE
    row = (size * np.arange(_PARTS) + np.arange(length)[:, None] - _SETTLE) % rows
    costs = cost[row]
    came = np.empty((length, _PARTS, columns), np.int8)
    padded = np.full((_PARTS, columns + 2), np.float32(np.inf))
    total = padded[:, 1:-1]
    total[:] = costs[0]
    for step in range(1, length):
        lower, higher = padded[:, :-2] + _TURN_COST, padded[:, 2:] + _TURN_COST
        best = np.minimum(np.minimum(lower, higher), total)
        came[step] = (best == higher).view(np.int8) - (best == lower).view(np.int8)
        came[step][best == total] = 0
        np.add(best, costs[step], out=total)
    path = np.empty((length, _PARTS), np.intp)
    parts = np.arange(_PARTS)
    path[-1] = total.argmin(axis=1)
    for step in range(length - 1, 0, -1):
        path[step - 1] = path[step] + came[step, parts, path[step]]
    return np.asarray(path[_SETTLE : _SETTLE + size].T.ravel()[:rows])
