"""The PC's end of the link."""

from __future__ import annotations

import logging
import math
import secrets
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from handcal.core.errors import FileError, PosePendingError
from handcal.core.types import EYES, Eye, Float64, HeadsetIdentity, Projection
from handcal.link import endpoint, handshake, messages, nudges, wire
from handcal.link import handcal_pb2 as pb
from handcal.link.drawn import drawn_digest, drawn_projections
from handcal.link.endpoint import Channel, Endpoint
from handcal.link.exchange import Exchange, new_digits
from handcal.link.fields import MalformedError
from handcal.link.handshake import Caller, Reception, Refusal
from handcal.link.invitation import Invitation, new_code
from handcal.link.messages import Owner
from handcal.link.nudges import NudgeSum, VerifyRequest
from handcal.link.pairing import Pairing, Pairings
from handcal.link.poses import ClockEstimator, PoseBuffer
from handcal.link.reliable import Outgoing
from handcal.link.shapes import Shape, Target
from handcal.link.statistics import LinkStatistics
from handcal.link.transport import Address, UdpTransport, reachable_address
from handcal.link.wire import Packet, Rejection, Slot, Welcome

LOOPBACK: Address = ("127.0.0.1", 0)
_LOG = logging.getLogger(__name__)
_MAX_CONFIRMATIONS = 64
_Stamped = TypeVar("_Stamped", pb.Confirm, pb.Nudge)
_LIVE_POINTS = 3000
"""Most points of a live hand in one frame; enough for a closed surface."""
_PING_PERIOD_S = 0.1
_NOTICE_S = 5.0
_RESTART_S = 0.5
_REFRESH_S = 1.0
_AHEAD_NS = 1_000_000_000
"""A pose further ahead of the headset's own clock than this is for no image that will be drawn."""
_AROUND_STEP_NS = 2_000_000_000
"""After a step of the headset's clock: until the clock is known again, and old stamps are gone."""


@dataclass(frozen=True, slots=True, eq=False)
class Confirmation:
    """The wearer's confirmation that the hand covers the cursor."""

    t_headset_ns: int
    t_host_ns: int
    """t_b on the headset's clock, and on the host's monotonic clock."""
    cursor_id: int
    problem: str = ""
    """Difference between what the headset drew and what it was sent; empty if there is none."""
    is_timed: bool = True
    """False if the headset's clock was set around this time, so that the times mean nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Nudge:
    """The wearer's total movement of what an eye draws since the verification began."""

    verify_id: int
    moved: NudgeSum
    fits: bool
    """True if the wearer says that the drawing covers the hand."""
    t_host_ns: int
    """Time of the last press of a key, on the host's monotonic clock."""
    problem: str = ""
    """As in `Confirmation`."""
    session: int = 0
    """The link's session, in which the sums began at zero."""
    is_timed: bool = True
    """As in `Confirmation`."""


@dataclass(frozen=True, slots=True)
class PairingAttempts:
    """Attempts to pair by digits, none of which has led to a connection."""

    count: int = 0
    host: str = ""
    """Address of the last one."""
    is_used_up: bool = False
    """True if no more are answered, so that the digits are worth nothing."""

    def __str__(self) -> str:
        if self.count < 2:
            return ""
        told = f"{self.count} attempts with other digits, the last from {self.host}"
        return f"{told}; no more are answered: show a new code" if self.is_used_up else told


@dataclass(slots=True)
class _Session:
    """The present session's device and its welcome."""

    caller: Caller
    welcome: Welcome


