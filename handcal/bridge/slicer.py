"""OpenIGTLink for 3D Slicer: head, hand, cursor, eyes and verdict; see docs/bridges.md.

The messages are pyigtl's; its server is not used, because it takes one client only, installs signal
handlers, and waits without limit for a client that takes no data.
"""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from handcal.core.conventions import slicer_points_mm, slicer_transform
from handcal.core.display import projection_matrix
from handcal.core.errors import HandcalError, LinkError, extra_advice
from handcal.core.geometry import invert
from handcal.core.types import EYES, Float64
from handcal.station.snapshot import Snapshot

DEFAULT_PORT = 18944
MAX_POINTS = 3000
_MAX_CLIENTS = 8
_SEND_S = 2.0
_DRAIN_BYTES = 65536


class SlicerOutput:
    """Serves OpenIGTLink; implements `Output`.

    Moving things are sent with each placed hand, the others when they change, and to each new
    client. A client that takes no data for half a second is disconnected with one line.

    Parameters
    ----------
    tell : callable
        Called with that line.
    host, port : str, int
        Address to listen on. OpenIGTLink has no password: any computer that reaches it may read.

    Raises
    ------
    HandcalError
        If pyigtl is not installed.
    LinkError
        If the address cannot be bound.
    """

    name = "OpenIGTLink"
    capacity = 1

    def __init__(
        self,
        tell: Callable[[str], object],
        host: str = "127.0.0.1",
        port: int = DEFAULT_PORT,
        send_s: float = _SEND_S,
    ) -> None:
        try:
            import pyigtl  # noqa: F401
        except ImportError as error:
            raise HandcalError("OpenIGTLink needs pyigtl", extra_advice("slicer")) from error
        self._tell = tell
        self._send_s = send_s
        self._clients: list[_Client] = []
        try:
            self._listening = socket.create_server((host, port), backlog=_MAX_CLIENTS)
        except OSError as error:
            raise LinkError(
                f"OpenIGTLink cannot listen on {host}:{port}: {error.strerror or error}",
                "choose another port",
            ) from error
        self._listening.setblocking(False)
        self.address: tuple[str, int] = self._listening.getsockname()[:2]

    def take(self, snapshot: Snapshot) -> Snapshot:
        """Return the snapshot: only the newest is sent."""
        return snapshot

    def send(self, item: Snapshot) -> None:
        """Send a snapshot to every client."""
        self._accept()
        if not self._clients:
            return
        messages = igtl_messages(item)
        for client in list(self._clients):
            try:
                client.send(messages)
            except OSError as error:
                self._clients.remove(client)
                client.close()
                stuck = isinstance(error, TimeoutError)
                reason = "it takes no data" if stuck else "it has closed the connection"
                self._tell(f"OpenIGTLink client {client.name} disconnected: {reason}")

    def close(self) -> None:
        """Disconnect all clients."""
        for client in self._clients:
            client.close()
        self._listening.close()

    def _accept(self) -> None:
        with suppress(BlockingIOError):
            while True:
                connection, address = self._listening.accept()
                if len(self._clients) == _MAX_CLIENTS:
                    connection.close()
                    continue
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                connection.setblocking(False)
                name = f"{address[0]}:{address[1]}"
                self._clients.append(_Client(connection, name, self._send_s))


