"""Exposure times of frames on the host's clock."""

from __future__ import annotations

from collections import deque

from handcal.core.types import Frame

INFORM_NS = 25_000_000
"""Least time between the frames in which work is done that only informs people: all frames of a
camera of 30 Hz, every second of 60, every third of 90."""
_WINDOW = 300


class FrameClock:
    """Maps the camera's clock to the host's.

    A frame arrives after its exposure with a delay that varies with the load. The shortest delay
    of the last 300 frames is taken as the camera's own latency, until the time of the exposures is
    measured. A camera whose time runs backward has restarted.

    Parameters
    ----------
    latency_s : float
        From the exposure to the earliest arrival, assumed.

    Attributes
    ----------
    measured_ns : int or None
        Time on the host's clock minus time on the camera's, measured; it replaces the assumption.
    """

    def __init__(self, latency_s: float) -> None:
        self._latency_ns = round(1e9 * latency_s)
        self._delays_ns: deque[int] = deque(maxlen=_WINDOW)
        self._exposed_ns: deque[int] = deque(maxlen=_WINDOW)
        self._newest_ns = 0
        self.measured_ns: int | None = None

    @property
    def earliest_ns(self) -> int:
        """Earliest arrival of the last frames, on the host's clock, minus the camera's time."""
        return min(self._delays_ns)

    @property
    def period_s(self) -> float:
        """Mean time between the last frames, at most 300."""
        first_ns, count = self._exposed_ns[0], len(self._exposed_ns)
        return 1e-9 * (self._newest_ns - first_ns) / max(1, count - 1)

    def exposure_ns(self, frame: Frame) -> int:
        """Return the time of a frame's exposure on the host's monotonic clock."""
        if frame.t_camera_ns < self._newest_ns:
            self._delays_ns.clear()
            self._exposed_ns.clear()
            self.measured_ns = None
        self._newest_ns = frame.t_camera_ns
        self._exposed_ns.append(frame.t_camera_ns)
        self._delays_ns.append(frame.t_host_ns - frame.t_camera_ns)
        if self.measured_ns is not None:
            return frame.t_camera_ns + self.measured_ns
        return frame.t_camera_ns + self.earliest_ns - self._latency_ns
