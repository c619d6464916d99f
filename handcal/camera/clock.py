"""Exposure times of frames on the host's clock."""

from __future__ import annotations

from collections import deque

from handcal.types import Frame

_WINDOW = 300


class FrameClock:
    """Maps the camera's clock to the host's.

    A frame arrives after its exposure with a delay that varies with the load. The shortest delay
    of the last 300 frames is taken as the camera's own latency. A camera whose time runs backward
    has restarted.

    Parameters
    ----------
    latency_s : float
        From the exposure to the earliest arrival.
    """

    def __init__(self, latency_s: float) -> None:
        self._latency_ns = round(1e9 * latency_s)
        self._delays_ns: deque[int] = deque(maxlen=_WINDOW)
        self._newest_ns = 0

    def exposure_ns(self, frame: Frame) -> int:
        """Return the time of a frame's exposure on the host's monotonic clock."""
        if frame.t_camera_ns < self._newest_ns:
            self._delays_ns.clear()
        self._newest_ns = frame.t_camera_ns
        self._delays_ns.append(frame.t_host_ns - frame.t_camera_ns)
        return frame.t_camera_ns + min(self._delays_ns) - self._latency_ns