class _Client:
    """One connected program, and what it was sent last. Nothing here waits for it."""

    def __init__(self, connection: socket.socket, name: str, patience_s: float) -> None:
        self.name = name
        self._connection = connection
        self._patience_s = patience_s
        self._sent: dict[str, object] = {}
        self._pending = b""
        self._took_s = time.monotonic()

    def send(self, messages: Mapping[str, tuple[object, Callable[[], bytes]]]) -> None:
        """Send the messages whose value differs from the one sent last, once those are gone.

        Raises
        ------
        TimeoutError
            If it has taken nothing for a while.
        OSError
            If it has closed the connection.
        """
        self._drain()
        self._push()
        if self._pending:
            if time.monotonic() - self._took_s > self._patience_s:
                raise TimeoutError
            return
        new = {name: value for name, (value, _) in messages.items()}
        changed = [name for name in new if name not in self._sent or self._sent[name] != new[name]]
        self._pending = b"".join(messages[name][1]() for name in changed)
        self._sent |= {name: new[name] for name in changed}
        self._took_s = time.monotonic()
        self._push()

    def close(self) -> None:
        self._connection.close()

    def _push(self) -> None:
        """Send as much of what waits as the client takes now."""
        while self._pending:
            try:
                taken = self._connection.send(self._pending)
            except BlockingIOError:
                return
            self._pending = self._pending[taken:]
            self._took_s = time.monotonic()

    def _drain(self) -> None:
        """Discard what the client sends: requests and keep-alives."""
        with suppress(BlockingIOError):
            if not self._connection.recv(_DRAIN_BYTES):
                raise ConnectionResetError


def igtl_messages(snapshot: Snapshot) -> dict[str, tuple[object, Callable[[], bytes]]]:
    """Return the messages of a snapshot by device name: a value to compare, and the packing."""
    import pyigtl

    stamp_s = time.time() - (time.monotonic_ns() - snapshot.t_host_ns) * 1e-9
    rig, procedure = snapshot.record.rig, snapshot.procedure
    found: dict[str, tuple[object, Callable[[], bytes]]] = {}

    def add(name: str, value: object, message: Callable[[], Any]) -> None:
        def pack() -> bytes:
            made = message()
            made.device_name, made.timestamp = name, stamp_s
            packed: bytes = made.pack()
            return packed

        found[name] = value, pack

    def text(name: str, value: str) -> None:
        # pyigtl packs ASCII only.
        ascii_text = value.encode("ascii", "replace").decode("ascii")
        add(name, value, lambda: pyigtl.StringMessage(ascii_text))

    def pose(name: str, value: object, T: Float64) -> None:
        add(name, value, lambda: pyigtl.TransformMessage(slicer_transform(T)))

    hand = None if snapshot.observation is None else snapshot.observation.hand
    if hand is not None:
        pose("HeadToWorld", snapshot.number, hand.T_W_D @ invert(rig.T_H_D))
        add("HandInWorld", snapshot.number, lambda: _poly_data(hand.points_W_m))
    cursor = procedure.cursor
    points_m = np.empty((0, 3)) if cursor is None else cursor.points_W_m
    add("CursorInWorld", cursor, lambda: _poly_data(points_m))
    for eye in EYES:
        shift_m = procedure.applied_shift_m.get(eye, np.zeros(3))
        P = projection_matrix(rig.eyes[eye], shift_m)
        T_H_E = invert(rig.eyes[eye].T_V_H)
        T_H_E[:3, 3] += T_H_E[:3, :3] @ -np.linalg.solve(P[:, :3], P[:, 3])
        value = tuple(shift_m.tolist())
        pose(f"{eye.capitalize()}EyeToHead", value, T_H_E)
        text(f"{eye.capitalize()}Projection", " ".join(f"{one:.9g}" for one in P.ravel()))
    text("State", procedure.state.value)
    verdicts = {} if procedure.results is None else procedure.results.verdicts
    text("Verdict", "; ".join(f"{eye}: {one.name}: {one.reason}" for eye, one in verdicts.items()))
    return found


def _poly_data(points_m: Float64) -> Any:
    """Return a POLYDATA message with points and one cell of all of them as vertices."""
    import pyigtl

    class Cloud(pyigtl.PolyDataMessage):  # type: ignore[misc]
        """pyigtl packs vertices in the machine's byte order instead of the network's."""

        def _pack_content(self) -> bytes:
            count = len(points_mm)
            cell = np.concatenate([[count], np.arange(count)]).astype(">u4")
            cells = int(count > 0)
            head = struct.pack(">10I", count, cells, cells * cell.nbytes, *[0] * 7)
            return head + points_mm.astype(">f4").tobytes() + cell.tobytes() * cells

    thinned_m = points_m[:: max(1, -(-len(points_m) // MAX_POINTS))]
    points_mm = slicer_points_mm(thinned_m)
    return Cloud()
