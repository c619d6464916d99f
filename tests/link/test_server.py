"""The PC's end against hand-made headsets, honest and hostile."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

from handcal.core.errors import LinkError, PosePendingError
from handcal.core.geometry import rigid
from handcal.core.types import Projection
from handcal.link import handcal_pb2 as pb
from handcal.link import messages
from handcal.link.pairing import Pairings
from handcal.link.server import Confirmation, HeadsetServer
from tests.helpers import eventually

NewHeadset = Callable[..., Any]
KEEP_ALIVE = messages.ack()


def pose(t_ns: int) -> pb.Envelope:
    return messages.poses([(t_ns, rigid(translation_m=[t_ns / 1e9, 0.0, 0.0]))])


def test_it_listens_on_loopback_unless_told_otherwise(server: HeadsetServer) -> None:
    assert server.address[0] == "127.0.0.1"
    assert server.address[1] > 0


def test_only_a_hello_with_its_cookie_connects(
    server: HeadsetServer, new_headset: NewHeadset
) -> None:
    headset = new_headset()
    headset.cookie()
    assert not server.connected
    headset.join()
    assert server.connected
    envelope, packet, _ = headset.receive()
    assert envelope.WhichOneof("body") == "ping"
    assert packet.sequence == 1


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda d: d[:-1] + bytes([d[-1] ^ 1]), "unpaired"),
        (lambda d: b"xx" + d[2:], "corrupt"),
        (lambda d: d[:2] + b"\x09" + d[3:], "wrong_version"),
        (lambda d: d + bytes(1400), "oversized"),
        (lambda d: d[:20], "corrupt"),
    ],
)
def test_spoilt_datagrams_are_counted_and_dropped(
    server: HeadsetServer,
    new_headset: NewHeadset,
    spoil: Callable[[bytes], bytes],
    reason: str,
) -> None:
    headset = new_headset()
    headset.send(spoil(headset.hello()))
    eventually(lambda: server.statistics().rejected[reason] == 1)
    assert server.statistics().sent == 0
    assert headset.join() != 0


def test_a_wrong_key_is_counted_and_never_answered(
    server: HeadsetServer, new_headset: NewHeadset
) -> None:
    stranger = new_headset(b"another pairing key")
    stranger.send(stranger.hello())
    eventually(lambda: server.statistics().rejected["unpaired"] == 1)
    assert server.statistics().sent == 0


def test_a_replayed_capture_does_nothing(server: HeadsetServer, new_headset: NewHeadset) -> None:
    headset, thief = new_headset(), new_headset()
    hellos = [headset.hello(), headset.hello(headset.cookie())]
    session = headset.join()
    capture = [headset.seal(pose(i), session, i) for i in range(1, 9)]
    for datagram in capture:
        headset.send(datagram)
    eventually(lambda: server.statistics().received == 8)

    for datagram in capture + hellos:
        headset.send(datagram)
    eventually(lambda: server.statistics().rejected["replayed"] == 10)
    for datagram in capture + hellos:
        thief.send(datagram)
    eventually(lambda: server.statistics().rejected["wrong_session"] == 8)
    eventually(lambda: server.statistics().rejected["replayed"] == 12)

    headset.send(headset.seal(pose(9), session, 9))
    eventually(lambda: server.statistics().received == 9)
    thief.socket.settimeout(0.3)
    with pytest.raises(TimeoutError):
        thief.receive()


def test_an_incumbent_stays_until_it_is_silent(
    pairings: Pairings, raw_headset: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("handcal.link.endpoint.SILENCE_S", 0.6)
    with HeadsetServer(pairings) as server:
        keys = [one.key.encode() for one in pairings.all if one.device_id]
        first, second = (raw_headset(server.address, keys[i], i + 1) for i in (0, 1))
        with first.socket, second.socket:
            session = first.join()
            refusal = second.refusal()
            assert refusal.other == "Headset 1"
            assert not refusal.is_key_taken
            notice = "headset Headset 2 asks to connect; Headset 1 is connected"
            assert server.statistics().notice == notice
            first.send(first.seal(KEEP_ALIVE, session, 1))
            eventually(lambda: not server.connected)
            second.join()
            assert server.connected
            first.send(first.seal(KEEP_ALIVE, session, 2))
            eventually(lambda: server.statistics().rejected["wrong_session"] == 1)


def test_a_device_that_restarts_takes_over_its_own_session(
    server: HeadsetServer, new_headset: NewHeadset
) -> None:
    first, restarted = new_headset(), new_headset()
    old = first.join()
    restarted.time_ns = 1000
    assert not restarted.refusal().is_key_taken  # the old session was heard just now
    assert "asks to connect" in server.statistics().notice
    time.sleep(0.6)
    assert server.connected
    assert restarted.join(nonce=b"n" * 16) != old
    assert server.connected


def test_a_lost_welcome_is_sent_again(server: HeadsetServer, new_headset: NewHeadset) -> None:
    headset = new_headset()
    cookie = headset.cookie()
    welcomes = []
    for _ in range(2):
        headset.send(headset.hello(cookie))
        welcomes.append(headset.receive_greeting().welcome.session)
    assert welcomes[0] == welcomes[1] != 0


def test_nonsense_from_a_paired_headset_is_corrupt(
    server: HeadsetServer, new_headset: NewHeadset
) -> None:
    headset = new_headset()
    session = headset.join()
    skewed = pb.Envelope(poses=pb.Poses(poses=[pb.Pose(t_headset_ns=1, T_W_H=[0.0] * 12)]))
    for sequence, envelope in enumerate((skewed, pb.Envelope(), pb.Envelope(ping=pb.Ping())), 1):
        headset.send(headset.seal(envelope, session, sequence))
    headset.send(headset.greeting(KEEP_ALIVE))  # outside any session
    eventually(lambda: server.statistics().rejected["corrupt"] == 4)
    assert server.statistics().pose_rate_hz == 0.0


OFFSET_NS = 7_000_000_000


def answer_ping(headset: Any, session: int, sequence: int) -> None:
    """Answer the next ping, on a clock that is `OFFSET_NS` ahead."""
    while not (envelope := headset.receive()[0]).HasField("ping"):
        pass
    now_ns = time.monotonic_ns() + OFFSET_NS
    pong = pb.Pong(
        t_sent_host_ns=envelope.ping.t_sent_host_ns,
        t_received_headset_ns=now_ns,
        t_sent_headset_ns=now_ns,
        highest_sequence=10,
        accepted=7,
    )
    headset.send(headset.seal(pb.Envelope(pong=pong), session, sequence))


def test_a_confirmation_waits_for_a_ping_that_was_sent_after_it(
    server: HeadsetServer, new_headset: NewHeadset
) -> None:
    """Only then is it known that the headset's clock was not set in between."""
    headset = new_headset()
    session = headset.join()
    for sequence in range(1, 8):
        answer_ping(headset, session, sequence)
    eventually(lambda: server.statistics().received == 7)
    confirm = messages.confirm(time.monotonic_ns() + OFFSET_NS, 1, bytes(16))
    headset.send(headset.seal(confirm, session, 8))
    eventually(lambda: server.statistics().received == 8)
    assert server.confirmations() == []
    heard: list[Confirmation] = []
    for sequence in range(9, 30):
        answer_ping(headset, session, sequence)
        heard += server.confirmations()
    (confirmation,) = heard
    assert confirmation.is_timed


