"""Pairing in C#: the published exchange, and a whole one with the real PC's end."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from handcal.core.types import HeadsetIdentity
from handcal.link import exchange
from handcal.link.pairing import Pairings
from handcal.link.server import HeadsetServer
from tests.headset.conftest import Ask
from tests.headset.mono_client import MonoClient
from tests.link import vectors

pytestmark = pytest.mark.process
DEVICE_ID = "00000000000000c7"
PATIENCE_S = 15.0
WRONG = "The code is wrong: read it again from the PC's screen."


def _exchange(ask: Ask, code: str, answer: str, *, by_code: bool = False) -> list[str]:
    """Return the first request, that with a cookie, whether the answer ends it, and the key."""
    published = vectors.build()
    pairing = published["pairing_by_digits"]
    lines = [
        code,
        str(by_code).lower(),
        published["device_id"],
        published["headset_nonce"],
        pairing["headset_secret"],
        "Lab 2",
        pairing["retry"],
        answer,
    ]
    return ask("exchange", text="\n".join(lines) + "\n").rstrip("\n").split(" ", 3)


def test_the_published_exchange(ask: Ask) -> None:
    published = vectors.build()["pairing_by_digits"]
    found = _exchange(ask, published["digits"], published["paired"])
    requests = [published["first_pair"], published["pair"]]
    assert found == [*requests, "True", published["pairing_key"]]
    _, scanned, *_ = _exchange(ask, vectors.INVITATION.code, published["paired"], by_code=True)
    assert scanned == published["pair_by_code"]


def test_a_changed_answer_is_no_answer(ask: Ask) -> None:
    published = vectors.build()["pairing_by_digits"]
    datagram = bytearray.fromhex(published["paired"])
    datagram[60] ^= 1
    assert _exchange(ask, published["digits"], datagram.hex())[2:] == ["False", ""]
    assert _exchange(ask, "01234568", published["paired"])[2:] == ["True", WRONG]
    refused = _exchange(ask, published["digits"], published["refused"])
    assert refused[2] == "True"
    assert "no more codes" in refused[3]


@pytest.mark.parametrize("by_code", [False, True], ids=["digits", "QR code"])
def test_a_pc_agrees_and_the_headset_connects(
    ask: Ask, program: Path, tmp_path: Path, by_code: bool
) -> None:
    pairings = Pairings((), tmp_path / "devices.json")
    with HeadsetServer(pairings) as server:
        host, port = server.address
        invitation = server.invite()
        digits = f"{invitation.digits[:4]} {invitation.digits[4:]}"
        shown = invitation.text if by_code else digits
        key = ask("pair", host, str(port), shown, DEVICE_ID).strip()
        identity = HeadsetIdentity(DEVICE_ID, "Lab-2")
        with MonoClient(program, server.address, key.encode(), identity, time.monotonic_ns):
            server.wait_connected(PATIENCE_S)
        assert [(one.key, one.device_id) for one in pairings.all] == [(key, DEVICE_ID)]


def test_wrong_digits_end_the_code(
    ask: Ask, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exchange, "_PER_CODE", 2)
    with HeadsetServer(Pairings((), tmp_path / "devices.json")) as server:
        host, port = server.address
        invitation = server.invite()
        wrong = f"{(int(invitation.digits) + 1) % 10**8:08}"
        said = [ask("pair", host, str(port), wrong, DEVICE_ID).strip() for _ in range(3)]
        assert said[:-1] == [WRONG] * 2
        assert "no more codes" in said[-1]
        assert "8 digits" in ask("pair", host, str(port), "1234", DEVICE_ID)
        server.invite()
        assert ask("pair", host, str(port), invitation.text, DEVICE_ID).strip() == WRONG
