"""Settings shared by both ends of the link."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LinkSettings:
    """Times and rates of one end of the link."""

    resend_s: float = 0.04
    resend_max_s: float = 0.64
    """First and longest wait before missing fragments are sent again; it doubles in between, and
    starts anew whenever fragments are acknowledged."""
    give_up_s: float = 5.0
    """A reliable message not acknowledged for so long has failed."""
    silence_s: float = 2.0
    """The other end counts as gone after so long without a datagram."""
    hello_period_s: float = 0.1
    ping_period_s: float = 0.1
    """Time between two hellos or keep-alives, and between two pings."""
    burst_datagrams: int = 16
    """Queued datagrams sent at once, then no more for `burst_pause_s`."""
    burst_pause_s: float = 0.001
    idle_wait_s: float = 0.005
    """Longest wait for a datagram while nothing is queued."""
    receive_buffer_bytes: int = 4 * 2**20
    """Socket buffer to ask the system for."""
    live_points: int = 3000
    """Points at most of a live hand, for each frame: with these it looks closed."""


DEFAULT_SETTINGS = LinkSettings()
