"""The headset's end: against the real server over a bad network, and against a hostile one."""

import threading
import time
from functools import partial
from typing import Any

import numpy as np
import pytest

from handcal.display import target_corners_m
from handcal.errors import LinkError
from handcal.geometry import rigid
from handcal.link import handcal_pb2 as pb
from handcal.link import messages
from handcal.link.client import HeadsetClient
from handcal.link.impair import Impairment
from handcal.link.server import HeadsetServer
from handcal.link.settings import LinkSettings
from handcal.types import EYES, Float64, Projection, Target
from tests.helpers import eventually

BAD = Impairment(loss=0.3, reorder=0.2, duplicate=0.2, delay_s=0.003, seed=1)
OFFSET_NS = 20_000_000
TARGET = Target("left", target_corners_m(0.5))


def hand(seed: int = 0, count: int = 5000) -> Float64:
    return np.random.default_rng(seed).normal([0.0, 0.0, 0.5], 0.05, (count, 3))


def headset_clock_ns() -> int:
    return time.monotonic_ns() + OFFSET_NS


def projection(eye: Any, value: float) -> Projection:
    return Projection(eye, np.full((3, 4), value), 1268, 720)


def test_everything_gets_through_a_bad_network(server: HeadsetServer, pairing_key: bytes) -> None:
    with HeadsetClient(server.address, pairing_key, impairment=BAD) as client:
        sent = [
            server.send_cursor(hand(), 3),
            server.send_prompt("Cover the outline", ["right"]),
            server.send_projection(projection("left", 1.0)),
            server.send_projection(projection("right", 2.0)),
            server.send_target(TARGET),
        ]
        for message in sent:
            server.wait_acked(message, 5.0)
        state, statistics = client.state(), server.statistics()
    assert state.cursor_W_m is not None
    np.testing.assert_allclose(state.cursor_W_m, hand(), atol=5.1e-5)
    assert (state.cursor_id, state.prompt, state.eyes) == (3, "Cover the outline", ("right",))
    assert {eye: state.projections[eye].P[0, 0] for eye in EYES} == {"left": 1.0, "right": 2.0}
    assert state.target is not None
    assert state.target.eye == "left"
    np.testing.assert_array_equal(state.target.corners_V_m, TARGET.corners_V_m)
    assert (statistics.acked, statistics.unacked, statistics.failed) == (5, 0, 0)
    assert statistics.resent > 0
    assert sum(statistics.rejected.values()) == statistics.rejected["replayed"]


def test_the_newest_of_many_stays(server: HeadsetServer, pairing_key: bytes) -> None:
    with HeadsetClient(server.address, pairing_key, impairment=BAD) as client:
        client.wait_connected(5.0)
        seen: list[float] = []
        for i in range(1, 41):
            last = server.send_projection(projection("left", float(i)))
            time.sleep(0.005)
            shown = client.state().projections.get("left")
            seen += [shown.P[0, 0]] if shown else []
        server.wait_acked(last, 5.0)
        time.sleep(0.1)
        seen.append(client.state().projections["left"].P[0, 0])
    assert seen == sorted(seen)
    assert seen[-1] == 40.0


def test_a_confirmation_arrives_once_on_the_hosts_clock(
    server: HeadsetServer, pairing_key: bytes
) -> None:
    T_E_W = {eye: rigid([0.0, 0.1, 0.0], [x, 0.0, 0.2]) for eye, x in (("left", -1), ("right", 1))}
    confirmations = []
    with HeadsetClient(server.address, pairing_key, headset_clock_ns, impairment=BAD) as client:
        client.wait_connected(5.0)
        t_host_ns = time.monotonic_ns()
        message = client.confirm(T_E_W, t_host_ns + OFFSET_NS, cursor_id=5)  # type: ignore[arg-type]
        client.wait_acked(message, 5.0)
        for _ in range(100):
            confirmations += server.confirmations()
            time.sleep(0.02)
    (confirmation,) = confirmations
    assert confirmation.cursor_id == 5
    assert confirmation.t_headset_ns == t_host_ns + OFFSET_NS
    assert abs(confirmation.t_host_ns - t_host_ns) < 5_000_000
    for eye in EYES:
        np.testing.assert_array_equal(confirmation.T_E_W[eye], T_E_W[eye])


def test_a_lost_datagram_loses_no_pose(server: HeadsetServer, pairing_key: bytes) -> None:
    with HeadsetClient(server.address, pairing_key, headset_clock_ns, impairment=BAD) as client:
        client.wait_connected(5.0)
        start_ns, period_ns = headset_clock_ns(), 10_000_000
        for i in range(100):
            client.send_pose(rigid(translation_m=[i / 1000, 0.0, 0.0]), start_ns + i * period_ns)
            time.sleep(0.001)
        time.sleep(0.05)
        # 30 % lost would leave 70 Hz; a pose is lost only with three datagrams in a row.
        assert server.statistics().pose_rate_hz > 90.0
        eventually(lambda: server.statistics().clock_offset_ms is not None)
        middle_ns = start_ns - OFFSET_NS + 50 * period_ns
        assert server.pose_at_host_ns(middle_ns)[0, 3] == pytest.approx(0.05, abs=0.001)


