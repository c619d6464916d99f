"""Promises under a bad network and a flood, in short form; docs/protocol.md has the figures."""

from __future__ import annotations

import time

import numpy as np
import pytest

from handcal.core.errors import LinkError, PosePendingError
from handcal.core.types import EYES, HeadsetIdentity, Projection
from handcal.link.client import HeadsetClient
from handcal.link.impair import Impairment
from handcal.link.reliable import Delivery, Inbox
from handcal.link.server import HeadsetServer
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
