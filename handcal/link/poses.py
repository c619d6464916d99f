"""Buffer of the headset's recent poses, with interpolation between them."""

from __future__ import annotations

import bisect

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.errors import PoseError, PosePendingError
from handcal.core.geometry import interpolate_pose
from handcal.core.types import Float64

SLOW_M = 0.005
SLOW_RAD = 0.01
"""A head that has moved and rotated less than this across a gap is slow."""
_MAX_GAP_NS, _MAX_SLOW_GAP_NS = 50_000_000, 250_000_000
"""Longest gap between two poses that is interpolated, and longest of a slow head."""


class PoseBuffer:
    """Poses ``T_W_H`` by headset time, sorted whatever the order of arrival.

    Parameters
    ----------
    capacity : int
        Number of poses stored.
    """

    def __init__(self, capacity: int = 1000) -> None:
        self._capacity = capacity
        self._times_ns: list[int] = []
        self._poses: list[Float64] = []

    def add(self, t_headset_ns: int, T_W_H: Float64) -> None:
        """Add a pose; one already known is ignored."""
        index = bisect.bisect_left(self._times_ns, t_headset_ns)
        if index < len(self._times_ns) and self._times_ns[index] == t_headset_ns:
            return
        self._times_ns.insert(index, t_headset_ns)
        self._poses.insert(index, T_W_H)
        del self._times_ns[: -self._capacity], self._poses[: -self._capacity]

    def drop_after(self, t_headset_ns: int) -> None:
        """Forget the poses after a time."""
        kept = bisect.bisect_right(self._times_ns, t_headset_ns)
        del self._times_ns[kept:], self._poses[kept:]

    def at(self, t_headset_ns: int) -> Float64:
        """Return the pose at a time: translation interpolated linearly, rotation by slerp.

        Returns
        -------
        (4, 4) float64
            ``T_W_H``.

        Raises
        ------
        PosePendingError
            If the time lies after the newest pose.
        PoseError
            If it lies before the oldest pose, or in too long a gap.
        """
        times = self._times_ns
        if not times or t_headset_ns > times[-1]:
            raise PosePendingError("the headset's pose for this time has not arrived yet")
        index = bisect.bisect_left(times, t_headset_ns)
        if times[index] == t_headset_ns:
            return self._poses[index]
        if index == 0:
            late_ms = (times[0] - t_headset_ns) / 1e6
            raise PoseError(f"the time lies {late_ms:.0f} ms before the oldest pose kept")
        before, after = self._poses[index - 1 : index + 1]
        gap_ns = times[index] - times[index - 1]
        limit_ns = _MAX_GAP_NS
        if gap_ns > limit_ns and _is_slow(before, after):
            limit_ns = _MAX_SLOW_GAP_NS
        if gap_ns > limit_ns:
            raise PoseError(
                f"the headset sent no pose for {gap_ns / 1e6:.0f} ms, more than the "
                f"{limit_ns / 1e6:.0f} ms allowed at this speed of the head",
                "close other programs on it",
            )
        return interpolate_pose(before, after, (t_headset_ns - times[index - 1]) / gap_ns)

    def rate_hz(self) -> float:
        """Return the mean rate over the newest second of poses; 0 with fewer than two."""
        first = (
            bisect.bisect_left(self._times_ns, self._times_ns[-1] - 10**9) if self._times_ns else 0
        )
        recent = self._times_ns[first:]
        return (len(recent) - 1) / (recent[-1] - recent[0]) * 1e9 if len(recent) > 1 else 0.0


def _is_slow(before: Float64, after: Float64) -> bool:
    turn = Rotation.from_matrix(before[:3, :3].T @ after[:3, :3]).magnitude()
    moved_m = np.linalg.norm(after[:3, 3] - before[:3, 3])
    return bool(moved_m < SLOW_M and turn < SLOW_RAD)
