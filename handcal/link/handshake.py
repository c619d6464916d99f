"""The PC's side of the handshake. No sockets; time is an argument.

A stranger costs no memory: the first hello is answered with a cookie, and only a hello that
returns it is passed on. A hello is accepted once: its time must be greater than that of every
earlier one of its device.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

from handcal.link import greetings, messages, wire
from handcal.link.greetings import PERIOD_S, Cookies
from handcal.link.pairing import Pairing, Pairings, device_number
from handcal.link.transport import Address
from handcal.link.wire import Keys, Packet, Rejection

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
        found = self._find(device, datagram, now_s)
        if found is None:
            if self.pairing_desk is None:
                return Rejection.UNPAIRED
            return self.pairing_desk(packet, datagram, address, now_s)
        pairing, keys = found
        hello = greetings.read_hello(messages.parse(packet.payload))
        heard = self._recall(device, now_s)
        if self.cookies.accept(hello.cookie, device, address, now_s):
            if hello.time_ns <= heard.admitted_ns:
                return self._drop(datagram, address)
            heard.changed_s = now_s
            heard.admitted_ns = hello.time_ns
            heard.newest_ns = max(heard.newest_ns, hello.time_ns)
            return Caller(pairing, f"{device:016x}", hello.name, hello.nonce, keys)
        if hello.time_ns > heard.newest_ns:
            heard.changed_s = now_s
            heard.newest_ns = hello.time_ns
            heard.answered.clear()
        elif hello.time_ns < heard.newest_ns:
            return self._drop(datagram)
        elif address in heard.answered or len(heard.answered) >= MAX_ANSWERS:
            return self._drop(datagram, address)
        heard.answered.add(address)
        retry = greetings.retry(hello.nonce, self.cookies.make(device, address, now_s))
        return greetings.seal(keys.to_headset, device, retry)

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
        others = [one for one, _ in self._bound.values()]
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
        self._unbound = [one for one in self._indexed if not one.device_id]
        self._bound = {}
        for one in self._indexed:
            if one.device_id:
                device = device_number(one.device_id)
                self._bound[device] = one, wire.handshake_keys(one.key.encode(), device)

    def _recall(self, device: int, now_s: float) -> _Heard:
        heard = self._heard.get(device)
        # By now every cookie that was valid then has ended, and no old hello can return one.
        if heard is None or now_s - heard.changed_s > 2 * PERIOD_S:
            self._heard.pop(device, None)
            if len(self._heard) >= _MAX_DEVICES:
                del self._heard[next(iter(self._heard))]
            heard = self._heard[device] = _Heard(now_s)
        return heard
