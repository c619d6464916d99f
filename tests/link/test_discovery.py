"""Discovery over the loopback interface; registering takes 1.5 s by the standard."""

import pytest
from zeroconf import ServiceInfo, Zeroconf

from handcal.core.errors import LinkError
from handcal.link.discovery import SERVICE, Announcement

LOOPBACK = "127.0.0.1"


def look_up(name: str, timeout_ms: int) -> ServiceInfo | None:
    """Ask the network for a PC, as a headset does."""
    with Zeroconf(interfaces=[LOOPBACK]) as zeroconf:
        return zeroconf.get_service_info(SERVICE, f"{name}.{SERVICE}", timeout=timeout_ms)


def test_a_pc_is_found_while_it_is_announced() -> None:
    try:
        announcement = Announcement((LOOPBACK, 47811), "lab 3", LOOPBACK)
    except LinkError as error:
        pytest.skip(f"no multicast here: {error}")
    with announcement:
        found = look_up("lab 3", 3000)
        assert found is not None
        assert (found.parsed_addresses(), found.port) == ([LOOPBACK], 47811)
    assert look_up("lab 3", 100) is None


def test_a_network_without_multicast_is_one_clear_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**_: object) -> None:
        raise OSError("no such device")

    monkeypatch.setattr("handcal.link.discovery.Zeroconf", refuse)
    with pytest.raises(LinkError, match="cannot use multicast on the local network: no such"):
        Announcement(("192.0.2.77", 47811), interface="192.0.2.77")
