"""Time of the camera's exposures, at which the background moves as the headset's poses predict.

A head that turns at a constant rate shows nothing, changes of the rate do. With other cameras and
an inertial sensor, see Rehder, Siegwart and Furgale, "A general approach to spatiotemporal
calibration in multisensor systems", IEEE T-RO 2016.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handcal.calibration.timing.background import Background
from handcal.core.geometry import invert
from handcal.core.types import Float64

_USED_FRAMES = 60
"""Most frames of one key frame that are used for a measurement, evenly spread."""
FEWEST_FRAMES = 8
STEP_NS = 10_000_000
"""Step of the table of poses."""
_HALF = 8
_SMOOTH = np.convolve(np.ones(_HALF), np.ones(_HALF)) / _HALF**2
"""Weights of a mean over ± 80 ms, which lowers the noise of the poses. It is symmetric, so it moves
no time."""
REACH_NS = _HALF * STEP_NS
LARGEST_S = 0.3
_COARSE_S, _FINE_S = 0.02, 0.01
_FINE = 4
"""The cost is a parabola in the time, as far as this many fine steps."""
_LEAST_RATE_RAD_S = 0.012
"""Least change of the head's rate, rms. The noise of smoothed poses looks like 0.002 rad/s; where
it is not small beside the movement, σ would be too small."""
_STILL_RAD, _STILL_M = 0.0002, 0.0002
"""A head whose place varies less, rms, is in the same place at all times."""

_Int64 = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class MeasuredOffset:
    """The time of the exposures, as measured once."""

    offset_ns: int
    """Time on the host's clock minus time on the camera's."""
    sigma_s: float


def _movement(poses: Float64) -> Float64:
    """Return (N, 6): rotation vector from the first pose and position, smoothed."""
    turned = Rotation.from_matrix(poses[0, :3, :3].T @ poses[:, :3, :3]).as_rotvec()
    numbers = np.column_stack([turned, poses[:, :3, 3]])
    padded = np.pad(numbers, ((_HALF - 1, _HALF - 1), (0, 0)), mode="edge")
    return np.column_stack([np.convolve(column, _SMOOTH, mode="valid") for column in padded.T])


def is_still(poses: Float64) -> bool:
    """Return True for a head that is in the same place at all times; poses (N, 4, 4) are T_W_H."""
    if len(poses) < 4 * _HALF:
        return False
    spread = _movement(poses)[_HALF:-_HALF].std(axis=0)
    return bool((spread[:3] < _STILL_RAD).all() and (spread[3:] < _STILL_M).all())


def measure_offset(
    backgrounds: Iterable[Background],
    times_ns: _Int64,
    poses: Float64,
    T_H_D: Float64,
    earliest_ns: int,
) -> MeasuredOffset | None:
    """Return the time of the exposures at which movement and poses agree best.

    Parameters
    ----------
    backgrounds : iterable of Background
    times_ns : (N,) int64
        Times of the poses on the host's clock, evenly spaced except for gaps.
    poses : (N, 4, 4) float64
        T_W_H.
    T_H_D : (4, 4) float64
        From the depth camera to the headset.
    earliest_ns : int
        Largest possible offset, at which a frame would arrive with its exposure.

    Returns
    -------
    MeasuredOffset or None
        None if too little was seen. σ is from the residuals, with regard to their correlation.
    """
    if len(times_ns) < 2 * _HALF:
        return None
    table = _Table(times_ns, poses)
    used = [one for one in backgrounds if len(one.times_ns) > FEWEST_FRAMES]
    offsets_s = -np.arange(0.0, LARGEST_S + _COARSE_S, _COARSE_S)
    residuals = _residuals(used, table, T_H_D, earliest_ns, offsets_s)
    if residuals is None:
        return None
    nearest_s = offsets_s[np.square(residuals).sum(axis=(1, 2)).argmin()]
    steps_s = _FINE_S * np.arange(-_FINE, _FINE + 1.0)
    residuals = _residuals(used, table, T_H_D, earliest_ns, nearest_s + steps_s)
    if residuals is None:
        return None
    cost = np.square(residuals).sum(axis=(1, 2))
    a, b, c = np.polyfit(steps_s, cost, 2)
    freedom = residuals[0].size - 2 * len(used) - 1
    is_moved = a > residuals.shape[1] * _LEAST_RATE_RAD_S**2
    if not is_moved or abs(b / (2.0 * a)) > _FINE * _FINE_S or freedom < FEWEST_FRAMES:
        return None
    variance = max(float(c - b * b / (4.0 * a)), 1e-12) / freedom
    best = residuals[cost.argmin()]
    alike = np.clip((best[1:] * best[:-1]).sum() / np.square(best).sum(), 0.0, 0.9)
    sigma_s = float(np.sqrt(variance / a * (1.0 + alike) / (1.0 - alike)))
    return MeasuredOffset(earliest_ns + round(1e9 * (nearest_s - b / (2.0 * a))), sigma_s)


class _Table:
    """The head's smoothed movement, interpolated linearly: rotations as vectors from the first."""

    def __init__(self, times_ns: _Int64, poses: Float64) -> None:
        self.first_ns = int(times_ns[0])
        self._times_s = 1e-9 * (times_ns - times_ns[0])
        self._R_W_0 = poses[0, :3, :3]
        self._numbers = _movement(poses)

    def covers(self, times_s: Float64) -> NDArray[np.bool_]:
        """Return which times have poses on both sides."""
        reach_s = 1e-9 * REACH_NS
        return np.asarray(
            (times_s > self._times_s[0] + reach_s) & (times_s < self._times_s[-1] - reach_s)
        )

    def at(self, times_s: Float64) -> tuple[Float64, Float64]:
        """Return R_W_H (N, 3, 3) and the positions (N, 3)."""
        numbers = np.column_stack([np.interp(times_s, self._times_s, n) for n in self._numbers.T])
        R_W_H = self._R_W_0 @ Rotation.from_rotvec(numbers[:, :3]).as_matrix()
        return R_W_H, numbers[:, 3:]


