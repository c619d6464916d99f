"""The headset's end of the link."""

from __future__ import annotations

import secrets
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from handcal.core.errors import LinkError
from handcal.core.types import EYES, Eye, Float64, HeadsetIdentity, Projection
from handcal.link import handcal_pb2 as pb
from handcal.link import handshake, messages, nudges, wire
from handcal.link.drawn import drawn_digest, drawn_projections
from handcal.link.endpoint import Channel, Endpoint
from handcal.link.fields import MalformedError, read_eyes
from handcal.link.impair import UNIMPAIRED, ImpairedTransport, Impairment
from handcal.link.messages import Owner
from handcal.link.nudges import NudgeSum, VerifyRequest
from handcal.link.pairing import device_number
from handcal.link.reliable import Outgoing
from handcal.link.shapes import Shape, Target
from handcal.link.transport import Address, UdpTransport, local_address, resolve
from handcal.link.wire import Packet, Rejection, Slot

MAX_WEARERS = 16
_POSES_PER_DATAGRAM = 3
_REFUSED_PERIOD_S = 1.0
_HELLO_PERIOD_S = 0.1
"""Time between two hellos, or two signs of life."""


@dataclass(frozen=True, slots=True, eq=False)
class HeadsetState:
    """The state that the PC wants the headset to show."""

    cursor_W_m: Float64 | None = None
    cursor_id: int = 0
    cursor_eyes: tuple[Eye, ...] = EYES
    """The eyes that draw the cursor."""
    live_W_m: Float64 | None = None
    """(N, 3); the frozen and the live hand, frame W; None if not shown."""
    live_eyes: tuple[Eye, ...] = EYES
    """The eyes that draw the live hand."""
    is_outline: bool = False
    """True if `live_W_m` is the closed outline of the hand, point by point, none missing."""
    is_over_limit: bool = False
    """True if the live hand is rotated too far; the headset then draws it red."""
    prompt: str = ""
    eyes: tuple[Eye, ...] = EYES
    """The eyes to keep open."""
    projections: Mapping[Eye, Projection] = field(default_factory=dict)
    """The projection of each eye, once the PC has sent it; all of one wearer and rig."""
    is_offline: bool = False
    """True while the headset should draw with the offline calibration."""
    target: Target | None = None
    """The user test's target; None if not shown."""
    shape: Shape | None = None
    """The shape fixed in the world; None if not shown."""
    verify: VerifyRequest | None = None
    """The eye whose drawing the wearer should move; None if there is none."""
    cursor_message: pb.Cursor | None = None
    """The message by which the cursor came."""

    @property
    def drawn(self) -> dict[Eye, Projection]:
        """The projections to draw with: `projections`, or those of the offline calibration."""
        return drawn_projections(self.projections, self.is_offline)

    @property
    def owner(self) -> Owner:
        """Wearer and rig of the projections."""
        for projection in self.projections.values():
            return Owner(projection.wearer, projection.rig)
        return Owner()


