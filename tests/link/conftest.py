"""A headset and a PC that can send any datagram, as an attacker or a broken peer could."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from handcal.core.display import target_corners_m
from handcal.core.types import Float64, HeadsetIdentity, Projection
from handcal.link import handcal_pb2 as pb
from handcal.link import handshake, wire
from handcal.link.pairing import Pairing, Pairings
from handcal.link.server import HeadsetServer
from handcal.link.shapes import Target
from handcal.link.transport import Address
from handcal.link.wire import Keys, Packet, Welcome

KEY = b"a pairing key of the tests"
DEVICE = 0x1234
NONCE = bytes(range(16))


@pytest.fixture
def pairing_key() -> bytes:
    return KEY


class RawPeer:
    """A socket that seals and opens datagrams itself."""

    def __init__(self, key: bytes, device: int, is_headset: bool) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(3.0)
        self.address: Address = self.socket.getsockname()
        self.device = device
        self._key = key
        self._is_headset = is_headset
        self._handshake = self._session = self._pair(wire.handshake_keys(key, device))

    def use_session(self, welcome: Welcome) -> None:
        self._session = self._pair(wire.session_keys(self._key, self.device, welcome))

    def greeting(self, envelope: pb.Envelope) -> bytes:
        return handshake.seal(self._handshake[0], self.device, envelope)

    def seal(self, envelope: pb.Envelope, session: int, sequence: int) -> bytes:
        return self.seal_payload(envelope.SerializeToString(), session, sequence)

    def seal_payload(self, payload: bytes, session: int, sequence: int) -> bytes:
        return wire.seal(self._session[0], Packet(payload, session, sequence))

    def receive(self) -> tuple[pb.Envelope, Packet, Address]:
        datagram, address = self.socket.recvfrom(2048)
        packet = wire.read(datagram)
        assert isinstance(packet, Packet)
        keys = self._session if packet.session else self._handshake
        assert wire.is_authentic(keys[1], datagram)
        return pb.Envelope.FromString(packet.payload), packet, address

    def receive_greeting(self) -> pb.Envelope:
        """Return the next message of the handshake."""
        while True:
            datagram = self.socket.recv(2048)
            packet = wire.read(datagram)
            assert isinstance(packet, Packet)
            if not packet.session:
                assert wire.is_authentic(self._handshake[1], datagram)
                return pb.Envelope.FromString(packet.payload)

    def _pair(self, keys: Keys) -> tuple[bytes, bytes]:
        pair = keys.to_pc, keys.to_headset
        return pair if self._is_headset else (pair[1], pair[0])


class RawHeadset(RawPeer):
    """A headset that sends and receives single datagrams."""

    def __init__(self, server: Address, key: bytes = KEY, device: int = DEVICE) -> None:
        super().__init__(key, device, is_headset=True)
        self.server = server
        self.time_ns = 1

    def send(self, datagram: bytes) -> None:
        self.socket.sendto(datagram, self.server)

    def hello(self, cookie: bytes = b"", nonce: bytes = NONCE) -> bytes:
        self.time_ns += 1
        return self.greeting(handshake.hello(nonce, self.time_ns, cookie, f"Headset {self.device}"))

    def cookie(self) -> bytes:
        """Say hello and return the cookie of the answer."""
        self.send(self.hello())
        envelope = self.receive_greeting()
        assert envelope.retry.nonce == NONCE
        return envelope.retry.cookie

    def join(self, nonce: bytes = NONCE) -> int:
        """Do the handshake and return the session."""
        self.send(self.hello(self.cookie(), nonce))
        envelope = self.receive_greeting()
        welcome = handshake.read_welcome(envelope.welcome)
        assert welcome.headset_nonce == nonce
        self.use_session(welcome)
        return welcome.session

    def refusal(self) -> handshake.Refusal:
        """Do the handshake and return the refusal."""
        self.send(self.hello(self.cookie()))
        envelope = self.receive_greeting()
        assert envelope.WhichOneof("body") == "refused"
        return handshake.read_refused(envelope.refused)


class RawServer(RawPeer):
    """A PC that sends and receives single datagrams."""

    def __init__(self) -> None:
        super().__init__(KEY, DEVICE, is_headset=False)

    def wait_for(self, body: str) -> tuple[pb.Envelope, Address]:
        while True:
            envelope, _, address = self.receive()
            if envelope.WhichOneof("body") == body:
                return envelope, address


@pytest.fixture
def pairings() -> Pairings:
    """Two paired headsets, and a key for another."""
    bound = (
        Pairing(f"{KEY.decode()} {device}", f"{device:016x}", f"Headset {device}")
        for device in (1, 2)
    )
    return Pairings((Pairing(KEY.decode()), *bound))


@pytest.fixture
def server(pairings: Pairings) -> Iterator[HeadsetServer]:
    with HeadsetServer(pairings) as server:
        yield server


@pytest.fixture
def new_headset(server: HeadsetServer) -> Iterator[Callable[..., RawHeadset]]:
    """Return a maker of raw headsets connected to the server."""
    made: list[RawHeadset] = []

    def make(key: bytes = KEY, device: int = DEVICE) -> RawHeadset:
        made.append(RawHeadset(server.address, key, device))
        return made[-1]

    yield make
    for headset in made:
        headset.socket.close()


@pytest.fixture
def raw_headset() -> type[RawHeadset]:
    return RawHeadset


@pytest.fixture
def raw_server() -> Iterator[RawServer]:
    server = RawServer()
    yield server
    server.socket.close()


IDENTITY = HeadsetIdentity("0000000000001234", name="Lab 1", runtime="tests", app="tests 1")
TARGET = Target("left", target_corners_m(0.5))


def hand(seed: int = 0, count: int = 5000) -> Float64:
    return np.random.default_rng(seed).normal([0.0, 0.0, 0.5], 0.05, (count, 3))


def projection(eye: Any, value: float) -> Projection:
    return Projection(eye, np.full((3, 4), value), 1268, 720)
