"""The PC's end of the link."""

from __future__ import annotations

import logging
import math
import secrets
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from handcal.errors import FileError
from handcal.link import greetings, messages, nudges, version1, wire
from handcal.link import handcal_pb2 as pb
from handcal.link.clock import ClockEstimator
from handcal.link.drawn import drawn_digest, drawn_projections
from handcal.link.endpoint import Channel, Endpoint
from handcal.link.greetings import Refusal
from handcal.link.handshake import Caller, Limiter, Reception
from handcal.link.messages import Owner
from handcal.link.nudges import NudgeSum, VerifyRequest
from handcal.link.pairing import Pairing, Pairings
from handcal.link.poses import PoseBuffer
from handcal.link.reliable import Outgoing
from handcal.link.settings import DEFAULT_SETTINGS, LinkSettings
from handcal.link.transport import Address, UdpTransport
from handcal.link.wire import Packet, Rejection, Slot, Welcome
from handcal.types import EYES, Eye, Float64, HeadsetIdentity, Projection, Shape, Target

LOOPBACK: Address = ("127.0.0.1", 0)
_LOG = logging.getLogger(__name__)
_MAX_CONFIRMATIONS = 64
_NOTICE_S = 5.0
_RESTART_S = 0.5
_VERSION_1_HZ = 20.0
_VERSION_1_NOTICES_HZ = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Confirmation:
    """The wearer's confirmation that the hand covers the cursor."""

    t_headset_ns: int
    t_host_ns: int
    """t_b on the headset's clock, and on the host's monotonic clock."""
    cursor_id: int
    problem: str = ""
    """Difference between what the headset drew and what it was sent; empty if there is none."""


@dataclass(frozen=True, slots=True, eq=False)
class Nudge:
    """The wearer's movement of what an eye draws, in all since the verification began."""

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


