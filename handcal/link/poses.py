"""The headset's poses at times of the host's clock. No sockets; time is an argument.

`ClockEstimator` relates both clocks by pings, `PoseBuffer` interpolates between recent poses.
"""

from __future__ import annotations

import bisect
from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.errors import PoseError, PosePendingError
from handcal.core.geometry import interpolate_pose
from handcal.core.types import Float64

DRIFT_PRIOR = 50e-6
"""Prior standard deviation of a crystal's drift, s/s."""

MIN_SAMPLES = 5
_MOST_DRIFT = 500e-6
"""No clock drifts more, s/s: ten times the prior, and what NTP takes as the largest."""
_RESOLUTION_NS = 1_000


@dataclass(frozen=True, slots=True)
class ClockFit:
    """``t_headset - t_host = offset_ns + drift × (t_host - reference_host_ns)``."""

    reference_host_ns: int
    offset_ns: float
    drift: float
    round_trip_ns: float
    """Median of the stored pings."""
    uncertainty_ns: float
    """Half the shortest round trip, which bounds the effect of asymmetric delays, plus the standard
    error of the fit."""
    drift_uncertainty: float
    """Half the median ping's extra delay, and the clock's resolution, over the time that the pings
    span, s/s. The standard error is several times too small, as delays are not normal."""


class ClockEstimator:
    """Estimates offset and drift from the four timestamps of each ping, as NTP does (RFC 5905, 8).

    A ping with round trip r bounds the offset to ±r/2, so the line fit weights each ping by its
    delay beyond the shortest. Two pings whose bounds no possible drift joins prove that the clock
    was set: the fit begins again.

    Attributes
    ----------
    fit : ClockFit or None
        None before the first few pings, also after a step.
    checked_host_ns : int
        When the newest ping was sent: until then the clock has not stepped unnoticed.
    """

    def __init__(self) -> None:
        self._samples: deque[tuple[int, int, int]] = deque(maxlen=300)
        self.fit: ClockFit | None = None
        self.checked_host_ns = 0

    def add(
        self,
        sent_host_ns: int,
        received_headset_ns: int,
        sent_headset_ns: int,
        received_host_ns: int,
    ) -> int:
        """Add the timestamps of one ping; a negative round trip is ignored.

        Returns
        -------
        int
            By how much the clock was set since the pings before, ns; 0 if it was not.
        """
        round_trip = (received_host_ns - sent_host_ns) - (sent_headset_ns - received_headset_ns)
        if round_trip < 0:
            return 0
        offset = (received_headset_ns - sent_host_ns + sent_headset_ns - received_host_ns) // 2
        sample = (sent_host_ns + received_host_ns) // 2, offset, round_trip
        step_ns = self._step_ns(*sample)
        if step_ns:
            self._samples.clear()
            self.fit = None
        self._samples.append(sample)
        self.checked_host_ns = max(self.checked_host_ns, sent_host_ns)
        if len(self._samples) >= MIN_SAMPLES:
            self.fit = _fit(self._samples)
        return step_ns

    def _step_ns(self, host_ns: int, offset_ns: int, round_trip_ns: int) -> int:
        """Return the largest difference from an earlier ping that no drift explains, or 0."""
        largest_ns = 0
        for earlier_ns, earlier_offset_ns, earlier_trip_ns in self._samples:
            apart_ns = offset_ns - earlier_offset_ns
            delays_ns = (round_trip_ns + earlier_trip_ns) / 2 + _RESOLUTION_NS
            is_step = abs(apart_ns) > delays_ns + _MOST_DRIFT * abs(host_ns - earlier_ns)
            if is_step and abs(apart_ns) > abs(largest_ns):
                largest_ns = apart_ns
        return largest_ns

    def to_headset_ns(self, host_ns: int) -> int:
        """Convert a host time.

        Raises
        ------
        PosePendingError
            If too few pings have been answered.
        """
        fit = self._ready()
        elapsed = host_ns - fit.reference_host_ns
        return host_ns + round(fit.offset_ns + fit.drift * elapsed)

    def to_host_ns(self, headset_ns: int) -> int:
        """Convert a headset time.

        Raises
        ------
        PosePendingError
            If too few pings have been answered.
        """
        fit = self._ready()
        elapsed = headset_ns - fit.reference_host_ns - round(fit.offset_ns)
        return fit.reference_host_ns + elapsed - round(fit.drift / (1 + fit.drift) * elapsed)

    def _ready(self) -> ClockFit:
        if self.fit is None:
            raise PosePendingError("the headset's clock is not known yet", "wait for a few pings")
        return self.fit


def _fit(samples: deque[tuple[int, int, int]]) -> ClockFit:
    reference_host, reference_offset, _ = samples[-1]
    # Subtract large integers before converting: a float64 holds only 53 bits.
    elapsed, offset, round_trip = np.array(
        [(t - reference_host, o - reference_offset, r) for t, o, r in samples], dtype=np.float64
    ).T
    shortest = round_trip.min()
    # One microsecond for the clock's resolution, and half of the ping's extra delay.
    sigma = 1e3 + 0.5 * (round_trip - shortest)
    A = np.column_stack([np.ones_like(elapsed), elapsed / 1e9]) / sigma[:, None]
    prior = np.diag([0.0, 1 / (DRIFT_PRIOR * 1e9) ** 2])
    covariance = np.linalg.inv(A.T @ A + prior)
    offset_ns, drift_ns_per_s = covariance @ A.T @ (offset / sigma)
    return ClockFit(
        reference_host,
        reference_offset + float(offset_ns),
        float(drift_ns_per_s) / 1e9,
        float(np.median(round_trip)),
        float(0.5 * shortest + np.sqrt(covariance[0, 0])),
        float((1e3 + 0.5 * (np.median(round_trip) - shortest)) / max(np.ptp(elapsed), 1.0)),
    )


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
