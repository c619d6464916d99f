"""The messages of the handshake, and the PC's side of it. No sockets; time is an argument.

A stranger costs no memory: the first hello is answered with a cookie, and only a hello that
returns it is passed on. A hello is accepted once: its time must be greater than that of every
earlier one of its device.
"""

from __future__ import annotations

import hmac
import math
import secrets
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

from handcal.core.errors import LinkError
from handcal.link import handcal_pb2 as pb
from handcal.link import messages, wire
from handcal.link.fields import MalformedError, read_text
from handcal.link.pairing import MAX_NAME_CHARACTERS, Pairing, Pairings, device_number
from handcal.link.transport import Address
from handcal.link.wire import NONCE_BYTES, Keys, Packet, Rejection, Welcome

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

    @property
    def error(self) -> LinkError:
        """The reason, and what the wearer can do, as an error."""
        if self.is_key_taken:
            belongs = f"this pairing key belongs to {self.other}"
            return LinkError(belongs, "ask the PC for a key of your own")
        return LinkError(f"{self.other} is connected to the PC", "disconnect it first")


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


MAX_ANSWERS = 64
"""Addresses to which one hello is answered with a cookie."""
_MAX_DEVICES = 64
_MAX_DROPPED = 4096
_FOREIGN_KEYS_HZ = 20.0

PairingDesk: TypeAlias = Callable[[Packet, bytes, Address, float], bytes | Rejection]
"""Answers a device whose key is unknown: `Exchange.hear` in `exchange.py`."""


@dataclass(frozen=True, slots=True)
class Caller:
    """A device that has proved its key and its address, and asks for a session."""

    pairing: Pairing
    """The pairing whose key it has; it may belong to another device."""
    device_id: str
    name: str
    nonce: bytes
    keys: Keys
    """Of its handshake."""


@dataclass(slots=True)
class _Heard:
    """Hellos of one device."""

    changed_s: float
    newest_ns: int = -1
    """Time of the newest hello."""
    admitted_ns: int = -1
    """Time of the newest hello with a valid cookie."""
    answered: set[Address] = field(default_factory=set)
    """Addresses to which the newest was answered with a cookie."""


class Limiter:
    """Allows something at most `rate_hz` times per second, one second's worth at once."""

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._left = rate_hz
        self._counted_s = -math.inf

    def allows(self, now_s: float) -> bool:
        """Return whether it is allowed now, and count it."""
        passed_s = min(1.0, now_s - self._counted_s)
        self._left = min(self._rate_hz, self._left + self._rate_hz * passed_s)
        self._counted_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class Reception:
    """Receives hellos, and admits the devices of a list of pairings.

    Attributes
    ----------
    pairing_desk : callable or None
        Answers those who ask to pair, while an invitation is shown.
    cookies : Cookies
    """

    def __init__(self, pairings: Pairings) -> None:
        self.pairing_desk: PairingDesk | None = None
        self._pairings = pairings
        self._heard: dict[int, _Heard] = {}
        self.cookies = Cookies()
        self._foreign = Limiter(_FOREIGN_KEYS_HZ)
        self._dropped: set[bytes | tuple[bytes, Address]] = set()
        self._indexed: tuple[Pairing, ...] = ()
        self._bound: dict[int, tuple[Pairing, Keys]] = {}
        self._unbound: list[Pairing] = []

    def has_dropped(self, datagram: bytes, address: Address) -> bool:
        """Return whether a datagram was dropped before; mass replays cost almost nothing."""
        mac = datagram[-wire.MAC_BYTES :]
        return mac in self._dropped or (mac, address) in self._dropped

    def hear(
        self, packet: Packet, datagram: bytes, address: Address, now_s: float
    ) -> Caller | bytes | Rejection:
        """Return the device, or the datagram to answer with, or the reason for no answer.

        Raises
        ------
        MalformedError
            If the datagram is authentic, but not a hello.
        """
        device = packet.sequence
        signer = self._find(device, datagram, now_s)
        if signer is None:
            if self.pairing_desk is None:
                return Rejection.UNPAIRED
            return self.pairing_desk(packet, datagram, address, now_s)
        pairing, keys = signer
        greeting = read_hello(messages.parse(packet.payload))
        heard = self._recall(device, now_s)
        if self.cookies.accept(greeting.cookie, device, address, now_s):
            if greeting.time_ns <= heard.admitted_ns:
                return self._drop(datagram, address)
            heard.changed_s = now_s
            heard.admitted_ns = greeting.time_ns
            heard.newest_ns = max(heard.newest_ns, greeting.time_ns)
            return Caller(pairing, f"{device:016x}", greeting.name, greeting.nonce, keys)
        if greeting.time_ns > heard.newest_ns:
            heard.changed_s = now_s
            heard.newest_ns = greeting.time_ns
            heard.answered.clear()
        elif greeting.time_ns < heard.newest_ns:
            return self._drop(datagram)
        elif address in heard.answered or len(heard.answered) >= MAX_ANSWERS:
            return self._drop(datagram, address)
        heard.answered.add(address)
        cookie = self.cookies.make(device, address, now_s)
        return seal(keys.to_headset, device, retry(greeting.nonce, cookie))

    def _drop(self, datagram: bytes, address: Address | None = None) -> Rejection:
        """Remember that a hello gets no answer, from one address or from any."""
        if len(self._dropped) >= _MAX_DROPPED:
            self._dropped.clear()
        mac = datagram[-wire.MAC_BYTES :]
        self._dropped.add(mac if address is None else (mac, address))
        return Rejection.REPLAYED

    def _find(self, device: int, datagram: bytes, now_s: float) -> tuple[Pairing, Keys] | None:
        """Return the pairing whose key signed a hello: its own, an open one, or another's."""
        self._index()
        own = self._bound.get(device)
        if own is not None and wire.is_authentic(own[1].to_pc, datagram):
            return own
        others = [pairing for pairing, _ in self._bound.values()]
        try_all = own is None and bool(others) and self._foreign.allows(now_s)
        offered = self._pairings.offered(now_s, f"{device:016x}")
        for pairing in (*self._unbound, *offered, *(others if try_all else ())):
            keys = wire.handshake_keys(pairing.key.encode(), device)
            if wire.is_authentic(keys.to_pc, datagram):
                return pairing, keys
        return None

    def _index(self) -> None:
        """Derive the keys of the known devices, if the pairings have changed."""
        if self._indexed is self._pairings.all:
            return
        self._indexed = self._pairings.all
        self._unbound = [pairing for pairing in self._indexed if not pairing.device_id]
        self._bound = {}
        for pairing in self._indexed:
            if pairing.device_id:
                device = device_number(pairing.device_id)
                self._bound[device] = pairing, wire.handshake_keys(pairing.key.encode(), device)

    def _recall(self, device: int, now_s: float) -> _Heard:
        heard = self._heard.get(device)
        # By now every cookie that was valid then has ended, and no old hello can return one.
        if heard is None or now_s - heard.changed_s > 2 * PERIOD_S:
            self._heard.pop(device, None)
            if len(self._heard) >= _MAX_DEVICES:
                del self._heard[next(iter(self._heard))]
            heard = self._heard[device] = _Heard(now_s)
        return heard
