"""Settings shared by both ends of the link."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LinkSettings:
    """Times and rates of one end of the link."""

    resend_s: float = 0.04
    resend_max_s: float = 0.64
    """First and longest wait before missing fragments are retransmitted; it doubles in between and
    is reset whenever fragments are acknowledged."""
    give_up_s: float = 5.0
    """Time after which an unacknowledged message has failed."""
    silence_s: float = 2.0
    """Time without a datagram after which the other end counts as disconnected."""
    hello_period_s: float = 0.1
    ping_period_s: float = 0.1
    """Time between two hellos or keep-alives, and between two pings."""
    burst_datagrams: int = 16
    """Queued datagrams sent in one burst, followed by a pause of `burst_pause_s`."""
    burst_pause_s: float = 0.001
    idle_wait_s: float = 0.005
    """Longest wait for a datagram while nothing is queued."""
    receive_buffer_bytes: int = 4 * 2**20
    """Socket buffer requested from the system."""
    live_points: int = 3000
    """Most points of a live hand in one frame; enough for a closed surface."""


DEFAULT_SETTINGS = LinkSettings()
