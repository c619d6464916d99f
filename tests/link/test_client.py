"""The headset's end: against the real server over a bad network, and against a hostile one."""

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from handcal.core.errors import PosePendingError
from handcal.core.geometry import rigid
from handcal.core.types import EYES, Eye, HeadsetIdentity, HeadsetView, Projection
from handcal.link import client as client_module
from handcal.link import messages
from handcal.link.client import HeadsetClient, HeadsetState
from handcal.link.fields import MalformedError, read_text
from handcal.link.impair import Impairment
from handcal.link.messages import Owner
from handcal.link.pairing import Pairing
from handcal.link.server import Confirmation, HeadsetServer
from handcal.link.shapes import Shape
from tests.helpers import eventually
from tests.link.conftest import IDENTITY, TARGET, hand, projection

BAD = Impairment(loss=0.3, reorder=0.2, duplicate=0.2, delay_s=0.003, seed=1)
OFFSET_NS = 20_000_000


def headset_clock_ns() -> int:
    return time.monotonic_ns() + OFFSET_NS


@pytest.fixture
def client(server: HeadsetServer, pairing_key: bytes) -> Iterator[HeadsetClient]:
    with HeadsetClient(server.address, pairing_key, IDENTITY) as client:
        yield client


@pytest.fixture
def bad_client(server: HeadsetServer, pairing_key: bytes) -> Iterator[HeadsetClient]:
    """Return a client behind a bad network, with a clock of its own."""
    with HeadsetClient(
        server.address, pairing_key, IDENTITY, headset_clock_ns, impairment=BAD
    ) as client:
        yield client


def test_everything_gets_through_a_bad_network(
    server: HeadsetServer, bad_client: HeadsetClient
) -> None:
    sent = [
        server.send_cursor(hand(), 3, ["right"]),
        server.send_prompt("Cover the outline", ["right"]),
        server.send_projection(projection("left", 1.0)),
        server.send_projection(projection("right", 2.0)),
        server.send_target(TARGET),
    ]
    for message in sent:
        server.wait_acked(message, 5.0)
    state, statistics = bad_client.state(), server.statistics()
    assert state.cursor_W_m is not None
    np.testing.assert_allclose(state.cursor_W_m, hand(), atol=5.1e-5)
    assert (state.cursor_id, state.prompt, state.eyes) == (3, "Cover the outline", ("right",))
    assert state.cursor_eyes == ("right",)
    assert {eye: state.projections[eye].P[0, 0] for eye in EYES} == {"left": 1.0, "right": 2.0}
    assert state.target is not None
    assert state.target.eye == "left"
    np.testing.assert_array_equal(state.target.corners_V_m, TARGET.corners_V_m)
    assert (statistics.acked, statistics.unacked, statistics.failed) == (5, 0, 0)
    assert statistics.resent > 0
    assert sum(statistics.rejected.values()) == statistics.rejected["replayed"]


def test_the_newest_of_many_stays(server: HeadsetServer, bad_client: HeadsetClient) -> None:
    bad_client.wait_connected(5.0)
    seen: list[float] = []
    for i in range(1, 41):
        last = server.send_projection(projection("left", float(i)))
        time.sleep(0.005)
        shown = bad_client.state().projections.get("left")
        seen += [shown.P[0, 0]] if shown else []
    server.wait_acked(last, 5.0)
    time.sleep(0.1)
    seen.append(bad_client.state().projections["left"].P[0, 0])
    assert seen == sorted(seen)
    assert seen[-1] == 40.0


def test_a_confirmation_arrives_once_on_the_hosts_clock(
    server: HeadsetServer, bad_client: HeadsetClient
) -> None:
    confirmations = []
    server.wait_acked(server.send_cursor(hand(), 5), 5.0)
    t_host_ns = time.monotonic_ns()
    bad_client.wait_acked(bad_client.confirm(t_host_ns + OFFSET_NS, bad_client.state()), 5.0)
    for _ in range(100):
        confirmations += server.confirmations()
        time.sleep(0.02)
    (confirmation,) = confirmations
    assert confirmation.cursor_id == 5
    assert confirmation.problem == ""
    assert confirmation.t_headset_ns == t_host_ns + OFFSET_NS
    assert abs(confirmation.t_host_ns - t_host_ns) < 5_000_000