@dataclass(frozen=True, slots=True)
class LinkStatistics:
    """Counters and estimates of the link."""

    connected: bool
    sent: int
    received: int
    """Datagrams sent, and datagrams received and accepted."""
    lost: int
    lost_inbound: int
    """Datagrams lost in this session: to the headset by its last report, from it by gaps."""
    resent: int
    """Fragments retransmitted."""
    acked: int
    unacked: int
    failed: int
    """Reliable messages acknowledged, waiting, and failed."""
    rejected: Mapping[str, int]
    """Datagrams dropped, by reason (`wire.Rejection`)."""
    pose_rate_hz: float
    """Rate of distinct poses over the newest second."""
    latency_ms: float | None
    """Half the median round trip."""
    clock_offset_ms: float | None
    clock_drift_ppm: float | None
    clock_uncertainty_ms: float | None
    """Headset's clock minus the host's; None until it is known."""
    bytes_sent: int
    bytes_received: int
    notice: str = ""
    """Another headset that asks to connect now, and why it is refused; empty if there is none."""


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
    settings : LinkSettings

    Raises
    ------
    LinkError
        If the address cannot be bound.
    ValueError
        If the key is too short.
    """

    def __init__(
        self,
        pairings: Pairings | bytes,
        bind: Address = LOOPBACK,
        settings: LinkSettings = DEFAULT_SETTINGS,
    ) -> None:
        if isinstance(pairings, bytes):
            pairings = Pairings((Pairing(pairings.decode()),))
        transport = UdpTransport(bind, settings.receive_buffer_bytes)
        super().__init__(transport, settings)
        self._pairings = pairings
        self._reception = Reception(pairings)
        self._session: _Session | None = None
        self._device: HeadsetIdentity | None = None
        self._shown = Owner()
        self._notice, self._notice_until_s = "", 0.0
        self._version_1 = Limiter(_VERSION_1_HZ)
        self._version_1_notices = Limiter(_VERSION_1_NOTICES_HZ)
        self._projections: dict[Eye, Projection] = {}
        self._cursor: pb.Cursor | None = None
        self._is_offline = False
        self._clock = ClockEstimator()
        self._poses = PoseBuffer()
        self._confirms: deque[tuple[pb.Confirm, str]] = deque(maxlen=_MAX_CONFIRMATIONS)
        self._nudges: deque[tuple[pb.Nudge, NudgeSum, str]] = deque(maxlen=_MAX_CONFIRMATIONS)
        self._lost = 0
        self._live_frame = 0
        self._next_ping_s = 0.0
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

    def send_cursor(self, points_W_m: ArrayLike, cursor_id: int) -> Outgoing:
        """Send the frozen hand, (N, 3) of frame W, reliably; no points remove it.

        Raises
        ------
        ValueError
            If the points are not finite, too many, or spread over more than 6.5 m.
        LinkError
            If the link is closed.
        """
        message = messages.cursor(points_W_m, cursor_id)
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
        thinned = points[:: max(1, math.ceil(len(points) / self._settings.live_points))]
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

        Raises
        ------
        LinkError
            If the link is closed.
        """
        with self._changed:
            self._require_running()
            if self._clock.fit is None:
                return []
            confirmations = [
                Confirmation(
                    confirm.t_headset_ns,
                    self._clock.to_host_ns(confirm.t_headset_ns),
                    confirm.cursor_id,
                    problem,
                )
                for confirm, problem in self._confirms
            ]
            self._confirms.clear()
            return confirmations

    def nudges(self) -> list[Nudge]:
        """Return the wearer's nudges since the last call.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        with self._changed:
            self._require_running()
            if self._clock.fit is None:
                return []
            session = 0 if self._channel is None else self._channel.session
            found = [
                Nudge(
                    nudge.verify_id,
                    moved,
                    nudge.fits,
                    self._clock.to_host_ns(nudge.t_headset_ns),
                    problem,
                    session,
                )
                for nudge, moved, problem in self._nudges
            ]
            self._nudges.clear()
            return found

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
            return self._poses.at(self._clock.to_headset_ns(t_host_ns))

    def statistics(self) -> LinkStatistics:
        """Return the link's counters and estimates."""
        with self._changed:
            channel, fit = self._channel, self._clock.fit
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
                clock_uncertainty_ms=fit.uncertainty_ns / 1e6 if fit else None,
                bytes_sent=self._sent["bytes"],
                bytes_received=self._received["bytes"],
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
            heard = greetings.seal(
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
            return greetings.refused(caller.nonce, Refusal(is_key_taken=True, other=owner))
        channel, session = self._channel, self._session
        if channel is not None and session is not None:
            is_same = session.caller.device_id == caller.device_id
            if is_same and session.caller.nonce == caller.nonce and channel.address == address:
                return greetings.welcome(session.welcome)  # the first one was lost
            # A device whose app has been restarted is silent in its old session.
            patience_s = _RESTART_S if is_same else self._settings.silence_s
            if time.monotonic() - channel.heard_s <= patience_s:
                holder = session.caller.name or session.caller.device_id
                self._tell(f"headset {name} asks to connect; {holder} is connected")
                return greetings.refused(caller.nonce, Refusal(is_key_taken=False, other=holder))
        return greetings.welcome(self._open(caller, address))

    def _open(self, caller: Caller, address: Address) -> Welcome:
        if not caller.pairing.device_id:
            try:
                self._pairings.bind(caller.pairing, caller.device_id, caller.name)
            except FileError as error:
                _LOG.warning("%s; %s is paired until the program ends", error, caller.device_id)
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
        self._poses = PoseBuffer()
        self._confirms.clear()
        self._nudges.clear()
        self._lost = 0
        self._next_ping_s = 0.0
        self._outbox.restart(time.monotonic())
        return welcome

    def _tell(self, notice: str) -> None:
        self._notice, self._notice_until_s = notice, time.monotonic() + _NOTICE_S

    def _take_other_version(self, datagram: bytes, address: Address) -> None:
        """Tell PC and headset that a paired headset speaks version 1."""
        now_s = time.monotonic()
        if not version1.is_hello(datagram) or not self._version_1.allows(now_s):
            return
        for pairing in self._pairings.all:
            if answer := version1.answer(pairing.key.encode(), datagram):
                self._tell("this headset speaks protocol 1, update its app")
                if self._version_1_notices.allows(now_s):
                    for notice in answer:
                        self._post(notice, address)
                return

    def _handle(self, envelope: pb.Envelope) -> None:
        match envelope.WhichOneof("body"):
            case "poses":
                for t_headset_ns, T_W_H in messages.read_poses(envelope.poses):
                    self._poses.add(t_headset_ns, T_W_H)
            case "confirm":
                confirm = messages.read_confirm(envelope.confirm)
                self._confirms.append((confirm, self._difference(confirm.drawn)))
            case "nudge":
                nudge = envelope.nudge
                moved = nudges.read_nudge(nudge)
                self._nudges.append((nudge, moved, self._difference(nudge.drawn)))
            case "device":
                assert self._session is not None
                device_id = self._session.caller.device_id
                self._device, self._shown = messages.read_device(envelope.device, device_id)
            case "pong":
                self._take_pong(envelope.pong)
            case other:
                raise messages.MalformedError(f"a headset sends no {other}")

    def _difference(self, digest: bytes) -> str:
        """Return the difference of what a headset has drawn from what it was sent, or nothing."""
        drawn = drawn_projections(self._projections, self._is_offline)
        if digest == drawn_digest(drawn, self._cursor):
            return ""
        return "the headset draws other projections or another cursor than it was sent"

    def _take_pong(self, pong: pb.Pong) -> None:
        now_ns = time.monotonic_ns()
        if not 0 <= now_ns - pong.t_sent_host_ns < 1e9 * self._settings.silence_s:
            return  # of no ping sent lately
        self._lost = max(0, pong.highest_sequence - pong.accepted)
        self._clock.add(
            pong.t_sent_host_ns, pong.t_received_headset_ns, pong.t_sent_headset_ns, now_ns
        )

    def _tick(self, now_s: float) -> None:
        if now_s >= self._next_ping_s:
            self._next_ping_s = now_s + self._settings.ping_period_s
            self._send(pb.Envelope(ping=pb.Ping(t_sent_host_ns=time.monotonic_ns())))
