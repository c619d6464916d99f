"""Datagrams as bytes: header, keys, MAC, replay window. No sockets, no clocks.

Layout, big endian (docs/protocol.md): magic ``hC``, version u8, slot u8, session u64, sequence
u64, message id u32, fragment u16, fragment count u16, payload, MAC (16 bytes) over all of it.
"""

from __future__ import annotations

import hmac
import struct
from dataclasses import dataclass
from enum import IntEnum, StrEnum

MAGIC = b"hC"
VERSION = 2
HEADER = struct.Struct(">2sBBQQIHH")
MAC_BYTES = 16
MAX_DATAGRAM_BYTES = 1400
MAX_PAYLOAD_BYTES = MAX_DATAGRAM_BYTES - HEADER.size - MAC_BYTES
MAX_FRAGMENTS = 256
MAX_MESSAGE_BYTES = MAX_FRAGMENTS * MAX_PAYLOAD_BYTES
MIN_PAIRING_KEY_BYTES = 16
NONCE_BYTES = 16
HANDSHAKE_SESSION = 0
REPLAY_WINDOW = 1024
_SALT = b"handcal link 2"


class Slot(IntEnum):
    """The slot of a reliable message: each holds one value, and the newest wins."""

    UNRELIABLE = 0
    CURSOR = 1
    PROMPT = 2
    PROJECTION_LEFT = 3
    PROJECTION_RIGHT = 4
    CONFIRM = 5
    TARGET = 6
    DEVICE = 7
    SHAPE = 8
    SHOW = 9
    VERIFY = 10
    NUDGE = 11

    @property
    def label(self) -> str:
        """Its name in messages, such as "left projection"."""
        return " ".join(reversed(self.name.lower().split("_")))


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
    """One datagram without its MAC."""

    payload: bytes
    session: int = HANDSHAKE_SESSION
    sequence: int = 0
    """In the handshake: the device's identity."""
    slot: Slot = Slot.UNRELIABLE
    message_id: int = 0
    fragment: int = 0
    fragment_count: int = 1


@dataclass(frozen=True, slots=True)
class Keys:
    """The MAC keys of the two directions; they differ, so that a reflected datagram fails."""

    to_headset: bytes
    to_pc: bytes


@dataclass(frozen=True, slots=True)
class Welcome:
    """The parameters of a new session."""

    session: int
    headset_nonce: bytes
    pc_nonce: bytes


def hkdf(key: bytes, salt: bytes, info: bytes, size: int = 32) -> bytes:
    """Return `size` bytes derived from a key by HKDF-SHA256 (RFC 5869)."""
    root = hmac.digest(salt, key, "sha256")
    block = derived = b""
    while len(derived) < size:
        block = hmac.digest(root, block + info + bytes([len(derived) // 32 + 1]), "sha256")
        derived += block
    return derived[:size]


def handshake_keys(pairing_key: bytes, device_id: int) -> Keys:
    """Derive the keys of a device's handshakes."""
    return _keys(pairing_key, b"handshake ", device_id.to_bytes(8, "big"))


def session_keys(pairing_key: bytes, device_id: int, welcome: Welcome) -> Keys:
    """Derive the keys of one session of a device."""
    context = b"".join(
        (
            device_id.to_bytes(8, "big"),
            welcome.session.to_bytes(8, "big"),
            welcome.headset_nonce,
            welcome.pc_nonce,
        )
    )
    return _keys(pairing_key, b"session ", context)


def _keys(pairing_key: bytes, label: bytes, context: bytes) -> Keys:
    return Keys(
        to_headset=hkdf(pairing_key, _SALT, label + b"to headset" + context),
        to_pc=hkdf(pairing_key, _SALT, label + b"to pc" + context),
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


def read(datagram: bytes) -> Packet | Rejection:
    """Return the packet in a datagram, or the reason for dropping it; any bytes are allowed.

    Nothing in the packet may be trusted before `is_authentic`.
    """
    if len(datagram) > MAX_DATAGRAM_BYTES:
        return Rejection.OVERSIZED
    if len(datagram) < HEADER.size + MAC_BYTES or not datagram.startswith(MAGIC):
        return Rejection.CORRUPT
    _, version, slot, session, sequence, message_id, fragment, count = HEADER.unpack_from(datagram)
    if version != VERSION:
        return Rejection.WRONG_VERSION
    if count > MAX_FRAGMENTS:
        return Rejection.OVERSIZED
    if fragment >= count or slot >= len(Slot) or (slot == Slot.UNRELIABLE and count != 1):
        return Rejection.CORRUPT
    payload = datagram[HEADER.size : -MAC_BYTES]
    return Packet(payload, session, sequence, Slot(slot), message_id, fragment, count)


def is_authentic(key: bytes, datagram: bytes) -> bool:
    """Return whether a datagram that `read` has accepted bears the MAC of this key."""
    return hmac.compare_digest(datagram[-MAC_BYTES:], _mac(key, datagram[:-MAC_BYTES]))


def _mac(key: bytes, body: bytes) -> bytes:
    return hmac.digest(key, body, "sha256")[:MAC_BYTES]


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
