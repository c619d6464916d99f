import socket
import time
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.core.geometry import rigid
from handcal.sim.scene import ScenePublisher, SceneReceiver, SceneState, pack, unpack


def _state(t_ns: int, with_hand: bool = True) -> SceneState:
    T_W_hand = rigid([0.3, -0.2, 0.1], [0.0, 0.1, 0.5]) if with_hand else None
    return SceneState(t_ns, rigid([0.1, 0.2, 0.3], [1.0, 2.0, 3.0]), T_W_hand)


@pytest.fixture
def receiver() -> Iterator[SceneReceiver]:
    with SceneReceiver() as receiver:
        yield receiver


def _settle(receiver: SceneReceiver, t_ns: int) -> SceneState | None:
    deadline_s = time.monotonic() + 2.0
    while time.monotonic() < deadline_s:
        state = receiver.latest()
        if state is not None and state.t_ns == t_ns:
            return state
        time.sleep(0.001)
    return None


@pytest.mark.parametrize("with_hand", [True, False])
def test_state_survives_the_datagram(with_hand: bool) -> None:
    state = _state(123, with_hand)
    back = unpack(pack(state))
    assert back is not None
    assert back.t_ns == 123
    np.testing.assert_array_equal(back.T_W_D, state.T_W_D)
    if state.T_W_hand is None:
        assert back.T_W_hand is None
    else:
        assert back.T_W_hand is not None
        np.testing.assert_array_equal(back.T_W_hand, state.T_W_hand)


@given(st.integers(0, len(pack(_state(0))) * 8 - 1))
def test_flipped_bits_give_a_rigid_pose_or_nothing(bit: int) -> None:
    data = bytearray(pack(_state(5)))
    data[bit // 8] ^= 1 << bit % 8
    state = unpack(bytes(data))
    if state is not None:
        for T in (state.T_W_D, state.T_W_hand):
            if T is not None:
                np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-5)
                assert np.isfinite(T).all()


def test_newest_state_wins_whatever_the_order(receiver: SceneReceiver) -> None:
    now_ns = time.monotonic_ns()
    with ScenePublisher(receiver.port) as publisher:
        for age_ns in (3000, 1000, 2000):
            publisher.publish(_state(now_ns - age_ns))
    assert _settle(receiver, now_ns - 1000) is not None
    time.sleep(0.02)
    newest = receiver.latest()
    assert newest is not None
    assert newest.t_ns == now_ns - 1000


def test_stale_future_and_foreign_datagrams_are_ignored(receiver: SceneReceiver) -> None:
    now_ns = time.monotonic_ns()
    with ScenePublisher(receiver.port) as publisher:
        publisher.publish(_state(now_ns - 2_000_000_000))
        publisher.publish(_state(now_ns + 3_600_000_000_000))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.sendto(b"x" * 1000, ("127.0.0.1", receiver.port))
        time.sleep(0.05)
        assert receiver.latest() is None
        publisher.publish(_state(now_ns))
    assert _settle(receiver, now_ns) is not None


def test_world_goes_dark_when_the_publisher_falls_silent(
    receiver: SceneReceiver, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_ns = time.monotonic_ns()
    with ScenePublisher(receiver.port) as publisher:
        publisher.publish(_state(now_ns))
    assert _settle(receiver, now_ns) is not None
    monkeypatch.setattr(time, "monotonic_ns", lambda: now_ns + 1_100_000_000)
    assert receiver.latest() is None
