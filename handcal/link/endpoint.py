"""Common part of both ends of the link: thread, session, reliable delivery and counters."""

from __future__ import annotations

import logging
import threading
import time
from abc import abstractmethod
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from handcal.core.errors import LinkError
from handcal.io.closable import Closable
from handcal.link import handcal_pb2 as pb
from handcal.link import messages, wire
from handcal.link.fields import MalformedError
from handcal.link.reliable import Delivery, Inbox, Outbox, Outgoing
from handcal.link.transport import Address, Transport
from handcal.link.wire import HANDSHAKE_SESSION, Packet, Rejection, ReplayWindow, Slot

_LOG = logging.getLogger(__name__)
SILENCE_S = 2.0
"""Time without a datagram after which the other end counts as disconnected."""
_BYES = 3
_BURST_DATAGRAMS, _BURST_PAUSE_S = 16, 0.001
"""Queued datagrams sent at once, and the pause after them, which a wireless link needs."""
_IDLE_WAIT_S = 0.005
"""Longest wait for a datagram while nothing is queued."""


@dataclass(slots=True)
class Channel:
    """A session with one peer at one address."""

    session: int
    address: Address
    send_key: bytes
    receive_key: bytes
    heard_s: float = field(default_factory=time.monotonic)
    sequence: int = 0
    window: ReplayWindow = field(default_factory=ReplayWindow)
    inbox: Inbox = field(default_factory=Inbox)


