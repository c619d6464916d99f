"""The headset's end of the link."""

from __future__ import annotations

import secrets
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from handcal.link import handcal_pb2 as pb
from handcal.link import messages, wire
from handcal.link.endpoint import Channel, Endpoint
from handcal.link.impair import UNIMPAIRED, ImpairedTransport, Impairment
from handcal.link.reliable import Outgoing
from handcal.link.settings import DEFAULT_SETTINGS, LinkSettings
from handcal.link.transport import Address, UdpTransport, local_address, resolve
from handcal.link.wire import Slot
from handcal.types import EYES, Eye, Float64, Projection, Target

_POSES_PER_DATAGRAM = 3


@dataclass(frozen=True, slots=True, eq=False)
class HeadsetState:
    """The state that the PC wants the headset to show."""

    cursor_W_m: Float64 | None = None
    cursor_id: int = 0
    live_W_m: Float64 | None = None
    """(N, 3); the frozen and the live hand, frame W; None if not shown."""
    is_over_limit: bool = False
    """True if the live hand is rotated too far; the headset then draws it red."""
    prompt: str = ""
    eyes: tuple[Eye, ...] = EYES
    """The eyes to keep open."""
    projections: Mapping[Eye, Projection] = field(default_factory=dict)
    """The projection of each eye, once the PC has sent it."""
    target: Target | None = None
    """The user test's target; None if not shown."""


class HeadsetClient(Endpoint):
    """Connects to the PC, sends poses and confirmations, and holds the state to show.

    Parameters
    ----------
    server : (host, port)
    pairing_key : bytes
        Shared with the PC; at least 16 bytes.
    clock_ns : callable
        The headset's clock, ns.
    settings : LinkSettings
    impairment : Impairment
        Impairments of the datagrams in both directions.

    Raises
    ------
    LinkError
        If the server's name or network is unknown.
    ValueError
        If the key is too short.
    """

    def __init__(
        self,
        server: Address,
        pairing_key: bytes,
        clock_ns: Callable[[], int] = time.monotonic_ns,
        settings: LinkSettings = DEFAULT_SETTINGS,
        impairment: Impairment = UNIMPAIRED,
    ) -> None:
        keys = wire.derive_keys(pairing_key)
        self._server = resolve(*server)
        transport = UdpTransport(local_address(self._server), settings.receive_buffer_bytes)
        super().__init__(
            ImpairedTransport(transport, impairment), keys.to_pc, keys.to_headset, settings
        )
        self._clock_ns = clock_ns
        self._recent_poses: deque[tuple[int, Float64]] = deque(maxlen=_POSES_PER_DATAGRAM)
        self._state = HeadsetState()
        self._live_frame = 0
        self._live_chunks: dict[int, Float64] = {}
        self._nonce = secrets.randbits(64)
        self._joined_s = 0.0
        self._next_hello_s = 0.0
        self._start()

    def send_pose(self, T_W_H: Float64, t_headset_ns: int) -> None:
        """Send the headset's pose at a time of its own clock.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        with self._changed:
            self._require_running()
            self._recent_poses.append((t_headset_ns, T_W_H))
            self._send(messages.poses(self._recent_poses))

    def confirm(self, T_E_W: Mapping[Eye, Float64], t_headset_ns: int, cursor_id: int) -> Outgoing:
        """Confirm reliably that the hand covers the cursor, with E0 of both eyes at that time.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        return self._send_reliably(Slot.CONFIRM, messages.confirm(T_E_W, t_headset_ns, cursor_id))

    def state(self) -> HeadsetState:
        """Return the state that the PC wants shown.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        with self._changed:
            self._require_running()
            points = np.concatenate([np.empty((0, 3)), *self._live_chunks.values()])
            return replace(self._state, live_W_m=points if len(points) else None)

    def _greet(self, envelope: pb.Envelope, address: Address) -> None:
        welcome = envelope.welcome
        is_mine = welcome.nonce == self._nonce and address == self._server
        if self._channel is None and is_mine:
            self._channel = Channel(welcome.session, address)
            self._nonce = secrets.randbits(64)  # used once, so that no old welcome is accepted
            self._dismissed = False
            self._joined_s = time.monotonic()
            self._next_hello_s = 0.0
            self._live_frame = 0
            self._live_chunks.clear()
            self._state = HeadsetState(projections=self._state.projections)

    def _handle(self, envelope: pb.Envelope) -> None:
        match envelope.WhichOneof("body"):
            case "ping":
                self._answer(envelope.ping)
            case "cursor":
                cursor = envelope.cursor
                points = messages.read_points(cursor.points)
                self._state = replace(
                    self._state,
                    cursor_W_m=points if len(points) else None,
                    cursor_id=cursor.cursor_id,
                )
            case "live_hand":
                self._take_live_hand(envelope.live_hand)
            case "prompt":
                text, eyes = messages.read_prompt(envelope.prompt)
                self._state = replace(self._state, prompt=text, eyes=eyes)
            case "projection":
                projection = messages.read_projection(envelope.projection)
                projections = {**self._state.projections, projection.eye: projection}
                self._state = replace(self._state, projections=projections)
            case "target":
                target = messages.read_target(envelope.target)
                self._state = replace(self._state, target=target)
            case other:
                raise messages.MalformedError(f"a PC sends no {other}")

    def _take_live_hand(self, live: pb.LiveHand) -> None:
        if live.frame < self._live_frame:
            return
        if live.frame > self._live_frame:
            self._live_frame = live.frame
            self._live_chunks.clear()
        if live.chunk < messages.MAX_CHUNKS:
            self._live_chunks[live.chunk] = messages.read_points(live.points)
            self._state = replace(self._state, is_over_limit=live.red)

    def _answer(self, ping: pb.Ping) -> None:
        received_ns = self._clock_ns()
        if self._channel is None:
            return
        window = self._channel.window
        pong = pb.Pong(
            t_sent_host_ns=ping.t_sent_host_ns,
            t_received_headset_ns=received_ns,
            t_sent_headset_ns=self._clock_ns(),
            highest_sequence=window.highest,
            accepted=window.accepted,
        )
        self._send(pb.Envelope(pong=pong))

    def _tick(self, now_s: float) -> None:
        if now_s < self._next_hello_s:
            return
        self._next_hello_s = now_s + self._settings.hello_period_s
        channel = self._channel
        if channel is not None and now_s - max(channel.heard_s, self._joined_s) > (
            self._settings.silence_s
        ):
            self._channel = channel = None
        if channel is None:
            self._send_greeting(pb.Envelope(hello=pb.Hello(nonce=self._nonce)), self._server)
        else:
            # The first opens the session on the PC; the others keep it alive.
            self._send(messages.ack())
