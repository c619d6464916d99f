"""Counters and estimates of the link."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class LinkStatistics:
    """Counters and estimates of the link."""

    connected: bool
    sent: int
    received: int
    """Datagrams sent, and datagrams received and accepted."""
    lost: int
    lost_inbound: int
    """Datagrams lost in this session: to the headset by its last report, from it by gaps."""
    resent: int
    """Fragments retransmitted."""
    acked: int
    unacked: int
    failed: int
    """Reliable messages acknowledged, waiting, and failed."""
    rejected: Mapping[str, int]
    """Datagrams dropped, by reason (`wire.Rejection`)."""
    pose_rate_hz: float
    """Rate of distinct poses over the newest second."""
    latency_ms: float | None
    """Half the median round trip."""
    clock_offset_ms: float | None
    clock_drift_ppm: float | None
    clock_drift_uncertainty_ppm: float | None
    clock_uncertainty_ms: float | None
    """Headset's clock minus the host's; None until it is known."""
    bytes_sent: int
    bytes_received: int
    given_up: Mapping[str, int] = field(default_factory=dict)
    """Number of messages that connected headsets never acknowledged, by slot."""
    missing: tuple[str, ...] = ()
    """Slots whose newest message the connected headset lacks, because it was given up."""
    notice: str = ""
    """Another headset that asks to connect now, and why it is refused; empty if there is none."""