def heard(server: HeadsetServer) -> Confirmation:
    """Return the next confirmation."""
    found: list[Confirmation] = []

    def hear() -> bool:
        found.extend(server.confirmations())
        return bool(found)

    eventually(hear)
    return found[0]


def confirmed(server: HeadsetServer, client: HeadsetClient, state: HeadsetState) -> str:
    """Confirm with a state, and return the difference that the PC finds."""
    client.wait_acked(client.confirm(time.monotonic_ns(), state), 5.0)
    return heard(server).problem


def test_a_confirmation_of_stale_drawings_is_found_out(
    server: HeadsetServer, client: HeadsetClient
) -> None:
    P = np.arange(12.0).reshape(3, 4)
    server.wait_acked(server.send_projection(Projection("left", P, 1268, 720)), 5.0)
    server.wait_acked(server.send_cursor(hand(), 1), 5.0)
    first = client.state()
    assert confirmed(server, client, first) == ""
    moved = Projection("left", P, 1268, 720, P_offline=P + 1e-9)
    server.wait_acked(server.send_projection(moved), 5.0)
    second = client.state()
    assert confirmed(server, client, second) == ""
    server.wait_acked(server.send_show(is_offline=True), 5.0)
    assert "other projections" in confirmed(server, client, second)
    assert confirmed(server, client, client.state()) == ""
    server.wait_acked(server.send_show(is_offline=False), 5.0)
    server.wait_acked(server.send_cursor(hand(1), 1), 5.0)
    assert "another cursor" in confirmed(server, client, second)
    assert confirmed(server, client, client.state()) == ""


def test_a_cursor_of_an_older_pc_is_for_both_eyes(
    server: HeadsetServer, client: HeadsetClient
) -> None:
    server.wait_acked(server.send_cursor(hand(), 3, ["right"]), 5.0)
    right = client.state()
    server.wait_acked(server.send_cursor(hand(), 3, []), 5.0)
    assert client.state().cursor_eyes == EYES
    # A headset that does not know the eyes makes the same digest.
    assert confirmed(server, client, right) == ""


def test_a_lost_datagram_loses_no_pose(server: HeadsetServer, bad_client: HeadsetClient) -> None:
    bad_client.wait_connected(5.0)
    start_ns, period_ns = headset_clock_ns(), 10_000_000
    for i in range(100):
        bad_client.send_pose(rigid(translation_m=[i / 1000, 0.0, 0.0]), start_ns + i * period_ns)
        time.sleep(0.001)
    time.sleep(0.05)
    # 30 % lost would leave 70 Hz; a pose is lost only with three datagrams in a row.
    assert server.statistics().pose_rate_hz > 90.0
    eventually(lambda: server.statistics().clock_offset_ms is not None)
    middle_ns = start_ns - OFFSET_NS + 50 * period_ns
    assert server.pose_at_host_ns(middle_ns)[0, 3] == pytest.approx(0.05, abs=0.001)


def test_loss_only_thins_the_live_hand(server: HeadsetServer, bad_client: HeadsetClient) -> None:
    counts = []
    server.wait_connected(5.0)
    for i in range(20):
        server.send_live_hand(hand(i), is_over_limit=i % 2 == 0)
        time.sleep(0.03)
        state = bad_client.state()
        if state.live_W_m is not None:
            counts.append(len(state.live_W_m))
    assert 0.3 * 5000 < np.mean(counts) < 0.9 * 5000


def test_the_live_hand_carries_its_colour_and_its_absence(
    server: HeadsetServer, client: HeadsetClient
) -> None:
    server.wait_connected(5.0)
    server.send_live_hand(hand(), is_over_limit=True)
    eventually(lambda: client.state().live_W_m is not None and client.state().is_over_limit)
    server.send_live_hand(np.empty((0, 3)), is_over_limit=False)
    eventually(lambda: client.state().live_W_m is None and not client.state().is_over_limit)