def test_poses_are_told_at_the_hosts_time(server: HeadsetServer, new_headset: NewHeadset) -> None:
    headset = new_headset()
    session = headset.join()
    offset_ns = OFFSET_NS
    headset.send(headset.seal(KEEP_ALIVE, session, 1))
    with pytest.raises(PosePendingError, match="clock"):
        server.pose_at_host_ns(time.monotonic_ns())
    for sequence in range(2, 9):
        answer_ping(headset, session, sequence)
    eventually(lambda: server.statistics().clock_offset_ms is not None)
    statistics = server.statistics()
    assert statistics.clock_offset_ms == pytest.approx(7000.0, abs=2.0)
    assert statistics.lost == 3

    now_ns = time.monotonic_ns()
    for i in range(3):
        t_ns = now_ns + offset_ns + 10_000_000 * i
        T = rigid(translation_m=[0.1 * i, 0.0, 0.0])
        headset.send(headset.seal(messages.poses([(t_ns, T)]), session, 20 + i))
    eventually(lambda: server.statistics().pose_rate_hz == pytest.approx(100.0))
    assert server.pose_at_host_ns(now_ns + 10_000_000)[0, 3] == pytest.approx(0.1, abs=0.02)
    assert server.statistics().lost_inbound == 11


def test_giving_up_is_reported(
    pairing_key: bytes, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("handcal.link.reliable.GIVE_UP_S", 0.1)
    caplog.set_level("INFO")
    with HeadsetServer(pairing_key) as server:
        message = server.send_prompt("Raise your hand")
        assert server.statistics().unacked == 1
        with pytest.raises(LinkError, match="prompt was not acknowledged"):
            server.wait_acked(message, 3.0)
        assert server.statistics().failed == 1
    assert "delivery of the prompt failed" in caplog.text


def test_a_replaced_message_says_so(server: HeadsetServer) -> None:
    P = np.eye(3, 4)
    older = server.send_projection(Projection("left", P, 1268, 720))
    server.send_projection(Projection("left", P, 1268, 720))
    with pytest.raises(LinkError, match="left projection was replaced"):
        server.wait_acked(older, 1.0)


def test_nobody_answering_says_what_to_do(server: HeadsetServer) -> None:
    with pytest.raises(LinkError, match="check the address, the key and the firewall"):
        server.wait_connected(0.05)


def test_a_closed_link_refuses_and_leaves_no_thread(pairing_key: bytes) -> None:
    before = threading.active_count()
    server = HeadsetServer(pairing_key)
    assert threading.active_count() == before + 1
    server.close()
    server.close()
    assert threading.active_count() == before
    for use in (
        lambda: server.send_cursor(np.zeros((1, 3)), 1),
        lambda: server.send_live_hand(np.zeros((1, 3)), is_over_limit=False),
        server.confirmations,
        lambda: server.pose_at_host_ns(0),
    ):
        with pytest.raises(LinkError, match="closed"):
            use()


def test_a_hello_during_the_good_bye_is_not_welcomed(
    server: HeadsetServer, new_headset: NewHeadset, monkeypatch: pytest.MonkeyPatch
) -> None:
    headset = new_headset()
    cookie = headset.cookie()
    session = headset.join()
    hello = headset.hello(cookie, b"n" * 16)

    def receive(_timeout_s: float) -> list[tuple[bytes, Any]]:
        assert server._closing.wait(5.0)
        return [(hello, headset.address)]

    headset.send(headset.seal(KEEP_ALIVE, session, 1))
    server.wait_connected(3.0)
    monkeypatch.setattr(server._transport, "receive", receive)
    server.close()
    headset.socket.settimeout(0.2)
    heard = []
    with suppress(TimeoutError):
        while True:
            heard.append(headset.receive()[0].WhichOneof("body"))
    assert "bye" in heard
    assert "welcome" not in heard


def test_closing_the_link_ends_every_wait(server: HeadsetServer) -> None:
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(server.wait_connected, 60.0)
        time.sleep(0.05)
        server.close()
        with pytest.raises(LinkError, match="closed"):
            waiting.result(5.0)


def test_an_error_in_the_thread_reaches_the_caller(
    pairing_key: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("boom")

    monkeypatch.setattr(HeadsetServer, "_tick", fail)
    with (
        HeadsetServer(pairing_key) as server,
        pytest.raises(LinkError, match="stopped: boom"),
    ):
        server.wait_connected(3.0)


def test_a_taken_port_is_a_clear_error(server: HeadsetServer, pairing_key: bytes) -> None:
    with pytest.raises(LinkError, match="uses this port; end it, or choose another"):
        HeadsetServer(pairing_key, bind=server.address)


def test_an_address_of_another_computer_is_a_clear_error(pairing_key: bytes) -> None:
    with pytest.raises(LinkError, match="no such address; enter one of its own"):
        HeadsetServer(pairing_key, bind=("192.0.2.1", 0))
