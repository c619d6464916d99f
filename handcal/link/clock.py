"""Offset and drift of the headset's clock, estimated from pings."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from handcal.core.errors import PosePendingError

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
