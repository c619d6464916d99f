"""One cut for both clouds: a plane across the forearm, fixed in the hand.

The segmentation cuts the forearm of each frame where it found the wrist. Points that only one of
the clouds has, and a centroid that moves with the cut, would become part of φ.
"""

from __future__ import annotations

import numpy as np

from handcal.core.geometry import transform
from handcal.core.types import Bool, Float64
from handcal.register.surface import mean_point, quantile

# Points this near the common cut count as beside it.
CUT_BAND_M = 0.002
# Cut edges farther than this from most of them, such as a finger at the image border, are others.
_ONE_EDGE_M = 0.05
# A cut edge is not straight: its innermost part counts.
_INNERMOST, _OUTERMOST = 0.1, 0.99
# What would cut off more of a cloud than a wrist and some palm is no cut across the forearm.
_LEAST_KEPT = 0.6
# The limit is the coordinate of a point; this much beyond it, no rounding leaves that point out.
_BEYOND_POINT_M = 1e-9


def common_cut(
    cursor_m: Float64,
    hand_m: Float64,
    cursor_cut: Bool | None,
    hand_cut: Bool | None,
    T_cursor_hand: Float64,
) -> tuple[Float64, float] | None:
    """Find one plane across the forearm by which two registered clouds can be cut.

    Parameters
    ----------
    cursor_m, hand_m : (M, 3), (N, 3) float64
    cursor_cut, hand_cut : (M,), (N,) bool or None
        Points beside a cut edge; None if unknown.
    T_cursor_hand : (4, 4) float64

    Returns
    -------
    tuple of direction and limit, or None
        The forearm continues along the direction, (3,), of which the limit, m, is the coordinate of
        the plane, in the cursor's frame; None if neither cloud has a cut edge, or it is not across
        the forearm.
    """
    clouds = cursor_m, transform(T_cursor_hand, hand_m)
    given = [
        np.zeros(len(cloud), np.bool_) if cut is None else cut
        for cloud, cut in zip(clouds, (cursor_cut, hand_cut), strict=True)
    ]
    edges = [cloud[cut] for cloud, cut in zip(clouds, given, strict=True)]
    edge_m = np.concatenate(edges)
    if not len(edge_m):
        return None
    wrist_m = edge_m.mean(axis=0)
    near = np.linalg.norm(edge_m - wrist_m, axis=1) < _ONE_EDGE_M
    wrist_m = edge_m[near].mean(axis=0) if near.any() else wrist_m
    middle_m = np.mean([mean_point(cloud) for cloud in clouds], axis=0)
    along = (wrist_m - middle_m) / max(float(np.linalg.norm(wrist_m - middle_m)), 1e-9)
    places = [cloud @ along for cloud in clouds]
    ends = [quantile(place, _OUTERMOST) for place in places]
    for edge in edges:
        at_wrist = edge[np.linalg.norm(edge - wrist_m, axis=1) < _ONE_EDGE_M]
        if len(at_wrist):
            ends.append(quantile(at_wrist @ along, _INNERMOST))
    limit = min(ends) + _BEYOND_POINT_M
    if min(float(np.mean(place <= limit)) for place in places) < _LEAST_KEPT:
        return None
    return along, limit
