"""A headset and a PC that can send any datagram, as an attacker or a broken peer could."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator

import pytest

from handcal.link import handcal_pb2 as pb
from handcal.link import wire
from handcal.link.server import HeadsetServer
from handcal.link.transport import Address
from handcal.link.wire import Packet

KEY = b"a pairing key of the tests"


@pytest.fixture
def pairing_key() -> bytes:
    return KEY


class RawPeer:
    """A socket that seals and opens datagrams itself."""

    def __init__(self, send_key: bytes, receive_key: bytes) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(3.0)
        self.address: Address = self.socket.getsockname()
        self._send_key = send_key
        self._receive_key = receive_key

    def seal(self, envelope: pb.Envelope, session: int = 0, sequence: int = 0) -> bytes:
        return self.seal_payload(envelope.SerializeToString(), session, sequence)

    def seal_payload(self, payload: bytes, session: int, sequence: int) -> bytes:
        return wire.seal(self._send_key, Packet(payload, session, sequence))

    def receive(self) -> tuple[pb.Envelope, Packet, Address]:
        datagram, address = self.socket.recvfrom(2048)
        packet = wire.unseal(self._receive_key, datagram)
        assert isinstance(packet, Packet)
        return pb.Envelope.FromString(packet.payload), packet, address


class RawHeadset(RawPeer):
    """A headset that sends and receives single datagrams."""

    def __init__(self, server: Address, key: bytes = KEY) -> None:
        keys = wire.derive_keys(key)
        super().__init__(keys.to_pc, keys.to_headset)
        self.server = server

    def send(self, datagram: bytes) -> None:
        self.socket.sendto(datagram, self.server)

    def join(self, nonce: int = 1) -> int:
        """Say hello and return the session offered."""
        self.send(self.seal(pb.Envelope(hello=pb.Hello(nonce=nonce))))
        while True:
            envelope, _, _ = self.receive()
            if envelope.WhichOneof("body") == "welcome":
                assert envelope.welcome.nonce == nonce
                return envelope.welcome.session


class RawServer(RawPeer):
    """A PC that sends and receives single datagrams."""

    def __init__(self) -> None:
        keys = wire.derive_keys(KEY)
        super().__init__(keys.to_headset, keys.to_pc)

    def wait_for(self, body: str) -> tuple[pb.Envelope, Address]:
        while True:
            envelope, _, address = self.receive()
            if envelope.WhichOneof("body") == body:
                return envelope, address


@pytest.fixture
def server() -> Iterator[HeadsetServer]:
    with HeadsetServer(KEY) as server:
        yield server


@pytest.fixture
def new_headset(server: HeadsetServer) -> Iterator[Callable[..., RawHeadset]]:
    """Return a maker of raw headsets connected to the server."""
    made: list[RawHeadset] = []

    def make(key: bytes = KEY) -> RawHeadset:
        made.append(RawHeadset(server.address, key))
        return made[-1]

    yield make
    for headset in made:
        headset.socket.close()


@pytest.fixture
def raw_server() -> Iterator[RawServer]:
    server = RawServer()
    yield server
    server.socket.close()
