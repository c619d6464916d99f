"""The address that is shown for a headset to connect to."""

from __future__ import annotations

import pytest

from handcal.core.errors import LinkError
from handcal.link import transport
from handcal.link.transport import reachable_address


def test_one_network_is_as_it_was_bound() -> None:
    assert reachable_address(("192.168.1.20", 47800)) == ("192.168.1.20", 47800)


def test_all_networks_are_told_by_the_address_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transport, "local_address", lambda _: ("192.168.1.20", 0))
    assert reachable_address(("0.0.0.0", 47800)) == ("192.168.1.20", 47800)


def test_without_a_network_there_is_nowhere_to_connect_to(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: object) -> None:
        raise LinkError("cannot reach")

    monkeypatch.setattr(transport, "local_address", fail)
    with pytest.raises(LinkError):
        reachable_address(("0.0.0.0", 47800))
