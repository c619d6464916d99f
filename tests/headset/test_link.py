"""The headset's link in C# against the real PC's end: restarts, loss, keys and versions."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from handcal.core.display import target_corners_m
from handcal.core.errors import PoseError
from handcal.core.geometry import rigid
from handcal.core.types import EYES, Eye, Float64, HeadsetIdentity, Projection
from handcal.link.client import HeadsetState
from handcal.link.impair import UNIMPAIRED, Impairment
from handcal.link.nudges import NudgeSum, VerifyRequest
from handcal.link.pairing import Pairing, Pairings
from handcal.link.server import Confirmation, HeadsetServer, Nudge
from handcal.link.shapes import Shape, Target
from handcal.link.transport import Address
from tests.headset.mono_client import MonoClient
from tests.headset.relay import Relay
from tests.helpers import eventually

pytestmark = pytest.mark.process
KEY = b"a pairing key of the tests"
IDENTITY = HeadsetIdentity("00000000000000c7", "Lab-2")
PATIENCE_S = 15.0
P = np.array([[1500.0, 0.5, 634.0, -3.0], [0.0, 1490.0, 360.0, 2.0], [0.0, 0.0, 1.0, 0.001]])

Connect = Callable[..., MonoClient]


@pytest.fixture
def server() -> Iterator[HeadsetServer]:
    with HeadsetServer(KEY) as server:
        yield server


@pytest.fixture
def connect(program: Path) -> Iterator[Connect]:
    """Return a maker of C# clients, given the PC's address."""
    made: list[MonoClient] = []

    def make(
        address: Address,
        key: bytes = KEY,
        identity: HeadsetIdentity = IDENTITY,
        impairment: Impairment = UNIMPAIRED,
        kept: Path | None = None,
    ) -> MonoClient:
        client = MonoClient(program, address, key, identity, time.monotonic_ns, impairment, kept)
        made.append(client)
        return client

    yield make
    for client in made:
        client.close()


def until(client: MonoClient, condition: Callable[[HeadsetState], object]) -> HeadsetState:
    """Return the first state of which a condition holds."""
    eventually(lambda: condition(client.state()), PATIENCE_S)
    return client.state()


def projection(eye: Eye, wearer: str = "Ada", shift: float = 0.0) -> Projection:
    T_V_H = rigid([0.01, 0.02, 0.03], [0.032, 0.0, 0.015])
    return Projection(eye, P + shift, 1268, 720, T_V_H, P, wearer, "rig A")


def show_everything(server: HeadsetServer, points: int = 3000) -> Float64:
    cloud = np.random.default_rng(3).normal(0.0, 0.1, (points, 3))
    server.send_cursor(cloud, 7, ("right",))
    server.send_prompt("Close your left eye.", ("right",))
    server.send_projection(projection("left"))
    server.send_projection(projection("right"))
    server.send_target(Target("right", target_corners_m(0.5)))
    server.send_shape(Shape(np.arange(24.0).reshape(8, 3), ("left",)))
    server.send_show(True)
    server.send_verify(VerifyRequest(3, "right", 1.0, 0.002))
    return cloud


def is_shown(thing: object) -> bool:
    return thing is not None


def is_everything(state: HeadsetState) -> bool:
    shown = state.cursor_W_m, state.target, state.shape, state.verify
    is_drawn = state.is_offline and len(state.drawn) == 2 and state.prompt != ""
    return is_drawn and all(map(is_shown, shown))


def is_pose(server: HeadsetServer, t_ns: int, T_W_H: Float64) -> bool:
    """Return whether the PC knows the pose of this time, and it is the right one."""
    try:
        return bool(np.allclose(server.pose_at_host_ns(t_ns), T_W_H, atol=1e-9))
    except PoseError:  # not yet, or lost on the way
        return False


