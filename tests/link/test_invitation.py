from __future__ import annotations

import threading

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.core.errors import CancelledError, LinkError
from handcal.core.progress import Progress
from handcal.core.types import HeadsetIdentity
from handcal.link import inviting
from handcal.link.client import HeadsetClient
from handcal.link.exchange import pair_by_code, pair_by_digits
from handcal.link.invitation import Invitation, qr_lines, qr_matrix, read_invitation
from handcal.link.inviting import run_pairing
from handcal.link.pairing import Pairing, Pairings
from handcal.link.server import HeadsetServer

CODE = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


@pytest.mark.parametrize(
    ("host", "text"),
    [
        ("192.168.1.20", f"HANDCAL://192.168.1.20:47800/{CODE}"),
        ("lab-pc.local", f"HANDCAL://LAB-PC.LOCAL:47800/{CODE}"),
        ("fe80::1%eth0", f"HANDCAL://[FE80::1]:47800/{CODE}"),
    ],
)
def test_the_text_is_read_back_in_any_capitals(host: str, text: str) -> None:
    assert Invitation(host, 47800, CODE).text == text
    expected = Invitation(host.partition("%")[0], 47800, CODE)
    for form in (text, text.lower(), f" {text}\n", f"{text}?later=1"):
        assert read_invitation(form) == expected


@pytest.mark.parametrize(
    "text",
    [
        "",
        CODE,
        "https://192.168.1.20:47800/" + CODE,
        f"HANDCAL://192.168.1.20/{CODE}",
        f"HANDCAL://192.168.1.20:0/{CODE}",
        f"HANDCAL://192.168.1.20:65536/{CODE}",
        f"HANDCAL://192.168.1.20:47800/{CODE[1:]}",
        f"HANDCAL://192.168.1.20:47800/{CODE[1:]}1",
        f"HANDCAL://fe80::1:47800/{CODE}",
    ],
)
def test_another_text_is_no_invitation(text: str) -> None:
    with pytest.raises(LinkError, match="not an invitation"):
        read_invitation(text)


@given(st.text())
def test_any_text_is_read_or_refused_in_one_line(text: str) -> None:
    with pytest.raises(LinkError) as error:
        read_invitation(text)
    assert "\n" not in str(error.value)


def test_a_reader_finds_the_text_in_the_code() -> None:
    # A given code: OpenCV's reader misses 1 of 240 random ones.
    text = Invitation("192.168.178.120", 47800, CODE).text
    modules = np.array(qr_matrix(text))
    image = np.kron(np.where(modules, 0, 255), np.ones((8, 8))).astype(np.uint8)
    assert cv2.QRCodeDetector().detectAndDecode(image)[0] == text
    assert not modules[:4].any()
    lines = qr_lines(text)
    above = [[half in "▀█" for half in line] for line in lines]
    below = [[half in "▄█" for half in line] for line in lines]
    assert np.array_equal(np.stack([above, below], 1).reshape(-1, len(modules))[:37], modules)


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
