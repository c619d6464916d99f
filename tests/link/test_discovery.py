"""Discovery over the loopback interface; registering takes 1.5 s by the standard."""

import pytest

from handcal.core.errors import LinkError
from handcal.link.discovery import Announcement, FoundPC, find_pcs

LOOPBACK = "127.0.0.1"


def test_a_pc_is_found_while_it_is_announced() -> None:
    try:
        announcement = Announcement((LOOPBACK, 47811), "lab 3", LOOPBACK)
    except LinkError as error:
        pytest.skip(f"no multicast here: {error}")
    with announcement:
        assert FoundPC("lab 3", (LOOPBACK, 47811)) in find_pcs(interface=LOOPBACK)
    names = [one.name for one in find_pcs(0.1, LOOPBACK)]
    assert "lab 3" not in names


def test_a_network_without_multicast_is_one_clear_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**_: object) -> None:
        raise OSError("no such device")

    monkeypatch.setattr("handcal.link.discovery.Zeroconf", refuse)
    with pytest.raises(LinkError, match="cannot use multicast on the local network: no such"):
        find_pcs(0.1, "192.0.2.77")
