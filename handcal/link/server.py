"""The PC's end of the link."""

from __future__ import annotations

import math
import secrets
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from handcal.link import handcal_pb2 as pb
from handcal.link import messages, wire
from handcal.link.clock import ClockEstimator
from handcal.link.endpoint import Channel, Endpoint
from handcal.link.poses import PoseBuffer
from handcal.link.reliable import Outgoing
from handcal.link.settings import DEFAULT_SETTINGS, LinkSettings
from handcal.link.transport import Address, UdpTransport
from handcal.link.wire import Rejection, Slot
from handcal.types import EYES, Eye, Float64, Projection, Target

LOOPBACK: Address = ("127.0.0.1", 0)
_MAX_OFFERS = 16
_MAX_CONFIRMATIONS = 64


@dataclass(frozen=True, slots=True, eq=False)
class Confirmation:
    """The wearer's confirmation that the hand covers the cursor."""

    t_headset_ns: int
    t_host_ns: int
    """t_b on the headset's clock, and on the host's monotonic clock."""
    T_E_W: Mapping[Eye, Float64]
    """each (4, 4); E0(t_b)."""
    cursor_id: int


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


class HeadsetServer(Endpoint):
    """Waits for the headset, streams to it, and stores its poses.

    A headset that reconnects is sent the newest cursor, prompt, projections and target again. One
    headset is served at a time: the one that connected last.

    Parameters
    ----------
    pairing_key : bytes
        Shared with the headset; at least 16 bytes.
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
        pairing_key: bytes,
        bind: Address = LOOPBACK,
        settings: LinkSettings = DEFAULT_SETTINGS,
    ) -> None:
        keys = wire.derive_keys(pairing_key)
        transport = UdpTransport(bind, settings.receive_buffer_bytes)
        super().__init__(transport, keys.to_headset, keys.to_pc, settings)
        self._offers: dict[int, Address] = {}
        self._clock = ClockEstimator()
        self._poses = PoseBuffer()
        self._confirms: deque[tuple[pb.Confirm, dict[Eye, Float64]]] = deque(
            maxlen=_MAX_CONFIRMATIONS
        )
        self._lost = 0
        self._live_frame = 0
        self._next_ping_s = 0.0
        self._start()

    def send_cursor(self, points_W_m: ArrayLike, cursor_id: int) -> Outgoing:
        """Send the frozen hand, (N, 3) of frame W, reliably; no points remove it.

        Raises
        ------
        ValueError
            If the points are not finite, too many, or spread over more than 6.5 m.
        LinkError
            If the link is closed.
        """
        return self._send_reliably(Slot.CURSOR, messages.cursor(points_W_m, cursor_id))

    def send_live_hand(self, points_W_m: ArrayLike, is_over_limit: bool) -> None:
        """Send the live hand, (N, 3) of frame W, thinned evenly to the limit of one frame.

        `is_over_limit` means that it is rotated too far; the headset then draws it red. The hand
        replaces any that has not been sent yet.

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
            self._stream.extend(messages.live_hand(thinned, is_over_limit, self._live_frame))

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
        return self._send_reliably(slot, messages.projection(projection))

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
                    MappingProxyType(T_E_W),
                    confirm.cursor_id,
                )
                for confirm, T_E_W in self._confirms
            ]
            self._confirms.clear()
            return confirmations

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
            )

    def _greet(self, envelope: pb.Envelope, address: Address) -> None:
        if envelope.WhichOneof("body") != "hello":
            raise messages.MalformedError("a session begins with a hello")
        # A replayed hello gets only an offer, for a session that has never been confirmed.
        session = secrets.randbits(64) | 1
        self._offers[session] = address
        if len(self._offers) > _MAX_OFFERS:
            del self._offers[next(iter(self._offers))]
        welcome = pb.Welcome(nonce=envelope.hello.nonce, session=session)
        self._send_greeting(pb.Envelope(welcome=welcome), address)

    def _find_channel(self, session: int, address: Address) -> Channel | None:
        if self._offers.get(session) == address:
            self._open(session, address)
        return super()._find_channel(session, address)

    def _open(self, session: int, address: Address) -> None:
        self._channel = Channel(session, address)
        self._dismissed = False
        self._offers.clear()
        self._clock = ClockEstimator()
        self._poses = PoseBuffer()
        self._confirms.clear()
        self._lost = 0
        self._next_ping_s = 0.0
        self._outbox.restart(time.monotonic())

    def _handle(self, envelope: pb.Envelope) -> None:
        match envelope.WhichOneof("body"):
            case "poses":
                for t_headset_ns, T_W_H in messages.read_poses(envelope.poses):
                    self._poses.add(t_headset_ns, T_W_H)
            case "confirm":
                T_E_W = messages.read_confirm(envelope.confirm)
                self._confirms.append((envelope.confirm, T_E_W))
            case "pong":
                self._take_pong(envelope.pong)
            case other:
                raise messages.MalformedError(f"a headset sends no {other}")

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