def test_what_is_shown_can_be_taken_away(server: HeadsetServer, client: HeadsetClient) -> None:
    cube = Shape(np.arange(24.0).reshape(8, 3), ("right",))
    for message in (server.send_cursor(hand(), 1), server.send_target(TARGET)):
        server.wait_acked(message, 5.0)
    server.wait_acked(server.send_shape(cube), 5.0)
    state = client.state()
    assert state.cursor_W_m is not None
    assert state.target is not None
    assert state.shape is not None
    assert state.shape.eyes == ("right",)
    np.testing.assert_array_equal(state.shape.corners_W_m, cube.corners_W_m)
    server.send_cursor(np.empty((0, 3)), 2)
    for message in (server.send_target(None), server.send_shape(None)):
        server.wait_acked(message, 5.0)
    eventually(lambda: client.state().cursor_W_m is None)
    assert (client.state().target, client.state().shape) == (None, None)


def test_a_headset_introduces_itself_and_says_what_has_changed(
    server: HeadsetServer, pairing_key: bytes
) -> None:
    view = HeadsetView(rigid(translation_m=[0.03, 0, 0]), np.array([-0.3, 0.3, -0.2, 0.2]), 9, 8)
    with HeadsetClient(server.address, pairing_key, IDENTITY) as client:
        eventually(lambda: server.device)
        assert server.device is not None
        assert (server.device.device_id, server.device.name) == (IDENTITY.device_id, "Lab 1")
        client.set_identity(replace(IDENTITY, views={"left": view}, eye_distance_m=0.064))
        eventually(lambda: server.device and server.device.eye_distance_m == 0.064)
        np.testing.assert_array_equal(server.device.views["left"].T_V_H, view.T_V_H)
        with pytest.raises(ValueError, match="keeps its device_id"):
            client.set_identity(HeadsetIdentity("0" * 16))
    eventually(lambda: not server.connected)


def test_projections_are_kept_by_wearer_and_dropped_with_the_rig(
    server: HeadsetServer, client: HeadsetClient
) -> None:
    def send(wearer: str, rig: str, eye: Eye = "left") -> None:
        P = np.full((3, 4), float(len(wearer)))
        made = Projection(eye, P, 1268, 720, wearer=wearer, rig=rig)
        server.wait_acked(server.send_projection(made), 5.0)

    send("Anna", "rig A")
    send("Anna", "rig A", "right")
    assert set(client.state().projections) == set(EYES)
    send("Bo", "rig A")
    assert set(client.state().projections) == {"left"}  # not the right eye's of Anna
    assert set(client.kept) == {Owner("Anna", "rig A"), Owner("Bo", "rig A")}
    eventually(lambda: server.shown == Owner("Bo", "rig A"))
    client.show_kept(Owner("Anna", "rig A"))
    assert client.state().projections["right"].P[0, 0] == 4.0
    eventually(lambda: server.shown == Owner("Anna", "rig A"))
    send("Cleo", "rig B")
    assert set(client.kept) == {Owner("Cleo", "rig B")}
    eventually(lambda: server.shown == Owner("Cleo", "rig B"))


def test_the_offline_calibration_is_drawn_meanwhile(
    server: HeadsetServer, client: HeadsetClient
) -> None:
    made = Projection("left", np.ones((3, 4)), 9, 8, P_offline=np.zeros((3, 4)))
    server.wait_acked(server.send_projection(made), 5.0)
    server.wait_acked(server.send_show(is_offline=True), 5.0)
    assert client.state().drawn["left"].P[0, 0] == 0.0
    assert client.state().projections["left"].P[0, 0] == 1.0


