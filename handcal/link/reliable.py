"""Reliable delivery of the newest message of each slot. No sockets; time is an argument.

The sender keeps one message per slot: a newer one replaces it, acknowledged or not. The receiver
acknowledges fragments by bitmap, so only missing ones are retransmitted, and delivers each message
once and never after a newer one of its slot. Holding one message per slot bounds the memory.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from enum import Enum, auto

from handcal.link import wire
from handcal.link.wire import Packet, Slot

RECEIPT_COPIES = 3
RESEND_S, RESEND_MAX_S = 0.04, 0.64
"""First and longest wait before missing fragments are sent again; it doubles in between and is
reset whenever fragments are acknowledged."""
GIVE_UP_S = 5.0
"""Time after which an unacknowledged message has failed."""


class Delivery(Enum):
    """The delivery state of a reliable message."""

    PENDING = auto()
    ACKED = auto()
    SUPERSEDED = auto()
    FAILED = auto()


@dataclass(frozen=True, slots=True)
class Receipt:
    """The fragments of a message that have arrived: bit i of `fragments` is fragment i."""

    slot: int
    message_id: int
    fragments: int


@dataclass(slots=True, eq=False)
class Outgoing:
    """A reliable message in transit; the handle to wait for its acknowledgement."""

    slot: Slot
    message_id: int
    fragments: list[bytes]
    deadline_s: float
    backoff_s: float
    resend_at_s: float
    state: Delivery = Delivery.PENDING
    is_resend: bool = False
    queue: deque[int] = field(default_factory=deque)
    missing: set[int] = field(init=False)

    def __post_init__(self) -> None:
        self.missing = set(range(len(self.fragments)))


class Outbox:
    """The sender's half.

    Attributes
    ----------
    resent : int
        Fragments retransmitted.
    acked, failed : int
        Messages acknowledged, and messages whose delivery failed.
    """

    def __init__(self) -> None:
        self._newest: dict[Slot, Outgoing] = {}
        self._next_id = 1
        self.resent = 0
        self.acked = 0
        self.failed = 0

    @property
    def unacked(self) -> int:
        """Number of messages not yet acknowledged."""
        return len(self._pending())

    @property
    def given_up(self) -> tuple[Slot, ...]:
        """Slots whose newest message was given up, so that the receiver lacks it."""
        newest = self._newest.items()
        return tuple(slot for slot, message in newest if message.state is Delivery.FAILED)

    @property
    def has_queued(self) -> bool:
        """True if fragments are ready to be sent."""
        return any(message.queue for message in self._pending())

    def send(self, slot: Slot, payload: bytes, now_s: float) -> Outgoing:
        """Queue a message in place of the slot's older one."""
        message = Outgoing(
            slot,
            self._next_id,
            wire.split(payload),
            deadline_s=now_s + GIVE_UP_S,
            backoff_s=RESEND_S,
            resend_at_s=now_s,
        )
        self._next_id += 1
        older = self._newest.get(slot)
        if older is not None and older.state is Delivery.PENDING:
            older.state = Delivery.SUPERSEDED
        self._newest[slot] = message
        return message

    def restart(self, now_s: float) -> None:
        """Send the newest message of every slot to a receiver that knows none of them."""
        for message in self._newest.values():
            message.state = Delivery.PENDING
            message.missing = set(range(len(message.fragments)))
            message.queue.clear()
            message.is_resend = False
            message.deadline_s = now_s + GIVE_UP_S
            message.backoff_s = RESEND_S
            message.resend_at_s = now_s

    def due(self, now_s: float, budget: int) -> list[Packet]:
        """Return at most `budget` fragments to send now, session and sequence left open."""
        packets: list[Packet] = []
        for message in self._pending():
            if not message.queue and now_s >= message.resend_at_s:
                message.queue.extend(sorted(message.missing))
            while message.queue and len(packets) < budget:
                packets.append(self._take(message, now_s))
        return packets

    def _take(self, message: Outgoing, now_s: float) -> Packet:
        index = message.queue.popleft()
        self.resent += message.is_resend
        if not message.queue:
            message.is_resend = True
            message.resend_at_s = now_s + message.backoff_s
            message.backoff_s = min(2 * message.backoff_s, RESEND_MAX_S)
        return Packet(
            message.fragments[index],
            slot=message.slot,
            message_id=message.message_id,
            fragment=index,
            fragment_count=len(message.fragments),
        )

    def acknowledge(self, receipt: Receipt) -> None:
        """Process a receipt; one for no pending message is ignored."""
        for message in self._pending():
            if (message.slot, message.message_id) != (receipt.slot, receipt.message_id):
                continue
            arrived = {index for index in message.missing if receipt.fragments >> index & 1}
            if arrived:
                message.missing -= arrived
                message.backoff_s = RESEND_S
            if not message.missing:
                message.state = Delivery.ACKED
                self.acked += 1

    def expire(self, now_s: float) -> list[Outgoing]:
        """Mark the messages whose time is over as failed and return them."""
        expired = [message for message in self._pending() if now_s >= message.deadline_s]
        for message in expired:
            message.state = Delivery.FAILED
        self.failed += len(expired)
        return expired

    def _pending(self) -> list[Outgoing]:
        return [m for m in self._newest.values() if m.state is Delivery.PENDING]


@dataclass(slots=True)
class _Incoming:
    message_id: int
    fragment_count: int
    fragments: dict[int, bytes] = field(default_factory=dict)
    is_complete: bool = False

    def receipt(self, slot: Slot) -> Receipt:
        indices = range(self.fragment_count) if self.is_complete else self.fragments
        return Receipt(slot, self.message_id, sum(1 << index for index in indices))


class Inbox:
    """The receiver's half."""

    def __init__(self) -> None:
        self._newest: dict[Slot, _Incoming] = {}
        self._owed: dict[Slot, int] = {}

    def receive(self, packet: Packet) -> bytes | None:
        """Add a fragment; return its message if that completes it."""
        message = self._newest.get(packet.slot)
        if message is None or packet.message_id > message.message_id:
            message = _Incoming(packet.message_id, packet.fragment_count)
            self._newest[packet.slot] = message
        if (packet.message_id, packet.fragment_count) != (
            message.message_id,
            message.fragment_count,
        ):
            return None
        self._owed[packet.slot] = RECEIPT_COPIES
        if message.is_complete:
            return None
        message.fragments[packet.fragment] = packet.payload
        if len(message.fragments) < message.fragment_count:
            return None
        complete = b"".join(message.fragments[index] for index in range(message.fragment_count))
        message.is_complete = True
        message.fragments.clear()
        return complete

    def take_receipts(self) -> list[Receipt]:
        """Return the receipts to send now; each is repeated a few times in case one is lost."""
        receipts = [self._newest[slot].receipt(slot) for slot in self._owed]
        self._owed = {slot: copies - 1 for slot, copies in self._owed.items() if copies > 1}
        return receipts
