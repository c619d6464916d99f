"""Pairing by digits in C#: the published exchange, and a whole one with the real PC's end."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from handcal.core.types import HeadsetIdentity
from handcal.link.exchange import MAX_ATTEMPTS
from handcal.link.pairing import Pairings
from handcal.link.server import HeadsetServer
from tests.headset.conftest import Ask
from tests.headset.mono_client import MonoClient
from tests.link import vectors

pytestmark = pytest.mark.process
DEVICE_ID = "00000000000000c7"
PATIENCE_S = 15.0
WRONG = "The code is wrong: read it again from the PC's screen."


def _exchange(ask: Ask, digits: str, answer: str) -> list[str]:
    published = vectors.build()
    secret = published["pairing_by_digits"]["headset_secret"]
    lines = [digits, published["device_id"], published["headset_nonce"], secret, "Lab 2", answer]
    return ask("digits", text="\n".join(lines) + "\n").rstrip("\n").split(" ", 2)


def test_the_published_exchange(ask: Ask) -> None:
    published = vectors.build()["pairing_by_digits"]
    found = _exchange(ask, published["digits"], published["paired"])
    assert found == [published["pair"], "True", published["pairing_key"]]


def test_a_changed_answer_is_no_answer(ask: Ask) -> None:
    published = vectors.build()["pairing_by_digits"]
    datagram = bytearray.fromhex(published["paired"])
    datagram[60] ^= 1
    assert _exchange(ask, published["digits"], datagram.hex())[1:] == ["False", ""]
    assert _exchange(ask, "01234568", published["paired"])[1:] == ["True", WRONG]


def test_a_pc_agrees_by_its_digits_and_the_headset_connects(
    ask: Ask, program: Path, tmp_path: Path
) -> None:
    pairings = Pairings((), tmp_path / "devices.json")
    with HeadsetServer(pairings) as server:
        host, port = server.address
        digits = server.invite().digits
        key = ask("pair", host, str(port), f"{digits[:4]} {digits[4:]}", DEVICE_ID).strip()
        identity = HeadsetIdentity(DEVICE_ID, "Lab-2")
        with MonoClient(program, server.address, key.encode(), identity, time.monotonic_ns):
            server.wait_connected(PATIENCE_S)
        assert [(one.key, one.device_id) for one in pairings.all] == [(key, DEVICE_ID)]


def test_wrong_digits_end_the_code(ask: Ask, tmp_path: Path) -> None:
    with HeadsetServer(Pairings((), tmp_path / "devices.json")) as server:
        host, port = server.address
        digits = server.invite().digits
        wrong = f"{(int(digits) + 1) % 10**8:08}"
        said = [
            ask("pair", host, str(port), wrong, DEVICE_ID).strip() for _ in range(MAX_ATTEMPTS + 1)
        ]
        assert said[:-1] == [WRONG] * MAX_ATTEMPTS
        assert "no more codes" in said[-1]
        assert "8 digits" in ask("pair", host, str(port), "1234", DEVICE_ID)
