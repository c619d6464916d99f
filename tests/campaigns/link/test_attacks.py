"""Long attacks on the link: forged and hostile datagrams, replayed hellos, a rival headset."""

from __future__ import annotations

import multiprocessing
import os
import random
import socket
import time
from collections.abc import Iterator
from dataclasses import replace
from multiprocessing.synchronize import Event
from typing import TypeAlias

import numpy as np
import pytest

from handcal.core.errors import LinkError, PoseError
from handcal.core.geometry import rigid
from handcal.core.types import HeadsetIdentity
from handcal.link import handshake, messages, wire
from handcal.link.client import HeadsetClient
from handcal.link.pairing import Pairing, Pairings
from handcal.link.server import HeadsetServer
from handcal.link.transport import Address, UdpTransport
from handcal.link.wire import Packet, Slot, Welcome
from tests.helpers import eventually

pytestmark = pytest.mark.campaign

Told: TypeAlias = "multiprocessing.Queue[tuple[int, float, int]]"

IS_SHORT = "HANDCAL_SHORT_CAMPAIGNS" in os.environ
FORGED = 10_000 if IS_SHORT else 1_000_000
HOSTILE = 3_000 if IS_SHORT else 100_000
REPLAYS_HZ = 2_000.0 if IS_SHORT else 20_000.0
CONNECTS = 3 if IS_SHORT else 100
LATE_S = 0.5
RIVALRY_S = 2.0 if IS_SHORT else 20.0
KEYS = [f"a pairing key of the campaign {number}" for number in range(2)]
IDENTITIES = [HeadsetIdentity(f"{number + 1:016x}", f"Headset {number}") for number in range(2)]


@pytest.fixture
def server() -> Iterator[HeadsetServer]:
    pairings = [
        Pairing(key, one.device_id, one.name) for key, one in zip(KEYS, IDENTITIES, strict=True)
    ]
    with HeadsetServer(Pairings(tuple(pairings))) as server:
        yield server


@pytest.fixture
def headset(server: HeadsetServer) -> Iterator[HeadsetClient]:
    with HeadsetClient(server.address, KEYS[0].encode(), IDENTITIES[0]) as headset:
        headset.wait_connected(5.0)
        eventually(lambda: server.device)
        yield headset


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """Return the datagrams that are sent from here on."""
    seen: list[bytes] = []
    send = UdpTransport.send

    def spy(self: UdpTransport, datagram: bytes, address: Address) -> None:
        seen.append(datagram)
        send(self, datagram, address)

    monkeypatch.setattr(UdpTransport, "send", spy)
    return seen


def _recorded_hellos(server: HeadsetServer, sent: list[bytes]) -> list[bytes]:
    """Return the hellos that an eavesdropper records of a headset that connects and leaves."""
    with HeadsetClient(server.address, KEYS[0].encode(), IDENTITIES[0]) as headset:
        headset.wait_connected(5.0)
        eventually(lambda: server.device)
    eventually(lambda: not server.connected)
    return [datagram for datagram in sent if _is_hello(datagram)]


def _is_hello(datagram: bytes) -> bool:
    return datagram[4:12] == bytes(8) and datagram[wire.HEADER.size] == 0x0A


def _forge(chance: random.Random, recorded: list[bytes]) -> bytes:
    """Return a datagram as somebody without the key can make it."""
    base = bytearray(chance.choice(recorded))
    match chance.randrange(6):
        case 0:
            return chance.randbytes(chance.randrange(1500))
        case 1:
            return wire.MAGIC + b"\x02" + chance.randbytes(chance.randrange(120))
        case 2:
            base[chance.randrange(len(base))] ^= 1 << chance.randrange(8)
        case 3:
            del base[chance.randrange(len(base)) :]
        case 4:
            base += chance.randbytes(chance.randrange(1, 40))
        case _:
            base[4:20] = chance.randbytes(16)  # another session or device
    return bytes(base)