class HeadsetClient(Endpoint):
    """Connects to the PC, sends poses and confirmations, and holds the state to show.

    Parameters
    ----------
    server : (host, port)
    pairing_key : bytes
        Shared with the PC; at least 16 bytes.
    identity : HeadsetIdentity
        The headset's own; its `device_id` has 16 hexadecimal digits, and belongs to this device.
    clock_ns : callable
        The headset's clock, ns.
    impairment : Impairment
        Impairments of the datagrams in both directions.

    Raises
    ------
    LinkError
        If the server's name or network is unknown.
    ValueError
        If the key is too short, or the identity invalid.
    """

    def __init__(
        self,
        server: Address,
        pairing_key: bytes,
        identity: HeadsetIdentity,
        clock_ns: Callable[[], int] = time.monotonic_ns,
        impairment: Impairment = UNIMPAIRED,
    ) -> None:
        if len(pairing_key) < wire.MIN_PAIRING_KEY_BYTES:
            raise ValueError(f"the pairing key has fewer than {wire.MIN_PAIRING_KEY_BYTES} bytes")
        self._device = device_number(identity.device_id)
        messages.device(identity, Owner())  # ValueError before anything is opened
        self._pairing_key = pairing_key
        self._keys = wire.handshake_keys(pairing_key, self._device)
        self._server = resolve(*server)
        transport = UdpTransport(_own_side(self._server))
        super().__init__(ImpairedTransport(transport, impairment))
        self._identity = identity
        self._clock_ns = clock_ns
        self._recent_poses: deque[tuple[int, Float64]] = deque(maxlen=_POSES_PER_DATAGRAM)
        self._state = HeadsetState()
        self._kept: dict[Owner, Mapping[Eye, Projection]] = {}
        self._live_frame = 0
        self._live_count = 1
        self._live_chunks: dict[int, Float64] = {}
        self._nonce = secrets.token_bytes(wire.NONCE_BYTES)
        self._cookie = b""
        self._refused: LinkError | None = None
        self._hello_ns = 0
        self._next_hello_s = 0.0
        self._start()

    @property
    def refusal(self) -> str:
        """The PC's reason for not connecting; empty if it has none."""
        with self._changed:
            return "" if self._refused is None else str(self._refused)

    @property
    def kept(self) -> Mapping[Owner, Mapping[Eye, Projection]]:
        """The projections received, by wearer, of the rig that came last."""
        with self._changed:
            return MappingProxyType(dict(self._kept))

    def show_kept(self, owner: Owner) -> None:
        """Draw with the kept projections of a wearer until the PC sends others.

        Raises
        ------
        KeyError
            If there are none.
        LinkError
            If the link is closed.
        """
        with self._changed:
            self._require_running()
            self._state = replace(self._state, projections=self._kept[owner])
            self._introduce()

    def set_identity(self, identity: HeadsetIdentity) -> None:
        """Send the identity again after it has changed, as when the runtime moves its view.

        Raises
        ------
        ValueError
            If it is invalid, or of another device.
        LinkError
            If the link is closed.
        """
        if identity.device_id != self._identity.device_id:
            raise ValueError("a headset keeps its device_id")
        messages.device(identity, Owner())
        with self._changed:
            self._require_running()
            self._identity = identity
            self._introduce()

    def send_pose(self, T_W_H: Float64, t_headset_ns: int) -> None:
        """Send the headset's pose at a time of its own clock.

        The time is the one that the pose is for; for a predicted pose, the time of display.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        with self._changed:
            self._require_running()
            self._recent_poses.append((t_headset_ns, T_W_H))
            self._send(messages.poses(self._recent_poses))

    def confirm(self, t_headset_ns: int, state: HeadsetState) -> Outgoing:
        """Confirm reliably that the hand covers the cursor, with the state drawn at that time.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        digest = drawn_digest(state.drawn, state.cursor_message)
        message = messages.confirm(t_headset_ns, state.cursor_id, digest)
        return self._send_reliably(Slot.CONFIRM, message)

    def nudge(
        self, t_headset_ns: int, state: HeadsetState, moved: NudgeSum, fits: bool = False
    ) -> Outgoing:
        """Send reliably how far the wearer has moved the drawing since `state.verify` began.

        Raises
        ------
        ValueError
            If there is nothing to verify in the state drawn at that time.
        LinkError
            If the link is closed.
        """
        if state.verify is None:
            raise ValueError("there is nothing to verify")
        digest = drawn_digest(state.drawn, state.cursor_message)
        message = nudges.nudge(state.verify, moved, fits, t_headset_ns, digest)
        return self._send_reliably(Slot.NUDGE, message)

    def state(self) -> HeadsetState:
        """Return the state that the PC wants shown; without a connection, only projections.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        with self._changed:
            self._require_running()
            if self._channel is None or self._is_silent(self._channel):
                # Nothing that the PC cannot take away again.
                return HeadsetState(projections=self._state.projections)
            live_W_m, is_whole = self._live_hand()
            is_outline = self._state.is_outline and is_whole
            return replace(self._state, live_W_m=live_W_m, is_outline=is_outline)

    def _silence(self, timeout_s: float) -> LinkError:
        return self._refused or super()._silence(timeout_s)

    def _greet(self, packet: Packet, datagram: bytes, address: Address) -> Rejection | None:
        if address != self._server or packet.sequence != self._device:
            return Rejection.WRONG_SESSION
        if not wire.is_authentic(self._keys.to_headset, datagram):
            return Rejection.UNPAIRED
        envelope = messages.parse(packet.payload)
        body = envelope.WhichOneof("body")
        if body not in ("retry", "welcome", "refused"):
            raise MalformedError(f"no handshake has a {body}")
        if self._channel is not None or getattr(envelope, body).nonce != self._nonce:
            return Rejection.REPLAYED
        match body:
            case "retry":
                is_first = not self._cookie
                self._cookie = envelope.retry.cookie[: handshake.MAX_COOKIE_BYTES]
                if is_first:  # or a PC that takes no cookie would be asked without a pause
                    self._say_hello()
            case "welcome":
                self._join(handshake.read_welcome(envelope.welcome))
            case "refused":
                self._refused = handshake.read_refused(envelope.refused).error
                self._begin_again()
                self._next_hello_s = time.monotonic() + _REFUSED_PERIOD_S
        return None

    def _join(self, welcome: wire.Welcome) -> None:
        keys = wire.session_keys(self._pairing_key, self._device, welcome)
        self._channel = Channel(welcome.session, self._server, keys.to_pc, keys.to_headset)
        self._begin_again()
        self._dismissed = False
        self._refused = None
        self._next_hello_s = 0.0
        self._live_frame = 0
        self._live_chunks.clear()
        self._state = HeadsetState(projections=self._state.projections)
        self._introduce()

    def _begin_again(self) -> None:
        """Forget the handshake, so that no old answer is accepted."""
        self._nonce = secrets.token_bytes(wire.NONCE_BYTES)
        self._cookie = b""

    def _introduce(self) -> None:
        message = messages.device(self._identity, self._state.owner)
        self._outbox.send(Slot.DEVICE, message.SerializeToString(), time.monotonic())

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
                    cursor_eyes=read_eyes(cursor.eyes) or EYES,
                    cursor_message=cursor,
                )
            case "live_hand":
                self._take_live_hand(envelope.live_hand)
            case "prompt":
                text, eyes = messages.read_prompt(envelope.prompt)
                self._state = replace(self._state, prompt=text, eyes=eyes)
            case "projection":
                self._keep(messages.read_projection(envelope.projection))
            case "show":
                self._state = replace(self._state, is_offline=envelope.show.offline)
            case "shape":
                shape = messages.read_shape(envelope.shape)
                self._state = replace(self._state, shape=shape)
            case "verify":
                request = nudges.read_verify(envelope.verify)
                self._state = replace(self._state, verify=request)
            case "target":
                target = messages.read_target(envelope.target)
                self._state = replace(self._state, target=target)
            case other:
                raise MalformedError(f"a PC sends no {other}")

    def _keep(self, projection: Projection) -> None:
        """Draw with a projection, and keep it by its wearer; those of another rig are dropped."""
        owner = Owner(projection.wearer, projection.rig)
        previous = self._state.owner
        projections = {**self._kept.pop(owner, {}), projection.eye: projection}
        self._kept = {who: kept for who, kept in self._kept.items() if who.rig == owner.rig}
        while len(self._kept) >= MAX_WEARERS:
            del self._kept[next(iter(self._kept))]
        self._kept[owner] = projections
        self._state = replace(self._state, projections=projections)
        if owner != previous:
            self._introduce()

    def _take_live_hand(self, live: pb.LiveHand) -> None:
        if live.frame < self._live_frame:
            return
        if live.frame > self._live_frame:
            self._live_frame = live.frame
            self._live_chunks.clear()
        if live.chunk < messages.MAX_CHUNKS:
            self._live_count = max(1, live.chunk_count)
            self._live_chunks[live.chunk] = messages.read_points(live.points)
            self._state = replace(
                self._state,
                is_over_limit=live.red,
                is_outline=live.outline,
                live_eyes=read_eyes(live.eyes) or EYES,
            )

    def _live_hand(self) -> tuple[Float64 | None, bool]:
        """Return the points of the chunks that have arrived, and whether all have, in order."""
        chunks = [points for _, points in sorted(self._live_chunks.items())]
        points = np.concatenate([np.empty((0, 3)), *chunks])
        shares = [len(points[chunk :: self._live_count]) for chunk in range(len(chunks))]
        is_whole = len(chunks) == self._live_count and shares == [len(chunk) for chunk in chunks]
        if is_whole:
            for number, chunk in enumerate(chunks):
                points[number :: self._live_count] = chunk
        return points if len(points) else None, is_whole

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
        self._next_hello_s = now_s + _HELLO_PERIOD_S
        if self._channel is not None and self._is_silent(self._channel):
            self._channel = None
        if self._channel is None:
            self._say_hello()
        else:
            self._send(messages.ack())  # keeps the session alive

    def _say_hello(self) -> None:
        self._hello_ns = max(time.time_ns(), self._hello_ns + 1)
        hello = handshake.hello(self._nonce, self._hello_ns, self._cookie, self._identity.name)
        self._post(handshake.seal(self._keys.to_pc, self._device, hello), self._server)


def _own_side(server: Address) -> Address:
    """Return where to bind: not to the address of today, which the network may change."""
    own = local_address(server)
    return own if own[0] == server[0] else ("::" if ":" in own[0] else "0.0.0.0", 0)  # noqa: S104
