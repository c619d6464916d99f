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


@dataclass(frozen=True, slots=True)
class LinkRates:
    """Traffic between PC and headset in each direction over an interval."""

    lost: float | None
    lost_inbound: float | None
    """Share of the datagrams to and from the headset that did not arrive, 0 to 1; None if none
    were sent. Losses to the headset are known from its reports, which arrive a moment later."""
    sent_bytes_s: float
    received_bytes_s: float


def link_rates(before: LinkStatistics, after: LinkStatistics, elapsed_s: float) -> LinkRates:
    """Return the rates between two readings of one server's counters.

    A headset that reconnected in between counts its losses from zero.

    Raises
    ------
    ValueError
        If `elapsed_s` is not positive.
    """
    if elapsed_s <= 0.0:
        raise ValueError(f"rates over {elapsed_s:g} s are not defined")
    lost_inbound = max(0, after.lost_inbound - before.lost_inbound)
    return LinkRates(
        lost=_share(after.lost - before.lost, after.sent - before.sent),
        lost_inbound=_share(lost_inbound, after.received - before.received + lost_inbound),
        sent_bytes_s=(after.bytes_sent - before.bytes_sent) / elapsed_s,
        received_bytes_s=(after.bytes_received - before.bytes_received) / elapsed_s,
    )


def _share(part: int, whole: int) -> float | None:
    return min(1.0, max(0, part) / whole) if whole > 0 else None