def test_an_outline_arrives_in_order_for_its_eyes(
    server: HeadsetServer, client: HeadsetClient
) -> None:
    outline = np.column_stack([np.linspace(0, 1, 650), np.zeros(650), np.zeros(650)])
    server.wait_connected(5.0)
    server.send_live_hand(outline, is_over_limit=False, eyes=("left",), is_outline=True)

    def is_whole() -> bool:
        live_W_m = client.state().live_W_m
        return live_W_m is not None and len(live_W_m) == len(outline)

    eventually(is_whole)
    state = client.state()
    assert state.live_W_m is not None
    assert state.is_outline
    assert state.live_eyes == ("left",)
    np.testing.assert_allclose(state.live_W_m, outline, atol=1e-4)


def test_an_outline_with_a_missing_chunk_is_points(
    server: HeadsetServer, client: HeadsetClient
) -> None:
    whole = messages.live_hand(hand(count=650), False, 10**6, is_outline=True)
    assert len(whole) > 2
    server.wait_connected(5.0)
    with server._changed:
        server._stream.extend(whole[1:])
    eventually(lambda: client.state().live_W_m is not None)
    assert not client.state().is_outline


@pytest.mark.parametrize("step_s", [-0.3, 0.3])
def test_around_a_step_of_the_headset_s_clock_nothing_is_taken(
    server: HeadsetServer, pairing_key: bytes, step_s: float
) -> None:
    ahead = [OFFSET_NS]

    def clock_ns() -> int:
        return time.monotonic_ns() + ahead[0]

    with HeadsetClient(server.address, pairing_key, IDENTITY, clock_ns) as client:
        eventually(lambda: server.statistics().clock_offset_ms is not None)
        client.send_pose(np.eye(4), clock_ns())
        ahead[0] += round(step_s * 1e9)
        # Before any ping could show it, with the clock's old time and its new one.
        for t_ns in (clock_ns() - round(step_s * 1e9), clock_ns()):
            client.wait_acked(client.confirm(t_ns, client.state()), 5.0)
            confirmation = heard(server)
            assert not confirmation.is_timed
            assert abs(confirmation.t_host_ns - time.monotonic_ns()) < 2e9
        assert server.clock_step_s == pytest.approx(step_s, abs=0.01)
        with pytest.raises(PosePendingError):
            server.pose_at_host_ns(time.monotonic_ns())
        eventually(lambda: server.clock_step_s == 0.0, 5.0)
        client.wait_acked(client.confirm(clock_ns(), client.state()), 5.0)
        assert heard(server).is_timed


def test_poses_of_the_future_are_dropped_and_told(
    server: HeadsetServer, pairing_key: bytes
) -> None:
    with HeadsetClient(server.address, pairing_key, IDENTITY, headset_clock_ns) as client:
        client.send_pose(np.eye(4), headset_clock_ns() + 3_600 * 10**9)
        eventually(lambda: server.statistics().clock_offset_ms is not None)
        for hour in range(2, 4):  # before and after the clock is known
            client.send_pose(np.eye(4), headset_clock_ns() + hour * 3_600 * 10**9)
        eventually(lambda: "restart its app" in server.statistics().notice)
        for _ in range(10):
            client.send_pose(np.eye(4), headset_clock_ns())
            time.sleep(0.01)
        eventually(lambda: 50.0 < server.statistics().pose_rate_hz < 110.0)


@pytest.mark.parametrize("name", ["\x9b2J", "a\u202egnp", "\u200b", "two\nlines", "\x85"])
def test_a_name_that_is_not_all_seen_is_refused(name: str) -> None:
    with pytest.raises(MalformedError):
        read_text(name, 40)
    with pytest.raises(ValueError, match="control characters"):
        Pairing("k" * 16, IDENTITY.device_id, name)
    assert read_text("Ärger\N{NO-BREAK SPACE}5 %", 40)


def test_a_client_is_not_bound_to_the_address_of_today() -> None:
    assert client_module._own_side(("127.0.0.1", 5)) == ("127.0.0.1", 0)
    assert client_module._own_side(("192.0.2.77", 5))[0] in ("0.0.0.0", "127.0.0.1")
