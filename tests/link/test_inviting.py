"""Pairing without a station."""

import threading

import pytest

from handcal.core.errors import CancelledError, LinkError
from handcal.core.progress import Progress
from handcal.core.types import HeadsetIdentity
from handcal.link import inviting
from handcal.link.client import HeadsetClient
from handcal.link.exchange import pair_by_code, pair_by_digits
from handcal.link.invitation import Invitation
from handcal.link.inviting import run_pairing
from handcal.link.pairing import Pairing, Pairings
from handcal.link.server import HeadsetServer

DEVICE = "00000000000000aa"
HERE = ("127.0.0.1", 0)


@pytest.fixture(autouse=True)
def no_network(monkeypatch: pytest.MonkeyPatch) -> None:
    """Announcing takes 1.5 s; test_discovery.py does it."""

    def refuse(_address: object) -> None:
        raise LinkError("no multicast")

    monkeypatch.setattr(inviting, "Announcement", refuse)


@pytest.mark.parametrize("has_camera", [True, False])
def test_the_first_new_headset_is_paired(has_camera: bool) -> None:
    known = Pairing("the key of another headset", "00000000000000bb", "Known")
    pairings = Pairings((known,))
    threads: list[threading.Thread] = []

    def connect(invitation: Invitation) -> None:
        address = (invitation.host, invitation.port)
        key = pair_by_code(invitation, DEVICE)
        if not has_camera:
            key = pair_by_digits(address, DEVICE, invitation.digits)
        with HeadsetClient(address, key.encode(), HeadsetIdentity(DEVICE, "Lab 9")) as client:
            client.wait_connected(5.0)

    def show(invitation: Invitation) -> None:
        threads.append(threading.Thread(target=connect, args=[invitation]))
        threads[0].start()

    paired = run_pairing(HERE, pairings, show)
    threads[0].join()
    assert (paired.device_id, paired.name) == (DEVICE, "Lab 9")
    assert pairings.all == (known, paired)


def test_no_headset_is_said() -> None:
    with pytest.raises(LinkError, match="no new headset connected within"):
        run_pairing(HERE, Pairings(()), lambda _: None, timeout_s=0.0)
    with pytest.raises(CancelledError):
        run_pairing(HERE, Pairings(()), lambda _: None, Progress(is_cancelled=lambda: True))


def test_a_port_in_use_says_what_to_do() -> None:
    with HeadsetServer(Pairings(())) as server, pytest.raises(LinkError, match="pair there"):
        run_pairing(server.address, Pairings(()), lambda _: None)