class HeadsetServer(Endpoint):
    """Waits for the headset, streams to it, and stores its poses.

    A headset that reconnects is sent the newest cursor, prompt, projections and so on again. One
    headset is served at a time; others are refused until it has been silent for a while.

    Parameters
    ----------
    pairings : Pairings or bytes
        The headsets that may connect; or a key alone, for the first that connects with it.
    bind : (host, port)
        Default: loopback, any free port.

    Raises
    ------
    LinkError
        If the address cannot be bound.
    ValueError
        If the key is too short.
    """

    def __init__(self, pairings: Pairings | bytes, bind: Address = LOOPBACK) -> None:
        if isinstance(pairings, bytes):
            pairings = Pairings((Pairing(pairings.decode()),))
        super().__init__(UdpTransport(bind))
        self._pairings = pairings
        self._projections: dict[Eye, Projection] = {}
        self._cursor: pb.Cursor | None = None
        self._is_offline = False
        self._live_frame = 0
        self._reception = Reception(pairings)
        self._exchange: Exchange | None = None
        self._session: _Session | None = None
        self._device: HeadsetIdentity | None = None
        self._shown = Owner()
        self._notice, self._notice_until_s = "", 0.0
        self._clock = ClockEstimator()
        self._poses = PoseBuffer()
        self._step_ns, self._step_host_ns = 0, -_AROUND_STEP_NS
        # The last number of each is when it came, on the host's clock.
        self._confirms: deque[tuple[pb.Confirm, str, int]] = deque(maxlen=_MAX_CONFIRMATIONS)
        self._nudges: deque[tuple[pb.Nudge, str, int]] = deque(maxlen=_MAX_CONFIRMATIONS)
        self._lost = 0
        self._next_ping_s = 0.0
        self._next_refresh_s = 0.0
        self._unread = ""
        self._start()

    @property
    def device(self) -> HeadsetIdentity | None:
        """The connected headset, as it introduced itself last; None before it has."""
        with self._changed:
            return self._device

    @property
    def shown(self) -> Owner:
        """Wearer and rig of the projections that the headset says it draws with."""
        with self._changed:
            return self._shown

    @property
    def pairings(self) -> Pairings:
        """The devices that may connect."""
        return self._pairings

    def invite(self) -> Invitation:
        """Let one new device pair within ten minutes, by QR code or digits; end other invitations.

        Raises
        ------
        LinkError
            If this machine has no network, or the link is closed.
        """
        host, port = reachable_address(self.address)
        invitation = Invitation(host, port, new_code(), new_digits())
        with self._changed:
            self._require_running()
            self.withdraw()
            self._exchange = Exchange(
                self._pairings, invitation, self._reception.cookies, time.monotonic()
            )
            self._reception.pairing_desk = self._exchange.hear
        return invitation

    @property
    def pairing_attempts(self) -> PairingAttempts:
        """The attempts to pair by the present invitation."""
        with self._changed:
            if self._exchange is None:
                return PairingAttempts()
            return PairingAttempts(*self._exchange.tried, self._exchange.is_used_up)

    def withdraw(self) -> None:
        """End the invitation, if there is one."""
        with self._changed:
            self._pairings.withdraw()
            self._exchange = self._reception.pairing_desk = None

    @property
    def clock_step_s(self) -> float:
        """By how much the headset's clock was set a moment ago; 0 if it was not."""
        with self._changed:
            is_recent = time.monotonic_ns() - self._step_host_ns < _AROUND_STEP_NS
            return 1e-9 * self._step_ns if is_recent else 0.0

    def send_cursor(
        self, points_W_m: ArrayLike, cursor_id: int, eyes: Sequence[Eye] = EYES
    ) -> Outgoing:
        """Send the frozen hand, (N, 3) of frame W, reliably; no points remove it.

        `eyes` draw it; a headset of an older version draws it for both.

        Raises
        ------
        ValueError
            If the points are not finite, too many, or spread over more than 6.5 m.
        LinkError
            If the link is closed.
        """
        message = messages.cursor(points_W_m, cursor_id, eyes)
        with self._changed:
            outgoing = self._send_reliably(Slot.CURSOR, message)
            self._cursor = message.cursor
        return outgoing

    def send_live_hand(
        self,
        points_W_m: ArrayLike,
        is_over_limit: bool,
        eyes: Sequence[Eye] = EYES,
        is_outline: bool = False,
    ) -> None:
        """Send the live hand, (N, 3) of frame W, thinned evenly to the limit of one frame.

        `is_over_limit` means that it is rotated too far; the headset then draws it red. `eyes` draw
        it. `is_outline` means that the points are its closed outline, in order. The hand replaces
        any that has not been sent yet.

        Raises
        ------
        ValueError
            As `send_cursor`.
        LinkError
            If the link is closed.
        """
        points = np.asarray(points_W_m)
        thinned = points[:: max(1, math.ceil(len(points) / _LIVE_POINTS))]
        with self._changed:
            self._require_running()
            self._live_frame += 1
            self._stream.clear()
            self._stream.extend(
                messages.live_hand(thinned, is_over_limit, self._live_frame, eyes, is_outline)
            )

    def send_prompt(self, text: str, eyes: Sequence[Eye] = EYES) -> Outgoing:
        """Send a text to show and the eyes to keep open, reliably.

        Raises
        ------
        ValueError
            If the text is too long.
        LinkError
            If the link is closed.
        """
        return self._send_reliably(Slot.PROMPT, messages.prompt(text, eyes))

    def send_projection(self, projection: Projection) -> Outgoing:
        """Send an eye's projection, reliably.

        Raises
        ------
        ValueError
            If it is not finite.
        LinkError
            If the link is closed.
        """
        slot = messages.PROJECTION_SLOTS[projection.eye]
        with self._changed:
            outgoing = self._send_reliably(slot, messages.projection(projection))
            self._projections[projection.eye] = projection
        return outgoing

    def send_show(self, is_offline: bool) -> Outgoing:
        """Have the headset draw with the offline calibration, or with its projections again.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        with self._changed:
            show = pb.Show(offline=is_offline)
            outgoing = self._send_reliably(Slot.SHOW, pb.Envelope(show=show))
            self._is_offline = is_offline
        return outgoing

    def send_target(self, target: Target | None) -> Outgoing:
        """Send the user test's target, reliably; None removes it.

        Raises
        ------
        ValueError
            If it is not finite.
        LinkError
            If the link is closed.
        """
        return self._send_reliably(Slot.TARGET, messages.target(target))

    def send_shape(self, shape: Shape | None) -> Outgoing:
        """Send a shape fixed in the world, reliably; None removes it.

        Raises
        ------
        ValueError
            If it is not finite.
        LinkError
            If the link is closed.
        """
        return self._send_reliably(Slot.SHAPE, messages.shape(shape))

    def send_verify(self, request: VerifyRequest | None) -> Outgoing:
        """Have the wearer move what an eye draws, reliably; None ends it.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        return self._send_reliably(Slot.VERIFY, nudges.verify(request))

    def send_again(self) -> None:
        """Send the newest message of every slot again, as to a headset that has just connected.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        with self._changed:
            self._require_running()
            self._outbox.restart(time.monotonic())

    def confirmations(self) -> list[Confirmation]:
        """Return the confirmations since the last call.

        One is held back until a ping sent after it came has shown that the clock has not stepped.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        with self._changed:
            self._require_running()
            return [
                Confirmation(message.t_headset_ns, t_host_ns, message.cursor_id, problem, is_timed)
                for message, problem, t_host_ns, is_timed in self._checked(self._confirms)
            ]

    def nudges(self) -> list[Nudge]:
        """Return the wearer's nudges since the last call; held back as `confirmations`.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        with self._changed:
            self._require_running()
            session = 0 if self._channel is None else self._channel.session
            return [
                Nudge(
                    message.verify_id,
                    nudges.read_nudge(message),
                    message.fits,
                    t_host_ns,
                    problem,
                    session,
                    is_timed,
                )
                for message, problem, t_host_ns, is_timed in self._checked(self._nudges)
            ]

    def _checked(
        self, waiting: deque[tuple[_Stamped, str, int]]
    ) -> Iterator[tuple[_Stamped, str, int, bool]]:
        """Take the messages that came before the newest answered ping was sent.

        Each comes with its problem, its time on the host's clock, and whether that is trusted.
        """
        clock = self._clock
        while waiting and clock.fit is not None and clock.checked_host_ns >= waiting[0][-1]:
            message, problem, came_ns = waiting.popleft()
            is_timed = came_ns > self._step_host_ns + _AROUND_STEP_NS
            t_host_ns = clock.to_host_ns(message.t_headset_ns) if is_timed else came_ns
            yield message, problem, t_host_ns, is_timed

    def pose_at_host_ns(self, t_host_ns: int) -> Float64:
        """Return the headset's pose ``T_W_H`` at a time of the host's monotonic clock.

        Raises
        ------
        PosePendingError
            If the pose or the headset's clock is not yet known.
        PoseError
            If it lies before the oldest stored pose, or in too long a gap.
        LinkError
            If the link is closed.
        """
        with self._changed:
            self._require_running()
            try:
                return self._poses.at(self._clock.to_headset_ns(t_host_ns))
            except PosePendingError as error:
                if self.connected:
                    raise
                raise PosePendingError("the headset sends no poses") from error

    def statistics(self) -> LinkStatistics:
        """Return the link's counters and estimates."""
        with self._changed:
            channel, fit = self._channel, self._clock.fit
            given_up = self._outbox.given_up if self.connected else ()
            return LinkStatistics(
                connected=self.connected,
                sent=self._sent["datagrams"],
                received=self._received["datagrams"],
                lost=self._lost,
                lost_inbound=channel.window.lost if channel else 0,
                resent=self._outbox.resent,
                acked=self._outbox.acked,
                unacked=self._outbox.unacked,
                failed=self._outbox.failed,
                rejected={str(reason): self._rejected[reason] for reason in Rejection},
                pose_rate_hz=self._poses.rate_hz(),
                latency_ms=fit.round_trip_ns / 2e6 if fit else None,
                clock_offset_ms=fit.offset_ns / 1e6 if fit else None,
                clock_drift_ppm=fit.drift * 1e6 if fit else None,
                clock_drift_uncertainty_ppm=fit.drift_uncertainty * 1e6 if fit else None,
                clock_uncertainty_ms=fit.uncertainty_ns / 1e6 if fit else None,
                bytes_sent=self._sent["bytes"],
                bytes_received=self._received["bytes"],
                given_up=dict(self._given_up),
                missing=tuple(slot.label for slot in given_up),
                notice=self._notice if time.monotonic() < self._notice_until_s else "",
            )

    def _take(self, datagram: bytes, address: Address) -> None:
        if self._reception.has_dropped(datagram, address):
            self._rejected[Rejection.REPLAYED] += 1
        else:
            super()._take(datagram, address)

    def _greet(self, packet: Packet, datagram: bytes, address: Address) -> Rejection | None:
        heard = self._reception.hear(packet, datagram, address, time.monotonic())
        if isinstance(heard, Rejection):
            return heard
        if isinstance(heard, Caller):
            heard = handshake.seal(
                heard.keys.to_headset, packet.sequence, self._meet(heard, address)
            )
        self._post(heard, address)
        return None

    def _meet(self, caller: Caller, address: Address) -> pb.Envelope:
        """Return the answer to a device that has proved its key and its address."""
        name = caller.name or caller.device_id
        owner_id = caller.pairing.device_id
        if owner_id not in ("", caller.device_id):
            owner = caller.pairing.name or "another headset"
            self._tell(f"headset {name} asks to connect with the pairing key of {owner}")
            return handshake.refused(caller.nonce, Refusal(is_key_taken=True, other=owner))
        channel, session = self._channel, self._session
        if channel is not None and session is not None:
            is_same = session.caller.device_id == caller.device_id
            if is_same and session.caller.nonce == caller.nonce and channel.address == address:
                return handshake.welcome(session.welcome)  # the first one was lost
            # A device whose app has been restarted is silent in its old session.
            patience_s = _RESTART_S if is_same else endpoint.SILENCE_S
            if time.monotonic() - channel.heard_s <= patience_s:
                holder = session.caller.name or session.caller.device_id
                self._tell(f"headset {name} asks to connect; {holder} is connected")
                return handshake.refused(caller.nonce, Refusal(is_key_taken=False, other=holder))
        return handshake.welcome(self._open(caller, address))

    def _open(self, caller: Caller, address: Address) -> Welcome:
        if not caller.pairing.device_id:
            try:
                self._pairings.bind(caller.pairing, caller.device_id, caller.name)
            except FileError as error:
                _LOG.warning("%s; %s is paired until the program ends", error, caller.device_id)
            self.withdraw()
        key = caller.pairing.key.encode()
        nonce = secrets.token_bytes(wire.NONCE_BYTES)
        welcome = Welcome(secrets.randbits(64) | 1, caller.nonce, nonce)
        keys = wire.session_keys(key, int(caller.device_id, 16), welcome)
        self._channel = Channel(welcome.session, address, keys.to_headset, keys.to_pc)
        self._session = _Session(caller, welcome)
        self._device = None
        self._shown = Owner()
        self._dismissed = False
        self._clock = ClockEstimator()
        self._step_ns, self._step_host_ns = 0, -_AROUND_STEP_NS
        self._poses = PoseBuffer()
        self._confirms.clear()
        self._nudges.clear()
        self._lost = 0
        self._next_ping_s = 0.0
        self._outbox.restart(time.monotonic())
        return welcome

    def _tell(self, notice: str) -> None:
        self._notice, self._notice_until_s = notice, time.monotonic() + _NOTICE_S

    def _handle(self, envelope: pb.Envelope) -> None:
        match envelope.WhichOneof("body"):
            case "poses":
                self._take_poses(envelope.poses)
            case "confirm":
                confirm = messages.read_confirm(envelope.confirm)
                self._confirms.append((confirm, *self._received_now(confirm.drawn)))
            case "nudge":
                nudges.read_nudge(envelope.nudge)  # MalformedError now, not when it is taken
                drawn = envelope.nudge.drawn
                self._nudges.append((envelope.nudge, *self._received_now(drawn)))
            case "device":
                assert self._session is not None
                device_id = self._session.caller.device_id
                self._device, self._shown = messages.read_device(envelope.device, device_id)
            case "pong":
                self._take_pong(envelope.pong)
            case other:
                raise MalformedError(f"a headset sends no {other}")

    def _received_now(self, digest: bytes) -> tuple[str, int]:
        """Return the problem of a message that comes now, and its time; ask for the clock soon."""
        self._next_ping_s = 0.0
        return self._difference(digest), time.monotonic_ns()

    def _difference(self, digest: bytes) -> str:
        """Return how a headset's drawing differs from what it was sent; empty if it does not."""
        drawn = drawn_projections(self._projections, self._is_offline)
        if digest == drawn_digest(drawn, self._cursor):
            return ""
        return "the headset draws other projections or another cursor than it was sent"

    def _take_poses(self, poses: pb.Poses) -> None:
        clock = self._clock
        last_ns = None
        if clock.fit is not None:
            last_ns = clock.to_headset_ns(time.monotonic_ns()) + _AHEAD_NS
        for t_headset_ns, T_W_H in messages.read_poses(poses):
            if last_ns is None or t_headset_ns <= last_ns:
                self._poses.add(t_headset_ns, T_W_H)
            else:
                ahead_s = 1e-9 * (t_headset_ns - last_ns + _AHEAD_NS)
                self._tell(f"the headset's poses are for {ahead_s:.0f} s from now; restart its app")

    def _refresh(self) -> None:
        """Take over changes of the pairings; end the session of a device that was revoked."""
        try:
            self._pairings.refresh()
            self._unread = ""
        except FileError as error:
            if str(error) != self._unread:
                self._unread = str(error)
                _LOG.warning("%s; the devices known so far may connect", error)
        if self._session is not None and self._channel is not None:
            caller = self._session.caller
            known = [(pairing.key, pairing.device_id) for pairing in self._pairings.all]
            if (caller.pairing.key, caller.device_id) not in known:
                self._send(pb.Envelope(bye=pb.Bye()))
                self._channel = None

    def _take_pong(self, pong: pb.Pong) -> None:
        now_ns = time.monotonic_ns()
        if not 0 <= now_ns - pong.t_sent_host_ns < 1e9 * endpoint.SILENCE_S:
            return  # of no ping sent lately
        self._lost = max(0, pong.highest_sequence - pong.accepted)
        was_known = self._clock.fit is not None
        step_ns = self._clock.add(
            pong.t_sent_host_ns, pong.t_received_headset_ns, pong.t_sent_headset_ns, now_ns
        )
        if step_ns:
            self._step_ns, self._step_host_ns = step_ns, now_ns
            self._poses = PoseBuffer()  # their stamps are of either time
            _LOG.warning("the headset's clock was set by %.3f s", 1e-9 * step_ns)
        elif not was_known and self._clock.fit is not None:
            self._poses.drop_after(self._clock.to_headset_ns(now_ns) + _AHEAD_NS)

    def _tick(self, now_s: float) -> None:
        if now_s >= self._next_refresh_s:
            self._next_refresh_s = now_s + _REFRESH_S
            self._refresh()
        if now_s >= self._next_ping_s:
            self._next_ping_s = now_s + _PING_PERIOD_S
            self._send(pb.Envelope(ping=pb.Ping(t_sent_host_ns=time.monotonic_ns())))
