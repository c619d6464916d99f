"""Traffic and losses of the link over an interval, from two readings of its counters."""

from __future__ import annotations

from dataclasses import dataclass

from handcal.link.statistics import LinkStatistics


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