@pytest.mark.parametrize("impairment", [UNIMPAIRED, Impairment(loss=0.3, reorder=0.3, seed=4)])
def test_everything_arrives_and_is_confirmed(
    server: HeadsetServer, connect: Connect, impairment: Impairment
) -> None:
    cloud = show_everything(server)
    client = connect(server.address, impairment=impairment)
    state = until(client, is_everything)
    assert state.cursor_W_m is not None
    np.testing.assert_allclose(state.cursor_W_m, cloud, atol=0.6e-4)
    assert (state.cursor_id, state.prompt, state.eyes) == (7, "Close your left eye.", ("right",))
    assert state.cursor_eyes == ("right",)
    np.testing.assert_array_equal(state.drawn["left"].P, P)
    np.testing.assert_array_equal(state.drawn["left"].T_V_H, projection("left").T_V_H)
    assert (state.owner.wearer, state.owner.rig) == ("Ada", "rig A")
    assert state.verify == VerifyRequest(3, "right", 1.0, 0.002)
    eventually(lambda: server.device is not None and server.shown.wearer == "Ada", PATIENCE_S)
    assert server.device is not None
    assert (server.device.name, server.device.protocol) == ("Lab-2", 2)

    T_W_H = rigid([0.1, -0.2, 0.3], [1.0, 2.0, 3.0])
    heard: list[Confirmation | Nudge] = []

    def hears(take: Callable[[], Sequence[Confirmation | Nudge]]) -> bool:
        client.send_pose(T_W_H, time.monotonic_ns())
        heard[:] = [*heard, *take()]
        return bool(heard)

    # Poses on both sides of the confirmation: some are lost.
    eventually(
        lambda: hears(list) or is_pose(server, time.monotonic_ns() - 100_000_000, T_W_H),
        PATIENCE_S,
    )
    t_b_ns = time.monotonic_ns()
    client.confirm(t_b_ns, client.state())
    eventually(lambda: hears(server.confirmations), PATIENCE_S)
    (confirmation,) = heard
    assert isinstance(confirmation, Confirmation)
    assert (confirmation.cursor_id, confirmation.problem) == (7, "")
    assert confirmation.t_headset_ns == t_b_ns
    assert abs(confirmation.t_host_ns - t_b_ns) < 50_000_000  # one clock: the fit finds no offset
    eventually(lambda: hears(list) and is_pose(server, t_b_ns, T_W_H), PATIENCE_S)
    until(client, lambda _: client.told["sent"] == "Acked")

    heard.clear()
    client.nudge(t_b_ns, client.state(), NudgeSum(-4.0, 2.0, 0.004), fits=True)
    eventually(lambda: hears(server.nudges), PATIENCE_S)
    nudge = heard[-1]
    assert isinstance(nudge, Nudge)
    assert (nudge.moved, nudge.fits, nudge.problem) == (NudgeSum(-4.0, 2.0, 0.004), True, "")
    assert int(client.told["Corrupt"]) == int(client.told["Unpaired"]) == 0


@pytest.mark.parametrize(("is_red", "eyes"), [(True, ("left",)), (False, ("left", "right"))])
def test_the_live_hand_is_decoded_as_sent(
    server: HeadsetServer, connect: Connect, is_red: bool, eyes: tuple[Eye, ...]
) -> None:
    client = connect(server.address)
    server.wait_connected(PATIENCE_S)
    outline = np.random.default_rng(5).normal(0.0, 0.05, (601, 3))
    server.send_live_hand(outline, is_red, eyes, is_outline=True)
    state = until(client, lambda s: s.live_W_m is not None and len(s.live_W_m) == 601)
    assert state.live_W_m is not None
    np.testing.assert_allclose(state.live_W_m, outline, atol=0.6e-4)
    assert (state.is_outline, state.is_over_limit, state.live_eyes) == (True, is_red, eyes)


def test_a_pc_that_is_restarted_finds_the_headset_again(connect: Connect) -> None:
    pairings = Pairings((Pairing(KEY.decode()),))
    with HeadsetServer(pairings) as server:
        address = server.address
        client = connect(address)
        show_everything(server)
        until(client, is_everything)
    bare = until(client, lambda s: client.dismissed and not client.connected)
    assert not any(map(is_shown, (bare.cursor_W_m, bare.target, bare.shape, bare.verify)))
    assert (bare.prompt, bare.is_offline) == ("", False)
    np.testing.assert_array_equal(bare.drawn["right"].P, P)  # the projections stay
    with HeadsetServer(pairings, address) as server:
        server.send_prompt("Welcome back.")
        state = until(client, lambda s: s.prompt == "Welcome back.")
        assert len(state.drawn) == 2
        eventually(lambda: server.shown.wearer == "Ada", PATIENCE_S)


