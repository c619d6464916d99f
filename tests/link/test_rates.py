from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import pytest

from handcal.link.statistics import LinkRates, LinkStatistics, link_rates

NOTHING: dict[str, Any] = dict.fromkeys((field.name for field in fields(LinkStatistics)), 0)
START = replace(
    LinkStatistics(**NOTHING),
    sent=1000,
    received=500,
    lost=10,
    lost_inbound=20,
    bytes_sent=100_000,
    bytes_received=50_000,
)


def test_rates_are_of_the_while_between() -> None:
    after = replace(
        START,
        sent=1200,
        received=590,
        lost=16,
        lost_inbound=30,
        bytes_sent=140_000,
        bytes_received=51_000,
    )
    rates = link_rates(START, after, 2.0)
    assert rates == LinkRates(
        lost=0.03, lost_inbound=0.1, sent_bytes_s=20_000.0, received_bytes_s=500.0
    )


def test_where_nothing_passed_no_share_was_lost() -> None:
    assert link_rates(START, START, 1.0) == LinkRates(None, None, 0.0, 0.0)


def test_a_reconnected_headset_counts_from_zero() -> None:
    restarted = replace(START, sent=1100, received=600, lost=0, lost_inbound=0)
    rates = link_rates(START, restarted, 1.0)
    assert (rates.lost, rates.lost_inbound) == (0.0, 0.0)


def test_no_more_than_all_is_lost() -> None:
    late_report = replace(START, sent=1001, lost=15)
    assert link_rates(START, late_report, 1.0).lost == 1.0


def test_no_time_gives_no_rates() -> None:
    with pytest.raises(ValueError, match="0 s"):
        link_rates(START, START, 0.0)
