"""Datagrams as bytes: header, keyed MAC, replay window. No sockets, no clocks.

Layout, big endian (docs/protocol.md): magic ``hC``, version u8, slot u8, session u64, sequence
u64, message id u32, fragment u16, fragment count u16, payload, MAC (16 bytes) over all of it.
"""

from __future__ import annotations

import hashlib
import hmac
import struct
from dataclasses import dataclass
from enum import IntEnum, StrEnum

MAGIC = b"hC"
VERSION = 1
HEADER = struct.Struct(">2sBBQQIHH")
MAC_BYTES = 16
MAX_DATAGRAM_BYTES = 1400
MAX_PAYLOAD_BYTES = MAX_DATAGRAM_BYTES - HEADER.size - MAC_BYTES
MAX_FRAGMENTS = 256
MAX_MESSAGE_BYTES = MAX_FRAGMENTS * MAX_PAYLOAD_BYTES
MIN_PAIRING_KEY_BYTES = 16
REPLAY_WINDOW = 1024


class Slot(IntEnum):
    """The slot of a reliable message: each holds one value, and the newest wins."""

    UNRELIABLE = 0
    CURSOR = 1
    PROMPT = 2
    PROJECTION_LEFT = 3
    PROJECTION_RIGHT = 4
    CONFIRM = 5
    TARGET = 6


class Rejection(StrEnum):
    """Reasons for dropping a datagram."""

    UNPAIRED = "unpaired"
    CORRUPT = "corrupt"
    REPLAYED = "replayed"
    OVERSIZED = "oversized"
    WRONG_VERSION = "wrong_version"
    WRONG_SESSION = "wrong_session"


@dataclass(frozen=True, slots=True)
class Packet:
    """One datagram without its MAC. Session 0 is the handshake."""

    payload: bytes
    session: int = 0
    sequence: int = 0
    slot: Slot = Slot.UNRELIABLE
    message_id: int = 0
    fragment: int = 0
    fragment_count: int = 1


@dataclass(frozen=True, slots=True)
class Keys:
    """The MAC keys of the two directions; they differ, so that a reflected datagram fails."""

    to_headset: bytes
    to_pc: bytes


def derive_keys(pairing_key: bytes) -> Keys:
    """Derive both directions' keys.

    Raises
    ------
    ValueError
        If the pairing key is shorter than 16 bytes.
    """
    if len(pairing_key) < MIN_PAIRING_KEY_BYTES:
        raise ValueError(
            f"the pairing key has {len(pairing_key)} bytes; at least {MIN_PAIRING_KEY_BYTES} needed"
        )
    root = hashlib.blake2b(pairing_key, person=b"handcal pairing").digest()
    return Keys(
        to_headset=hashlib.blake2b(b"to headset", key=root).digest(),
        to_pc=hashlib.blake2b(b"to pc", key=root).digest(),
    )


def seal(key: bytes, packet: Packet) -> bytes:
    """Return the datagram of `packet`.

    Raises
    ------
    ValueError
        If its payload is too large.
    """
    if len(packet.payload) > MAX_PAYLOAD_BYTES:
        raise ValueError(
            f"a payload of {len(packet.payload)} bytes does not fit into the "
            f"{MAX_PAYLOAD_BYTES} of a datagram"
        )
    header = HEADER.pack(
        MAGIC,
        VERSION,
        packet.slot,
        packet.session,
        packet.sequence,
        packet.message_id,
        packet.fragment,
        packet.fragment_count,
    )
    body = header + packet.payload
    return body + _mac(key, body)


def unseal(key: bytes, datagram: bytes) -> Packet | Rejection:
    """Return the packet in `datagram`, or the reason for dropping it; any bytes are allowed."""
    if len(datagram) > MAX_DATAGRAM_BYTES:
        return Rejection.OVERSIZED
    if len(datagram) < HEADER.size + MAC_BYTES or not datagram.startswith(MAGIC):
        return Rejection.CORRUPT
    _, version, slot, session, sequence, message_id, fragment, count = HEADER.unpack_from(datagram)
    if version != VERSION:
        return Rejection.WRONG_VERSION
    body, mac = datagram[:-MAC_BYTES], datagram[-MAC_BYTES:]
    if not hmac.compare_digest(mac, _mac(key, body)):
        return Rejection.UNPAIRED
    if count > MAX_FRAGMENTS:
        return Rejection.OVERSIZED
    if fragment >= count or slot >= len(Slot) or (slot == Slot.UNRELIABLE and count != 1):
        return Rejection.CORRUPT
    payload = body[HEADER.size :]
    return Packet(payload, session, sequence, Slot(slot), message_id, fragment, count)


def _mac(key: bytes, body: bytes) -> bytes:
    return hashlib.blake2b(body, key=key, digest_size=MAC_BYTES).digest()


def split(message: bytes) -> list[bytes]:
    """Split a message into the payloads of its fragments.

    Raises
    ------
    ValueError
        If it exceeds `MAX_MESSAGE_BYTES`.
    """
    if len(message) > MAX_MESSAGE_BYTES:
        raise ValueError(
            f"a message of {len(message):,} bytes exceeds the {MAX_MESSAGE_BYTES:,} allowed"
        )
    starts = range(0, max(len(message), 1), MAX_PAYLOAD_BYTES)
    return [message[start : start + MAX_PAYLOAD_BYTES] for start in starts]


class ReplayWindow:
    """Accepts each sequence number once, and none older than `REPLAY_WINDOW` numbers.

    Attributes
    ----------
    highest : int
        The highest sequence number accepted; they start at 1.
    accepted : int
        Number of accepted datagrams.
    """

    def __init__(self) -> None:
        self.highest = 0
        self.accepted = 0
        self._seen = 1  # bit i: highest - i was accepted; 0 never is

    @property
    def lost(self) -> int:
        """Number of datagrams missing up to the highest: lost, or delayed."""
        return self.highest - self.accepted

    def accept(self, sequence: int) -> bool:
        """Return whether `sequence` is new, and remember it."""
        ahead = sequence - self.highest
        if ahead > 0:
            kept = self._seen << ahead if ahead < REPLAY_WINDOW else 0
            self._seen = (kept | 1) & ((1 << REPLAY_WINDOW) - 1)
            self.highest = sequence
        elif -ahead >= REPLAY_WINDOW or self._seen >> -ahead & 1:
            return False
        else:
            self._seen |= 1 << -ahead
        self.accepted += 1
        return True
