"""Headset and PC find, lose and refuse each other."""

import random
import threading
import time
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from handcal.core.errors import LinkError
from handcal.core.types import EYES, HeadsetIdentity
from handcal.link import handshake, messages, wire
from handcal.link.client import MAX_WEARERS, HeadsetClient
from handcal.link.pairing import Pairings
from handcal.link.reliable import Receipt
from handcal.link.server import HeadsetServer
from handcal.link.shapes import Shape
from handcal.link.wire import Rejection
from tests.helpers import eventually
from tests.link.conftest import IDENTITY, TARGET, hand, projection


def has_prompt(client: HeadsetClient, text: str) -> bool:
    return client.state().prompt == text


def test_a_headset_that_starts_again_is_sent_the_state_again(
    server: HeadsetServer, pairing_key: bytes
) -> None:
    for _ in range(2):
        with HeadsetClient(server.address, pairing_key, IDENTITY) as client:
            if server.statistics().sent == 0:
                server.wait_acked(server.send_prompt("Raise your hand"), 5.0)
            eventually(partial(has_prompt, client, "Raise your hand"))
        eventually(lambda: not server.connected)


def test_a_pc_that_starts_again_is_found_again(pairing_key: bytes) -> None:
    with HeadsetServer(pairing_key) as first:
        address = first.address
        client = HeadsetClient(address, pairing_key, IDENTITY)
        first.wait_acked(first.send_projection(projection("left", 1.0)), 5.0)
        first.wait_acked(first.send_prompt("old"), 5.0)
    with client, HeadsetServer(pairing_key, bind=address) as second:
        second.wait_connected(5.0)
        client.wait_connected(5.0)
        assert not client.dismissed
        assert client.state().prompt == ""
        assert client.state().projections["left"].P[0, 0] == 1.0


def test_silence_is_noticed(
    pairing_key: bytes, raw_server: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("handcal.link.endpoint.SILENCE_S", 0.3)
    with HeadsetClient(raw_server.address, pairing_key, IDENTITY) as client:
        hello, address = raw_server.wait_for("hello")
        retry = raw_server.greeting(handshake.retry(hello.hello.nonce, b"cookie"))
        raw_server.socket.sendto(retry, address)
        second, _ = raw_server.wait_for("hello")
        assert second.hello.cookie == b"cookie"
        assert second.hello.nonce == hello.hello.nonce
        assert second.hello.time_ns > hello.hello.time_ns
        welcome = wire.Welcome(9, hello.hello.nonce, bytes(16))
        greeting = raw_server.greeting(handshake.welcome(welcome))
        raw_server.socket.sendto(greeting, address)
        raw_server.use_session(welcome)
        raw_server.wait_for("ack")
        assert client.connected
        eventually(lambda: not client.connected)
        again, _ = raw_server.wait_for("hello")
        assert again.hello.nonce != hello.hello.nonce
        assert again.hello.cookie == b""

        raw_server.socket.sendto(greeting, address)
        raw_server.socket.sendto(raw_server.seal(messages.prompt("old", EYES), 9, 1), address)
        time.sleep(0.05)
        assert not client.connected
        assert client.state().prompt == ""


def test_a_pc_gone_mad_stops_nothing(pairing_key: bytes, raw_server: Any) -> None:
    chance = random.Random(0)
    made = [
        messages.cursor(hand(count=3), 2**32 - 1),
        *messages.live_hand(hand(count=450), True, 1, is_outline=True),
        messages.prompt("x" * 500, EYES),
        messages.projection(replace(projection("left", 1.0), wearer="w", rig="r")),
        messages.target(TARGET),
        messages.shape(Shape(np.ones((8, 3)))),
        messages.ack([Receipt(7, 1, 2**200)]),
    ]
    with HeadsetClient(raw_server.address, pairing_key, IDENTITY) as client:
        hello, address = raw_server.wait_for("hello")
        welcome = wire.Welcome(9, hello.hello.nonce, bytes(16))
        raw_server.socket.sendto(raw_server.greeting(handshake.welcome(welcome)), address)
        raw_server.use_session(welcome)
        client.wait_connected(3.0)
        for sequence in range(1, 3000):
            payload = bytearray(chance.choice(made).SerializeToString())
            for _ in range(chance.randrange(4)):
                payload[chance.randrange(1, len(payload))] = chance.randrange(256)
            with client._changed:
                client._take(
                    raw_server.seal_payload(bytes(payload), 9, sequence), raw_server.address
                )
            client.state()
        assert client._rejected[Rejection.CORRUPT] > 300
        assert client.state().cursor_message is not None
        assert len(client.kept) <= MAX_WEARERS


def test_two_headsets_do_not_take_turns(server: HeadsetServer, pairings: Pairings) -> None:
    first, second = (
        HeadsetIdentity(one.device_id, one.name) for one in pairings.all if one.device_id
    )
    keys = [one.key.encode() for one in pairings.all if one.device_id]
    with HeadsetClient(server.address, keys[0], first) as incumbent:
        server.wait_connected(5.0)
        with HeadsetClient(server.address, keys[1], second) as newcomer:
            eventually(lambda: newcomer.refusal)
            assert newcomer.refusal == "Headset 1 is connected to the PC; disconnect it first"
            notice = server.statistics().notice
            assert notice == "headset Headset 2 asks to connect; Headset 1 is connected"
            with pytest.raises(LinkError, match="Headset 1 is connected"):
                newcomer.wait_connected(0.1)
            assert incumbent.connected
            assert not newcomer.connected
            incumbent.close()
            newcomer.wait_connected(5.0)
            assert newcomer.refusal == ""


def test_a_key_serves_one_device(server: HeadsetServer, pairing_key: bytes) -> None:
    with HeadsetClient(server.address, pairing_key, IDENTITY) as owner:
        owner.wait_connected(5.0)
    copy = HeadsetIdentity("00000000000000aa", name="Copy")
    with HeadsetClient(server.address, pairing_key, copy) as client:
        eventually(lambda: client.refusal)
        assert "belongs to Lab 1" in client.refusal
        assert "pairing key of Lab 1" in server.statistics().notice


@pytest.mark.parametrize("bind", ["::1", "::"])
def test_ipv6_and_both(pairing_key: bytes, bind: str) -> None:
    try:
        server = HeadsetServer(pairing_key, (bind, 0))
    except LinkError:
        pytest.skip("this system has no IPv6")
    port = server.address[1]
    hosts = ("::1", "127.0.0.1") if bind == "::" else ("::1",)
    with server:
        for host in hosts:
            with HeadsetClient((host, port), pairing_key, IDENTITY) as client:
                client.wait_connected(5.0)
                server.wait_acked(server.send_prompt(host), 5.0)
                assert client.state().prompt == host
            eventually(lambda: not server.connected)


def test_the_pc_says_good_bye(pairing_key: bytes) -> None:
    before = threading.active_count()
    server = HeadsetServer(pairing_key)
    with HeadsetClient(server.address, pairing_key, IDENTITY) as client:
        client.wait_connected(5.0)
        server.close()
        eventually(lambda: client.dismissed)
        assert not client.connected
    assert threading.active_count() == before


@pytest.mark.parametrize("host", ["no-such-host.invalid", "no..name", "n" * 80])
def test_an_unknown_host_is_a_clear_error(pairing_key: bytes, host: str) -> None:
    with pytest.raises(LinkError, match="unknown host"):
        HeadsetClient((host, 1), pairing_key, IDENTITY)