def test_no_forged_datagram_is_accepted(
    server: HeadsetServer, headset: HeadsetClient, sent: list[bytes]
) -> None:
    eventually(lambda: len(sent) > 50)
    recorded = [datagram for datagram in sent if datagram[2] == wire.VERSION]
    chance = random.Random(0)
    address = headset.address
    answered, taken = len(sent), 0
    for _ in range(FORGED // 1000):
        forged = [_forge(chance, recorded) for _ in range(1000)]
        with server._changed:  # in process, from the headset's own address
            before = server._received["datagrams"], server._rejected.total()
            for datagram in forged:
                if datagram not in recorded:
                    server._take(datagram, address)
                    taken += 1
            accepted = server._received["datagrams"] - before[0]
            rejected = server._rejected.total() - before[1]
        assert accepted == 0
        assert rejected == sum(datagram not in recorded for datagram in forged)
    assert taken > 0.95 * FORGED
    assert not [one for one in sent[answered:] if one[4:12] == bytes(8) and not _is_hello(one)]
    assert headset.connected
    print(f"{taken:,} forged datagrams, none accepted or answered")  # noqa: T201 (as below)


def test_hostile_messages_with_the_key_crash_nothing(server: HeadsetServer) -> None:
    device, key = int(IDENTITIES[0].device_id, 16), KEYS[0].encode()
    chance, rng = random.Random(0), np.random.default_rng(0)
    address: Address = ("127.0.0.1", 9)
    now = [0]

    def take(datagram: bytes) -> None:
        with server._changed:
            server._take(datagram, address)

    def greet(cookie: bytes) -> None:
        now[0] += 1
        keys = wire.handshake_keys(key, device)
        take(handshake.seal(keys.to_pc, device, handshake.hello(bytes(16), now[0], cookie, "x")))

    def payload() -> bytes:
        made = [
            messages.poses([(chance.choice((0, -(2**63), 2**63 - 1)), rigid(rng.normal(size=3)))]),
            messages.confirm(chance.randrange(-(2**63), 2**63), 2**32 - 1, chance.randbytes(16)),
            messages.device(replace(IDENTITIES[0], name="y" * 40), messages.Owner()),
            messages.ack(),
        ]
        content = bytearray(chance.choice(made).SerializeToString() or b"\x5a\x00")
        for _ in range(chance.randrange(4)):
            content[chance.randrange(len(content))] = chance.randrange(256)
        return bytes(content) * chance.choice((1, 1, 2))

    def session() -> tuple[Welcome, bytes]:
        greet(b"")
        with server._changed:
            cookie = server._reception.cookies.make(device, address, time.monotonic())
            server._channel = None
        greet(cookie)
        assert server._session is not None
        welcome = server._session.welcome
        return welcome, wire.session_keys(key, device, welcome).to_pc

    welcome, to_pc = session()
    for sequence in range(1, HOSTILE + 1):
        slot = chance.choice([*Slot, Slot.CONFIRM, Slot.DEVICE, Slot.UNRELIABLE])
        count = 1 if slot is Slot.UNRELIABLE else chance.choice((1, 1, 2, 256))
        packet = Packet(
            payload()[: wire.MAX_PAYLOAD_BYTES],
            welcome.session,
            sequence,
            slot,
            chance.randrange(2**32),
            chance.randrange(count),
            count,
        )
        take(wire.seal(to_pc, packet))
        if server._channel is None:  # a good-bye was among them
            welcome, to_pc = session()
        if sequence % 100 == 0:
            server.confirmations()
            with pytest.raises(PoseError):
                server.pose_at_host_ns(time.monotonic_ns())
    assert server.statistics().rejected["corrupt"] > HOSTILE / 100
    print(f"{HOSTILE:,} hostile messages with the key, nothing crashed")  # noqa: T201 (as above)
    server.send_prompt("still running")


def _replay(hellos: list[bytes], server: Address, ended: Event, told: Told) -> None:
    """Send hellos until told to end; report their number and rate, and the bytes answered."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as attacker:
        attacker.setblocking(False)
        count = answered = 0
        start_s = time.monotonic()
        while not ended.is_set():
            for _ in range(50):
                attacker.sendto(hellos[count % len(hellos)], server)
                count += 1
            try:
                while True:
                    answered += len(attacker.recv(2048))
            except BlockingIOError:
                pass
            time.sleep(max(0.0, start_s + count / REPLAYS_HZ - time.monotonic()))
        told.put((count, count / (time.monotonic() - start_s), answered))


@pytest.mark.process
def test_replayed_hellos_keep_nobody_out(server: HeadsetServer, sent: list[bytes]) -> None:
    hellos = _recorded_hellos(server, sent)
    ended = multiprocessing.Event()
    told: Told = multiprocessing.Queue()
    attack = multiprocessing.Process(target=_replay, args=(hellos, server.address, ended, told))
    attack.start()
    eventually(lambda: server.statistics().rejected["replayed"] > 1000)
    took_s = []
    for _ in range(CONNECTS):
        start_s = time.monotonic()
        with HeadsetClient(server.address, KEYS[0].encode(), IDENTITIES[0]) as headset:
            headset.wait_connected(10.0)
            took_s.append(time.monotonic() - start_s)
        eventually(lambda: not server.connected)
    ended.set()
    count, rate_hz, answered_bytes = told.get(timeout=10.0)
    attack.join()
    print(  # noqa: T201 (the campaign's figures)
        f"{count:,} replays at {rate_hz:,.0f}/s, {answered_bytes} bytes answered; connecting: "
        f"median {np.median(took_s):.3f} s, slowest {max(took_s):.3f} s"
    )
    assert sum(took > LATE_S for took in took_s) == 0
    assert answered_bytes <= 3 * max(map(len, hellos))
    assert rate_hz > 0.5 * REPLAYS_HZ, os.getloadavg()


def test_two_headsets_do_not_take_the_session_from_each_other(
    server: HeadsetServer, headset: HeadsetClient
) -> None:
    owners: set[str] = set()
    told_pc: set[str] = set()
    told_rival: set[str] = set()
    with HeadsetClient(server.address, KEYS[1].encode(), IDENTITIES[1]) as rival:
        end_s = time.monotonic() + RIVALRY_S
        while time.monotonic() < end_s:
            for client in (headset, rival):
                client.send_pose(np.eye(4), time.monotonic_ns())
            owners.add(server.device.device_id if server.device else "")
            told_pc.add(server.statistics().notice)
            told_rival.add(rival.refusal)
            assert headset.connected
            assert not rival.connected
            time.sleep(1 / 60)
        with pytest.raises(LinkError, match="Headset 0 is connected"):
            rival.wait_connected(0.0)
    assert owners == {IDENTITIES[0].device_id}
    assert told_pc - {""} == {"headset Headset 1 asks to connect; Headset 0 is connected"}
    assert len(told_rival - {""}) == 1