def test_loss_only_thins_the_live_hand(server: HeadsetServer, pairing_key: bytes) -> None:
    counts = []
    with HeadsetClient(server.address, pairing_key, impairment=BAD) as client:
        server.wait_connected(5.0)
        for i in range(20):
            server.send_live_hand(hand(i), is_over_limit=i % 2 == 0)
            time.sleep(0.03)
            state = client.state()
            if state.live_W_m is not None:
                counts.append(len(state.live_W_m))
    assert 0.3 * 5000 < np.mean(counts) < 0.9 * 5000


def test_the_live_hand_carries_its_colour_and_its_absence(
    server: HeadsetServer, pairing_key: bytes
) -> None:
    with HeadsetClient(server.address, pairing_key) as client:
        server.wait_connected(5.0)
        server.send_live_hand(hand(), is_over_limit=True)
        eventually(lambda: client.state().live_W_m is not None and client.state().is_over_limit)
        server.send_live_hand(np.empty((0, 3)), is_over_limit=False)
        eventually(lambda: client.state().live_W_m is None and not client.state().is_over_limit)


def test_a_cursor_can_be_taken_away(server: HeadsetServer, pairing_key: bytes) -> None:
    with HeadsetClient(server.address, pairing_key) as client:
        server.wait_acked(server.send_cursor(hand(), 1), 5.0)
        assert client.state().cursor_W_m is not None
        server.wait_acked(server.send_cursor(np.empty((0, 3)), 2), 5.0)
        assert client.state().cursor_W_m is None


def test_a_target_can_be_taken_away(server: HeadsetServer, pairing_key: bytes) -> None:
    with HeadsetClient(server.address, pairing_key) as client:
        server.wait_acked(server.send_target(TARGET), 5.0)
        assert client.state().target is not None
        server.wait_acked(server.send_target(None), 5.0)
        assert client.state().target is None


def has_prompt(client: HeadsetClient, text: str) -> bool:
    return client.state().prompt == text


def test_a_headset_that_starts_again_is_sent_the_state_again(
    server: HeadsetServer, pairing_key: bytes
) -> None:
    for _ in range(2):
        with HeadsetClient(server.address, pairing_key) as client:
            if server.statistics().sent == 0:
                server.wait_acked(server.send_prompt("Raise your hand"), 5.0)
            eventually(partial(has_prompt, client, "Raise your hand"))
        eventually(lambda: not server.connected)


def test_a_pc_that_starts_again_is_found_again(pairing_key: bytes) -> None:
    with HeadsetServer(pairing_key) as first:
        address = first.address
        client = HeadsetClient(address, pairing_key)
        first.wait_acked(first.send_projection(projection("left", 1.0)), 5.0)
        first.wait_acked(first.send_prompt("old"), 5.0)
    with client, HeadsetServer(pairing_key, bind=address) as second:
        second.wait_connected(5.0)
        client.wait_connected(5.0)
        assert not client.dismissed
        assert client.state().prompt == ""
        assert client.state().projections["left"].P[0, 0] == 1.0


def test_silence_is_noticed(pairing_key: bytes, raw_server: Any) -> None:
    settings = LinkSettings(silence_s=0.3)
    with HeadsetClient(raw_server.address, pairing_key, settings=settings) as client:
        hello, address = raw_server.wait_for("hello")
        welcome = pb.Envelope(welcome=pb.Welcome(nonce=hello.hello.nonce, session=9))
        raw_server.socket.sendto(raw_server.seal(welcome), address)
        raw_server.wait_for("ack")
        assert not client.connected
        raw_server.socket.sendto(raw_server.seal(messages.ack(), 9, 1), address)
        eventually(lambda: client.connected)
        again, _ = raw_server.wait_for("hello")
        assert again.hello.nonce != hello.hello.nonce
        assert not client.connected

        raw_server.socket.sendto(raw_server.seal(welcome), address)
        raw_server.socket.sendto(raw_server.seal(messages.prompt("old", EYES), 9, 1), address)
        time.sleep(0.05)
        assert not client.connected
        assert client.state().prompt == ""


def test_a_wrong_key_connects_nobody(server: HeadsetServer) -> None:
    with (
        HeadsetClient(server.address, b"another pairing key") as client,
        pytest.raises(LinkError, match="key"),
    ):
        client.wait_connected(0.3)
    assert server.statistics().rejected["unpaired"] > 0


def test_the_pc_says_good_bye(pairing_key: bytes) -> None:
    before = threading.active_count()
    server = HeadsetServer(pairing_key)
    with HeadsetClient(server.address, pairing_key) as client:
        client.wait_connected(5.0)
        server.close()
        eventually(lambda: client.dismissed)
        assert not client.connected
    assert threading.active_count() == before


@pytest.mark.parametrize("host", ["no-such-host.invalid", "no..name", "n" * 80])
def test_an_unknown_host_is_a_clear_error(pairing_key: bytes, host: str) -> None:
    with pytest.raises(LinkError, match="unknown host"):
        HeadsetClient((host, 1), pairing_key)
