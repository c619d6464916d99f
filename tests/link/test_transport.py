"""The address that is shown for a headset to connect to."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from ifaddr import IP, Adapter

from handcal.core.errors import LinkError
from handcal.link import transport
from handcal.link.transport import reachable_address


def test_one_network_is_as_it_was_bound() -> None:
    assert reachable_address(("192.168.1.20", 47800)) == ("192.168.1.20", 47800)


def test_all_networks_are_told_by_the_address_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transport, "local_address", lambda _: ("192.168.1.20", 0))
    assert reachable_address(("0.0.0.0", 47800)) == ("192.168.1.20", 47800)


def test_a_network_without_a_gateway_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    own: list[str | tuple[str, int, int]]
    own = ["127.0.0.1", ("::1", 0, 0), ("fe80::1", 0, 2), ("fd00::5", 0, 0)]
    see(monkeypatch, own)
    assert reachable_address(("::", 47800)) == ("fd00::5", 47800)
    with pytest.raises(LinkError, match="no IPv4 network"):
        reachable_address(("0.0.0.0", 47800))
    see(monkeypatch, [*own, "10.9.0.1"])
    assert reachable_address(("::", 47800)) == ("10.9.0.1", 47800)


def test_without_a_network_there_is_nowhere_to_connect_to(monkeypatch: pytest.MonkeyPatch) -> None:
    see(monkeypatch, ["127.0.0.1", ("::1", 0, 0)])
    with pytest.raises(LinkError, match="no network; connect it"):
        reachable_address(("::", 47800))


def see(monkeypatch: pytest.MonkeyPatch, own: Sequence[str | tuple[str, int, int]]) -> None:
    """Give this computer some addresses, and no route to anywhere."""

    def fail(_: object) -> None:
        raise LinkError("cannot reach")

    ips = [IP(one, 64, "eth0") for one in own]
    monkeypatch.setattr(transport, "local_address", fail)
    monkeypatch.setattr("ifaddr.get_adapters", lambda: [Adapter("eth0", "eth0", ips)])