def test_a_headset_that_is_restarted_shows_what_it_kept(
    server: HeadsetServer, connect: Connect, tmp_path: Path
) -> None:
    kept = tmp_path / "kept"
    first = connect(server.address, kept=kept)
    for wearer in ("Bea", "Ada"):
        for eye in EYES:
            sent = server.send_projection(projection(eye, wearer, float(len(wearer))))
            server.wait_acked(sent, PATIENCE_S)
    until(first, lambda s: s.owner.wearer == "Ada" and len(s.drawn) == 2)
    first.close()
    again = connect(("127.0.0.1", 9), kept=kept)  # no PC there
    state = again.state()
    assert (state.owner.wearer, sorted(state.drawn)) == ("Ada", ["left", "right"])
    np.testing.assert_array_equal(state.drawn["left"].P, P + 3.0)
    again.show_kept("Bea")
    assert until(again, lambda s: s.owner.wearer == "Bea").owner.rig == "rig A"
    again.show_kept("Carl")
    assert again.state().owner.wearer == "Bea"
    assert not again.connected


def test_a_headset_that_was_killed_takes_its_session_over(
    server: HeadsetServer, connect: Connect
) -> None:
    show_everything(server)
    first = connect(server.address)
    until(first, is_everything)
    first.kill()
    second = connect(server.address)
    until(second, is_everything)


def test_another_key_another_device_and_a_busy_pc(server: HeadsetServer, connect: Connect) -> None:
    first = connect(server.address)
    until(first, lambda _: first.connected)
    stranger = connect(server.address, key=b"another pairing key")
    eventually(lambda: server.statistics().rejected["unpaired"] > 3, PATIENCE_S)
    assert not stranger.state().projections
    assert not stranger.connected
    second = connect(server.address, identity=HeadsetIdentity("00000000000000c8", "Lab 3"))
    until(second, lambda _: "belongs to Lab-2: pair this headset again" in second.refusal)
    assert first.state() is not None
    assert first.connected


def test_a_busy_pc_is_named(connect: Connect) -> None:
    other = HeadsetIdentity("00000000000000c8", "Lab-3")
    keys = Pairings((Pairing(f"{KEY.decode()} 2", other.device_id, "Lab-3"), Pairing(KEY.decode())))
    with HeadsetServer(keys) as server:
        first = connect(server.address)
        until(first, lambda _: first.connected)
        second = connect(server.address, key=KEY + b" 2", identity=other)
        until(second, lambda _: second.refusal.startswith("Lab-2 is connected"))
        first.close()
        until(second, lambda _: second.connected)
        assert second.refusal == ""


@pytest.mark.parametrize("version", [1, 3])
def test_another_version_is_dropped_and_told(
    server: HeadsetServer, connect: Connect, version: int
) -> None:
    def change(datagram: bytes) -> bytes:
        return datagram[:2] + bytes([version]) + datagram[3:]

    with Relay(server.address, UNIMPAIRED, change) as relay:
        client = connect(relay.address)
        eventually(lambda: server.statistics().rejected["wrong_version"] > 3, PATIENCE_S)
        assert not client.state().projections
        assert not client.connected


@pytest.mark.parametrize("version", [1, 3])
def test_a_pc_of_another_version_is_named(
    server: HeadsetServer, connect: Connect, version: int
) -> None:
    def change(datagram: bytes) -> bytes:
        is_answer = b"Lab" not in datagram  # a hello tells the headset's name
        return datagram[:2] + bytes([version if is_answer else 2]) + datagram[3:]

    with Relay(server.address, UNIMPAIRED, change) as relay:
        client = connect(relay.address)
        until(client, lambda _: "update the older one" in client.refusal)
        assert client.refusal.startswith(f"The PC speaks protocol {version}, this app protocol 2")
        assert int(client.told["WrongVersion"]) > 0