def _residuals(
    backgrounds: list[Background],
    table: _Table,
    T_H_D: Float64,
    earliest_ns: int,
    offsets_s: Float64,
) -> Float64 | None:
    """Return (offsets, frames, 2): movement seen minus predicted, in units of the focal length.

    Each background's mean is removed: its key frame's pose has noise, too.
    """
    parts = []
    for one in backgrounds:
        every = -(-(len(one.times_ns) - 1) // _USED_FRAMES)
        index = np.arange(1, len(one.times_ns), every)
        times_s = 1e-9 * (np.array(one.times_ns)[[0, *index]] + earliest_ns - table.first_ns)
        seen = np.array([one.moved[i - 1] for i in index], dtype=np.float64)
        # At all offsets alike, so that their costs can be compared.
        is_known = table.covers(times_s) & table.covers(times_s + offsets_s.min())
        if not is_known[0] or is_known.sum() < FEWEST_FRAMES // 2:
            continue
        seen, times_s = seen[is_known[1:]], times_s[is_known]
        part = np.array([_apart(one, table, T_H_D, times_s + offset, seen) for offset in offsets_s])
        parts.append(part - part.mean(axis=1, keepdims=True))
    return np.concatenate(parts, axis=1) if parts else None


def _apart(
    background: Background, table: _Table, T_H_D: Float64, times_s: Float64, seen: Float64
) -> Float64:
    """Return (frames, 2): the points' mean movement, seen minus predicted."""
    R_W_H, t_W_m = table.at(times_s)
    T_H_C = T_H_D @ invert(background.T_C_D)
    R_W_C = R_W_H @ T_H_C[:3, :3]
    t_W_m = t_W_m + R_W_H @ T_H_C[:3, 3]
    points_W_m = background.points_C_m @ R_W_C[0].T + t_W_m[0]
    points_C_m = (points_W_m - t_W_m[1:, None]) @ R_W_C[1:]
    start = background.points_C_m[:, :2] / background.points_C_m[:, 2:]
    apart = seen - (points_C_m[..., :2] / points_C_m[..., 2:] - start)
    # A point that is hidden by the hand moves with it.
    off = np.linalg.norm(apart - _median(apart), axis=2)
    apart[~(off <= 2.5 * _median(off))] = np.nan
    return np.asarray(np.nanmean(apart, axis=1))


def _median(values: Float64) -> Float64:
    """Return the median along the second axis, which is kept; NaN are left out.

    Several times faster than `numpy.nanmedian`, which makes masked arrays.
    """
    ordered = np.sort(values, axis=1)  # NaN come last
    count = np.count_nonzero(~np.isnan(ordered), axis=1, keepdims=True)
    low = np.take_along_axis(ordered, (count - 1) // 2, axis=1)
    return np.asarray(0.5 * (low + np.take_along_axis(ordered, count // 2, axis=1)))
