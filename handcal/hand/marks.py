"""Marks on a hand's outline: at the finger tips and at both ends of the wrist."""

from __future__ import annotations

import numpy as np

from handcal.core.types import Bool, Float64

# A finger tip is farther from the wrist than the gaps beside it by at least this much.
_LEAST_FINGER_M = 0.012
_HALF_LENGTH_M = 0.006
_HALF_WIDTH_M = 0.0015


def outline_marks(outline_m: Float64, is_cut: Bool) -> Float64:
    """Return points that thicken an outline at the finger tips and at the ends of the wrist.

    They tell the wearer where the hand is to match its cursor, so that a turned hand is balanced
    between its ends. They extend equally to both sides of the outline, so they do not displace it.

    Parameters
    ----------
    outline_m : (N, 3) float64
        Closed outline in order, frame D.
    is_cut : (N,) bool
        True where the arm continues.

    Returns
    -------
    (K, 3) float64
        No points if no arm continues: the wrist is unknown then.
    """
    if not is_cut.any() or is_cut.all():
        return np.empty((0, 3))
    start, length = _longest_run(is_cut)
    outline_m = np.roll(outline_m, -start, axis=0)
    image_m = outline_m[:, :2]
    reach_m = np.linalg.norm(image_m[length:] - image_m[:length].mean(axis=0), axis=1)
    marked = [0, length - 1, *(length + tip for tip in _tips(reach_m))]
    step_m = np.linalg.norm(np.roll(image_m, -1, axis=0) - image_m, axis=1)
    along_m = np.cumsum(step_m)
    apart_m = np.abs(along_m[:, None] - along_m[marked])
    apart_m = np.minimum(apart_m, along_m[-1] - apart_m)
    near = (apart_m <= _HALF_LENGTH_M).any(axis=1)
    beside = max(1, round(_HALF_WIDTH_M / max(float(np.median(step_m)), 1e-6)))
    tangent = (np.roll(image_m, -beside, axis=0) - np.roll(image_m, beside, axis=0))[near]
    across = np.column_stack([tangent[:, 1], -tangent[:, 0], np.zeros(len(tangent))])
    across *= _HALF_WIDTH_M / np.maximum(np.linalg.norm(across, axis=1), 1e-9)[:, None]
    return np.vstack([outline_m[near] + across, outline_m[near] - across])


def _tips(reach_m: Float64) -> list[int]:
    """Return the peaks whose prominence is at least `_LEAST_FINGER_M`, the first of equal ones.

    As `scipy.signal.find_peaks`, whose import would nearly double that of a station.
    """
    tips = []
    last, lowest_m, is_rising = 0, float(reach_m[0]), False
    for index, value_m in enumerate(reach_m.tolist()):
        if is_rising and value_m > reach_m[last]:
            last = index
        elif is_rising and reach_m[last] - value_m >= _LEAST_FINGER_M:
            tips.append(last)
            lowest_m, is_rising = value_m, False
        elif not is_rising:
            lowest_m = min(lowest_m, value_m)
            is_rising = value_m - lowest_m >= _LEAST_FINGER_M
            last = index
    return tips


def _longest_run(is_cut: Bool) -> tuple[int, int]:
    """Return first index and length of the longest run of True around a closed outline."""
    first = int(np.flatnonzero(~is_cut)[0])
    edges = np.diff(np.roll(is_cut, -first).astype(np.int8), append=0)
    starts, ends = np.flatnonzero(edges == 1) + 1, np.flatnonzero(edges == -1) + 1
    longest = int((ends - starts).argmax())
    return int(starts[longest] + first) % len(is_cut), int((ends - starts)[longest])
