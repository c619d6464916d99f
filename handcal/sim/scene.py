"""Light: how the simulated world reaches the simulated camera in another process.

The virtual headset hosts the wearer, whose head and hand the camera must see. Their true poses are
sent as datagrams over loopback. Only the simulated camera reads them, to render frames; nothing
else in the engine may.
"""

from __future__ import annotations

import math
import socket
import struct
import time
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from handcal.core.frozen import freeze
from handcal.core.geometry import is_rigid, rigid
from handcal.core.types import Float64
from handcal.io.closable import Closable

_MAGIC = b"hcS1"
# Magic, host time in ns, whether there is a hand, and the upper 3x4 of both poses by rows.
_DATAGRAM = struct.Struct("<4sq?12d12d")
_STALE_NS = 1_000_000_000
_REACH_M = 1e3


@dataclass(frozen=True, slots=True, eq=False)
class SceneState:
    """The moving part of the world at one instant."""

    t_ns: int
    """Host's monotonic time."""
    T_W_D: Float64
    """(4, 4); true pose of the depth camera."""
    T_W_hand: Float64 | None
    """(4, 4); true pose of the hand; None while it is out of sight."""

    def __post_init__(self) -> None:
        freeze(self, "T_W_D", np.float64, 4, 4)
        freeze(self, "T_W_hand", np.float64, 4, 4)


def pack(state: SceneState) -> bytes:
    """Return the state as a datagram."""
    T_W_hand = np.eye(4) if state.T_W_hand is None else state.T_W_hand
    poses = np.concatenate([state.T_W_D[:3].ravel(), T_W_hand[:3].ravel()])
    return _DATAGRAM.pack(_MAGIC, state.t_ns, state.T_W_hand is not None, *poses)


def unpack(datagram: bytes) -> SceneState | None:
    """Return the state in a datagram, or None if it is not one with rigid poses."""
    if len(datagram) != _DATAGRAM.size:
        return None
    magic, t_ns, has_hand, *numbers = _DATAGRAM.unpack(datagram)
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, :3] = np.reshape(numbers, (2, 3, 4))
    if magic != _MAGIC or not all(is_rigid(T, _REACH_M) for T in poses):
        return None
    return SceneState(t_ns, poses[0], poses[1] if has_hand else None)


class ScenePublisher(Closable):
    """Sends states to a receiver on this machine."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", port))

    def publish(self, state: SceneState) -> None:
        """Send a state; a missing receiver is not an error."""
        with suppress(ConnectionRefusedError):
            self._socket.send(pack(state))

    def close(self) -> None:
        """Close the socket; safe to call twice."""
        self._socket.close()


class SceneReceiver(Closable):
    """Receives states and keeps the newest.

    Parameters
    ----------
    port : int
        0 for any free port.

    Attributes
    ----------
    port : int
    """

    def __init__(self, port: int = 0) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self._socket.setblocking(False)
        self.port: int = self._socket.getsockname()[1]
        self._newest: SceneState | None = None

    def latest(self) -> SceneState | None:
        """Return the newest state, or None if none has arrived in the last second."""
        now_ns = time.monotonic_ns()
        while True:
            try:
                state = unpack(self._socket.recv(_DATAGRAM.size + 1))
            except BlockingIOError:
                break
            if state is None or not now_ns - _STALE_NS < state.t_ns <= time.monotonic_ns():
                continue
            if self._newest is None or state.t_ns > self._newest.t_ns:
                self._newest = state
        if self._newest is not None and self._newest.t_ns < now_ns - _STALE_NS:
            self._newest = None
        return self._newest

    def close(self) -> None:
        """Close the socket; safe to call twice."""
        self._socket.close()


_SWAY_M = 0.03
_SWAY_RAD = 0.1
_PERIOD_S = 4.0


def swaying_hand() -> SceneState:
    """Return the present scene: 0.5 m away, a hand sways 3 cm sideways and rotates by 6°."""
    t_ns = time.monotonic_ns()
    swing = math.sin(2.0 * math.pi * (t_ns * 1e-9 % _PERIOD_S) / _PERIOD_S)
    T_W_hand = rigid([0.1, 0.1, _SWAY_RAD * swing], [_SWAY_M * swing, 0.02, 0.5])
    return SceneState(t_ns, np.eye(4), T_W_hand)
