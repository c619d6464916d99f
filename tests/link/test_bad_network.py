"""Promises under a bad network and a flood, in short form; docs/protocol.md has the figures."""

from __future__ import annotations

import os
import random
import socket
import threading
import time
from contextlib import suppress

import numpy as np
import pytest

from handcal.core.errors import LinkError, PosePendingError
from handcal.core.types import EYES, HeadsetIdentity, Projection
from handcal.link import wire
from handcal.link.client import HeadsetClient
from handcal.link.impair import Impairment
from handcal.link.reliable import Delivery, Inbox
from handcal.link.server import HeadsetServer
from handcal.link.transport import Address
from handcal.link.wire import Packet
from tests.helpers import eventually

KEY = b"a pairing key of the tests"
IDENTITY = HeadsetIdentity("c" * 16, "Lab 9")
P = np.array([[1500.0, 0.5, 634.0, -3.0], [0.0, 1490.0, 360.0, 2.0], [0.0, 0.0, 1.0, 0.001]])


@pytest.mark.parametrize("seed", range(5))
def test_half_of_all_datagrams_lost_and_others_reordered(seed: int) -> None:
    """Every projection is acknowledged, and then is the one that the headset draws with."""
    bad = Impairment(loss=0.5, reorder=0.2, seed=seed)
    with HeadsetServer(KEY) as server:
        sent = [server.send_projection(Projection(eye, P + seed, 1268, 720)) for eye in EYES]
        with HeadsetClient(server.address, KEY, IDENTITY, impairment=bad) as client:
            for message in sent:
                server.wait_acked(message, 15.0)
            drawn = client.state().drawn
            assert all(np.array_equal(drawn[eye].P, P + seed) for eye in EYES)


def test_a_projection_that_cannot_arrive_is_clearly_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("handcal.link.reliable.GIVE_UP_S", 0.5)
    with HeadsetServer(KEY) as server:
        with HeadsetClient(server.address, KEY, IDENTITY):
            server.wait_connected(5.0)
        eventually(lambda: not server.connected)
        message = server.send_projection(Projection("left", P, 1268, 720))
        with pytest.raises(LinkError, match="headset did not answer: the left projection was not"):
            server.wait_acked(message, 3.0)
        with pytest.raises(PosePendingError, match="sends no poses"):
            server.pose_at_host_ns(time.monotonic_ns())
        assert message.state is Delivery.FAILED
        assert server.statistics().failed == 1


def test_what_a_connected_headset_lacks_is_reported_until_it_has_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("handcal.link.reliable.GIVE_UP_S", 0.3)
    with (
        HeadsetServer(KEY) as server,
        HeadsetClient(server.address, KEY, IDENTITY),
    ):
        server.wait_connected(5.0)
        server.wait_acked(server.send_prompt("one"), 5.0)
        with monkeypatch.context() as patch:
            patch.setattr(Inbox, "take_receipts", lambda _: [])  # every acknowledgement is lost
            server.send_prompt("two")
            eventually(lambda: server.statistics().missing == ("prompt",))
        assert server.statistics().given_up["prompt"] == 1
        server.wait_acked(server.send_prompt("three"), 5.0)
        assert server.statistics().missing == ()
        assert server.statistics().given_up["prompt"] == 1


FLOOD_HZ = 5_000
FLOOD_S = 1.5


def flood(address: Address, is_over: threading.Event) -> int:
    """Send foreign datagrams of several kinds at `FLOOD_HZ`; return their number."""
    rng = random.Random(1)
    kinds = [rng.randbytes(1300)]
    for _ in range(50):
        identity, session = rng.getrandbits(64), rng.getrandbits(63) | 1
        kinds.append(wire.seal(os.urandom(32), Packet(rng.randbytes(200), sequence=identity)))
        kinds.append(wire.seal(os.urandom(32), Packet(rng.randbytes(1000), session, 5)))
    start_s, count = time.monotonic(), 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        while not is_over.wait(0.002):
            while count < FLOOD_HZ * (time.monotonic() - start_s):
                sender.sendto(kinds[count % len(kinds)], address)
                count += 1
    return count


@pytest.mark.parametrize("has_invitation", [False, True])
def test_a_flood_of_foreign_datagrams_costs_a_session_nothing(has_invitation: bool) -> None:
    is_over = threading.Event()
    counts: list[int] = []
    with (
        HeadsetServer(KEY) as server,
        HeadsetClient(server.address, KEY, IDENTITY) as client,
    ):
        server.wait_connected(5.0)
        if has_invitation:
            server.invite()
        thread = threading.Thread(target=lambda: counts.append(flood(server.address, is_over)))
        thread.start()
        stamps = []
        end_s = time.monotonic() + FLOOD_S
        while time.monotonic() < end_s:
            stamps.append(time.monotonic_ns())
            client.send_pose(np.eye(4), stamps[-1])
            assert server.connected
            is_over.wait(1 / 60)
        acked = server.send_prompt("Still here?")
        server.wait_acked(acked, 5.0)
        is_over.set()
        thread.join()
        statistics = server.statistics()
        arrived = sum(statistics.rejected.values()) / counts[0]
        assert counts[0] >= 0.5 * FLOOD_HZ * FLOOD_S
        # On a starved machine the system's buffer overflows, and drops from both alike.
        lost = statistics.lost_inbound / (statistics.received + statistics.lost_inbound)
        assert lost <= 1.0 - arrived + 0.1
        if arrived < 0.99:
            return

        def is_last_there() -> bool:
            client.send_pose(np.eye(4), time.monotonic_ns())
            with suppress(PosePendingError):
                server.pose_at_host_ns(stamps[-1])
                return True
            return False

        eventually(is_last_there)
        for t_ns in stamps[5:]:
            server.pose_at_host_ns(t_ns)  # every frame can be placed