class Endpoint(Closable):
    """One end of the link; its thread runs from `_start` to `close`.

    Every method is safe to call from any thread. Names with an underscore are for the two
    subclasses, which hold `_changed` while they use state shared with the thread.
    """

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._changed = threading.Condition(threading.RLock())
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=type(self).__name__, daemon=True)
        self._failure: Exception | None = None
        self._channel: Channel | None = None
        self._dismissed = False
        self._outbox = Outbox()
        self._stream: deque[pb.Envelope] = deque()
        self._next_burst_s = 0.0
        self._given_up = Counter[str]()
        self._sent = Counter[str]()
        self._received = Counter[str]()
        self._rejected = Counter[Rejection]()

    @property
    def address(self) -> Address:
        """The address on which this end listens."""
        return self._transport.address

    @property
    def connected(self) -> bool:
        """True while datagrams from the other end arrive."""
        with self._changed:
            return self._channel is not None and not self._is_silent(self._channel)

    @property
    def dismissed(self) -> bool:
        """True if the other end has said good-bye and has not reconnected."""
        with self._changed:
            return self._dismissed

    def wait_connected(self, timeout_s: float) -> None:
        """Wait until the other end connects.

        Raises
        ------
        LinkError
            If it does not within `timeout_s`.
        """
        with self._changed:
            self._wait_for(lambda: self.connected, timeout_s)
            if not self.connected:
                raise self._silence(timeout_s)

    def wait_acked(self, message: Outgoing, timeout_s: float) -> None:
        """Wait until the other end has acknowledged a message.

        Raises
        ------
        LinkError
            If it does not within `timeout_s`, delivery failed, or a newer message replaced it.
        """
        with self._changed:
            self._wait_for(lambda: message.state is not Delivery.PENDING, timeout_s)
            name = message.slot.label
            if message.state is Delivery.SUPERSEDED:
                raise LinkError(f"the {name} was replaced by a newer one before it arrived")
            if message.state is not Delivery.ACKED:
                raise LinkError(
                    f"the headset did not answer: the {name} was not acknowledged",
                    "check that it is on and that its app runs",
                )

    def close(self) -> None:
        """Say good-bye, stop the thread and release the socket; safe to call twice."""
        if self._closing.is_set():
            return
        with self._changed:
            self._closing.set()
            for _ in range(_BYES):
                self._send(pb.Envelope(bye=pb.Bye()))
            self._changed.notify_all()
        self._thread.join()
        self._transport.close()

    def _silence(self, timeout_s: float) -> LinkError:
        """Return the error of a connection that failed."""
        return LinkError(
            f"no device with this pairing key answered within {timeout_s:g} s",
            "check the address, the key and the firewall",
        )

    @abstractmethod
    def _greet(self, packet: Packet, datagram: bytes, address: Address) -> Rejection | None:
        """Handle a datagram of the handshake, not yet authenticated; return why it is dropped."""

    @abstractmethod
    def _handle(self, envelope: pb.Envelope) -> None:
        """Handle a message of the session."""

    @abstractmethod
    def _tick(self, now_s: float) -> None:
        """Do periodic work; called at least every `idle_wait_s`."""

    def _start(self) -> None:
        self._thread.start()

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                arrived = self._transport.receive(self._wait_s())
                with self._changed:
                    if self._closing.is_set():
                        return  # a hello that answers the good-bye must not be welcomed
                    for datagram, address in arrived:
                        self._take(datagram, address)
                    self._work(time.monotonic())
        except Exception as error:
            _LOG.exception("the link stopped")
            with self._changed:
                self._failure = error
                self._changed.notify_all()

    def _wait_for(self, condition: Callable[[], bool], timeout_s: float) -> None:
        """Wait until a condition holds; LinkError at once if the link ends first."""
        has_ended = self._closing.is_set
        self._changed.wait_for(lambda: self._failure or has_ended() or condition(), timeout_s)
        self._require_running()

    def _require_running(self) -> None:
        if self._failure is not None:
            raise LinkError(f"the link has stopped: {self._failure}") from self._failure
        if self._closing.is_set():
            raise LinkError("the link is closed")

    def _wait_s(self) -> float:
        with self._changed:
            is_busy = self._channel and (self._stream or self._outbox.has_queued)
        return _BURST_PAUSE_S if is_busy else _IDLE_WAIT_S

    def _take(self, datagram: bytes, address: Address) -> None:
        try:
            rejection = self._sort(datagram, address)
        except MalformedError:
            rejection = Rejection.CORRUPT
        if rejection is not None:
            self._rejected[rejection] += 1

    def _sort(self, datagram: bytes, address: Address) -> Rejection | None:
        """Handle a datagram; return the reason if it is dropped."""
        packet = wire.read(datagram)
        if isinstance(packet, Rejection):
            return packet
        if packet.session == HANDSHAKE_SESSION:
            return self._greet(packet, datagram, address)
        channel = self._channel
        if channel is None or (channel.session, channel.address) != (packet.session, address):
            return Rejection.WRONG_SESSION
        if not wire.is_authentic(channel.receive_key, datagram):
            return Rejection.UNPAIRED
        if not channel.window.accept(packet.sequence):
            return Rejection.REPLAYED
        self._received["datagrams"] += 1
        self._received["bytes"] += len(datagram)
        self._accept(channel, packet)
        return None

    def _accept(self, channel: Channel, packet: Packet) -> None:
        channel.heard_s = time.monotonic()
        is_reliable = packet.slot is not Slot.UNRELIABLE
        payload = channel.inbox.receive(packet) if is_reliable else packet.payload
        if payload is None:
            return
        envelope = messages.parse(payload)
        match envelope.WhichOneof("body"):
            case "ack":
                for receipt in messages.read_ack(envelope.ack):
                    self._outbox.acknowledge(receipt)
            case "bye":
                self._channel = None
                self._dismissed = True
            case _:
                self._handle(envelope)

    def _work(self, now_s: float) -> None:
        # No warning before the first connection: a new peer is sent the newest of each slot.
        level = logging.INFO if self._channel is None else logging.WARNING
        for message in self._outbox.expire(now_s):
            _LOG.log(level, "delivery of the %s failed", message.slot.name.lower())
            if self._channel is not None:
                self._given_up[message.slot.name.lower()] += 1
        if self._channel is not None:
            receipts = self._channel.inbox.take_receipts()
            if receipts:
                self._send(messages.ack(receipts))
            if now_s >= self._next_burst_s:
                self._send_burst(now_s)
        self._tick(now_s)
        self._changed.notify_all()

    def _send_burst(self, now_s: float) -> None:
        packets = self._outbox.due(now_s, _BURST_DATAGRAMS)
        for packet in packets:
            self._send_packet(packet)
        count = min(len(self._stream), _BURST_DATAGRAMS - len(packets))
        for _ in range(count):
            self._send(self._stream.popleft())
        if packets or count:
            self._next_burst_s = now_s + _BURST_PAUSE_S

    def _send_reliably(self, slot: Slot, envelope: pb.Envelope) -> Outgoing:
        with self._changed:
            self._require_running()
            return self._outbox.send(slot, envelope.SerializeToString(), time.monotonic())

    def _send(self, envelope: pb.Envelope) -> None:
        """Send within the session, if there is one; delivery is not guaranteed."""
        self._send_packet(Packet(envelope.SerializeToString()))

    def _send_packet(self, packet: Packet) -> None:
        channel = self._channel
        if channel is None:
            return
        channel.sequence += 1
        packet = replace(packet, session=channel.session, sequence=channel.sequence)
        self._post(wire.seal(channel.send_key, packet), channel.address)

    def _post(self, datagram: bytes, address: Address) -> None:
        self._sent["datagrams"] += 1
        self._sent["bytes"] += len(datagram)
        self._transport.send(datagram, address)

    def _is_silent(self, channel: Channel) -> bool:
        return time.monotonic() - channel.heard_s > SILENCE_S
