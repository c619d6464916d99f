"""The messages of the handshake."""

from __future__ import annotations

import hmac
import math
import secrets
from dataclasses import dataclass

from handcal.link import handcal_pb2 as pb
from handcal.link import wire
from handcal.link.fields import MalformedError, read_text
from handcal.link.pairing import MAX_NAME_CHARACTERS
from handcal.link.transport import Address
from handcal.link.wire import NONCE_BYTES, Packet, Welcome

MAX_COOKIE_BYTES = 32


def seal(key: bytes, device: int, envelope: pb.Envelope) -> bytes:
    """Return a datagram of the handshake."""
    return wire.seal(key, Packet(envelope.SerializeToString(), sequence=device))


@dataclass(frozen=True, slots=True)
class Refusal:
    """The PC's reason for refusing a session."""

    is_key_taken: bool
    """True: the pairing key belongs to another device. False: another headset is connected."""
    other: str
    """Name of the other device."""

    def __str__(self) -> str:
        if self.is_key_taken:
            return f"this pairing key belongs to {self.other}; ask the PC for a key of your own"
        return f"{self.other} is connected to the PC; disconnect it first"


def hello(nonce: bytes, time_ns: int, cookie: bytes, name: str) -> pb.Envelope:
    """Make a hello, with the PC's cookie once it is known."""
    return pb.Envelope(hello=pb.Hello(nonce=nonce, time_ns=time_ns, cookie=cookie, name=name))


def read_hello(envelope: pb.Envelope) -> pb.Hello:
    """Return the hello in an envelope."""
    message = envelope.hello
    if (
        envelope.WhichOneof("body") != "hello"
        or len(message.nonce) != NONCE_BYTES
        or len(message.cookie) > MAX_COOKIE_BYTES
    ):
        raise MalformedError("a session begins with a hello")
    read_text(message.name, MAX_NAME_CHARACTERS)
    return message


def retry(nonce: bytes, cookie: bytes) -> pb.Envelope:
    """Make the request to say hello again with a cookie."""
    return pb.Envelope(retry=pb.Retry(nonce=nonce, cookie=cookie))


def welcome(value: Welcome) -> pb.Envelope:
    """Make the offer of a session."""
    return pb.Envelope(
        welcome=pb.Welcome(
            nonce=value.headset_nonce, session=value.session, pc_nonce=value.pc_nonce
        )
    )


def read_welcome(message: pb.Welcome) -> Welcome:
    """Read the offer of a session."""
    if len(message.pc_nonce) != NONCE_BYTES or not message.session:
        raise MalformedError("a welcome without a session")
    return Welcome(message.session, message.nonce, message.pc_nonce)


def refused(nonce: bytes, refusal: Refusal) -> pb.Envelope:
    """Make a refusal."""
    reason = pb.REFUSAL_KEY_TAKEN if refusal.is_key_taken else pb.REFUSAL_BUSY
    return pb.Envelope(refused=pb.Refused(nonce=nonce, reason=reason, other=refusal.other))


def refused_code(nonce: bytes) -> pb.Envelope:
    """Make the refusal of a pairing by digits, after too many wrong ones."""
    return pb.Envelope(refused=pb.Refused(nonce=nonce, reason=pb.REFUSAL_NO_CODE))


def read_refused(message: pb.Refused) -> Refusal:
    """Read a refusal; an unknown reason reads as another headset being connected."""
    return Refusal(
        message.reason == pb.REFUSAL_KEY_TAKEN, read_text(message.other, MAX_NAME_CHARACTERS)
    )


PERIOD_S = 120.0
"""A cookie is valid until the end of the period after the one in which it was made."""
_BYTES = 16


class Cookies:
    """Makes and checks cookies, with a secret of its own."""

    def __init__(self) -> None:
        self._secret = secrets.token_bytes(32)

    def make(self, device: int, address: Address, now_s: float, age: int = 0) -> bytes:
        """Return the cookie of the present period, or of the one before with `age` 1."""
        period = math.floor(now_s / PERIOD_S) - age
        who = f"{period} {device:016x} {address[1]} {address[0]}".encode()
        return hmac.digest(self._secret, who, "sha256")[:_BYTES]

    def accept(self, cookie: bytes, device: int, address: Address, now_s: float) -> bool:
        """Return whether a cookie was made for this device and address a while ago at most."""
        return bool(cookie) and any(
            hmac.compare_digest(cookie, self.make(device, address, now_s, age)) for age in (0, 1)
        )
