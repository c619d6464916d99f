"""Agreement on a pairing key by digits or by a QR code (SPEKE: IEEE 1363.2, ISO/IEC 11770-4).

Both ends raise the same secret generator, derived from the digits or the code, to a random power
modulo the 2,048-bit prime of RFC 3526. Without the digits, neither listening nor taking part helps
to try digits afterwards: every guess costs one attempt with the PC, which allows only a few. Who
photographs a QR code has nothing once it has been used or has expired.
"""

from __future__ import annotations

import hmac
import re
import secrets
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import ip_network

from handcal.core.errors import LinkError
from handcal.link import exchange, handshake, messages, wire
from handcal.link import handcal_pb2 as pb
from handcal.link.fields import MalformedError, read_text
from handcal.link.handshake import Cookies
from handcal.link.invitation import Invitation
from handcal.link.pairing import MAX_NAME_CHARACTERS, OFFER_S, Pairings, device_number
from handcal.link.transport import Address, UdpTransport, local_address, resolve
from handcal.link.wire import NONCE_BYTES, Packet, Rejection

DIGITS = 8
MAX_ATTEMPTS = 5
"""Attempts of one address that are answered."""
_PER_HOST, _PER_CODE = 20, 100
"""The same for all ports of a host, and for all hosts together: one of 100 guesses is right with a
chance of 1 in 10⁶. A stranger uses up the attempts of one host, not those of others."""
PUBLIC_KEYS = wire.Keys(to_headset=b"handcal pair to headset", to_pc=b"handcal pair to pc")
"""Keys of the datagrams, known to everyone: they only show that a datagram is intact."""
PROOF_BYTES = 16
PRIME = int(
    "FFFFFFFFFFFFFFFFC90FDAA22168C234C4C6628B80DC1CD129024E088A67CC74"
    "020BBEA63B139B22514A08798E3404DDEF9519B3CD3A431B302B0A6DF25F1437"
    "4FE1356D6D51C245E485B576625E7EC6F44C42E9A637ED6B0BFF5CB6F406B7ED"
    "EE386BFB5A899FA5AE9F24117C4B1FE649286651ECE45B3DC2007CB8A163BF05"
    "98DA48361C55D39A69163FA8FD24CF5F83655D23DCA3AD961C62F356208552BB"
    "9ED529077096966D670C354E4ABC9804F1746C08CA18217C32905E462E36CE3B"
    "E39E772C180E86039B2783A2EC07A28FB5C55DF06F4C52C9DE2BCBF695581718"
    "3995497CEA956AE515D2261898FA051015728E5A8AACAA68FFFFFFFFFFFFFFFF",
    16,
)
VALUE_BYTES = 256
_SALT = b"handcal pair 2"
_SECRET_BITS = 256
_GENERATOR_BYTES = VALUE_BYTES + 16  # the remainder is then as good as uniform
_KEY_BYTES = 24
_NOT_DIGITS = re.compile(r"[^0-9]")


@dataclass(frozen=True, slots=True)
class Agreed:
    """The result of an exchange, the same at both ends if both had the same digits."""

    key: str
    """The pairing key: 48 hexadecimal digits, as text."""
    proof: bytes
    """The PC sends it, so that the headset notices a wrong code at once."""


def new_digits() -> str:
    """Return new random digits."""
    return f"{secrets.randbelow(10**DIGITS):0{DIGITS}}"


def read_digits(text: str) -> str:
    """Return the digits in a text as typed, with any spaces; ValueError if there are not 8."""
    digits = _NOT_DIGITS.sub("", text)
    if len(digits) != DIGITS:
        raise ValueError(f"the code has {DIGITS} digits, not {len(digits)}")
    return digits


def new_secret() -> int:
    """Return a new random exponent."""
    return secrets.randbits(_SECRET_BITS) | 1


def public_value(code: str, device: int, nonce: bytes, secret: int) -> bytes:
    """Return what an end sends: the generator of this attempt to the power of its secret.

    `code` is the digits, or the code of the invitation.
    """
    info = b"generator" + _attempt(device, nonce)
    root = int.from_bytes(wire.hkdf(code.encode(), _SALT, info, _GENERATOR_BYTES), "big") % PRIME
    # A square generates the subgroup of prime order, so that nothing leaks about the digits.
    return pow(root, 2 * secret, PRIME).to_bytes(VALUE_BYTES, "big")


def agree(
    device: int, nonce: bytes, headset_value: bytes, pc_value: bytes, secret: int, is_pc: bool
) -> Agreed:
    """Return the pairing key from both public values and one's own secret.

    Raises
    ------
    MalformedError
        If the other's public value is invalid.
    """
    value = _read_value(headset_value if is_pc else pc_value)
    shared = pow(value, secret, PRIME).to_bytes(VALUE_BYTES, "big")
    context = _attempt(device, nonce) + headset_value + pc_value
    return Agreed(
        wire.hkdf(shared, _SALT, b"key" + context, _KEY_BYTES).hex(),
        wire.hkdf(shared, _SALT, b"proof" + context, PROOF_BYTES),
    )


def _read_value(value: bytes) -> int:
    number = int.from_bytes(value, "big")
    if len(value) != VALUE_BYTES or not 1 < number < PRIME - 1:
        raise MalformedError("no public value")
    return number


def _attempt(device: int, nonce: bytes) -> bytes:
    return device.to_bytes(8, "big") + nonce


class Exchange:
    """The PC's side: answers a few attempts while digits and QR code are shown.

    Parameters
    ----------
    pairings : Pairings
        The agreed key is offered here; only the headset that has it can connect with it.
    invitation : Invitation
    cookies : Cookies
        An attempt counts once it returns one, which proves its address.
    now_s : float
    """

    def __init__(
        self, pairings: Pairings, invitation: Invitation, cookies: Cookies, now_s: float
    ) -> None:
        self._pairings = pairings
        self._invitation = invitation
        self._cookies = cookies
        self._until_s = now_s + OFFER_S
        self._answers: dict[tuple[int, bytes], pb.Envelope] = {}
        self._tallies = {is_code: _Tally() for is_code in (False, True)}

    @property
    def tried(self) -> tuple[int, str]:
        """The number of attempts by digits so far, and the address of the last one."""
        tally = self._tallies[False]
        return tally.counts[""], tally.last

    @property
    def is_used_up(self) -> bool:
        """True if no attempt by digits is answered any more, from whatever address."""
        return self._tallies[False].counts[""] >= _PER_CODE

    def hear(
        self, packet: Packet, datagram: bytes, address: Address, now_s: float
    ) -> bytes | Rejection:
        """Return the datagram to answer with, or the reason for no answer.

        Raises
        ------
        MalformedError
            If the datagram is intact, but does not ask to pair.
        """
        if now_s > self._until_s or not wire.is_authentic(PUBLIC_KEYS.to_pc, datagram):
            return Rejection.UNPAIRED
        message, device = read_pair(messages.parse(packet.payload)), packet.sequence
        answer = self._answers.get((device, message.nonce))
        if not self._cookies.accept(message.cookie, device, address, now_s):
            answer = handshake.retry(message.nonce, self._cookies.make(device, address, now_s))
        elif answer is None and not self._tallies[message.by_code].allows(address):
            answer = handshake.refused_code(message.nonce)
        elif answer is None:
            answer = self._answers[device, message.nonce] = self._answer(device, message, now_s)
        return handshake.seal(PUBLIC_KEYS.to_headset, device, answer)

    def _answer(self, device: int, message: pb.Pair, now_s: float) -> pb.Envelope:
        secret = new_secret()
        code = self._invitation.code if message.by_code else self._invitation.digits
        value = public_value(code, device, message.nonce, secret)
        agreed = agree(device, message.nonce, message.public_value, value, secret, is_pc=True)
        self._pairings.offer(agreed.key, now_s, f"{device:016x}")
        return paired(message.nonce, value, agreed.proof)


class _Tally:
    """Counts the attempts of each address, each host and all together."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.last = ""

    def allows(self, address: Address) -> bool:
        """Return whether one more attempt is answered, and count it."""
        host, port = address[0].partition("%")[0], address[1]
        if ":" in host:  # one address of IPv6 comes with the others of its network
            host = str(ip_network((host, 64), strict=False))
        limits = {f"{host} {port}": MAX_ATTEMPTS, host: _PER_HOST, "": _PER_CODE}
        if any(self.counts[who] >= most for who, most in limits.items()):
            return False
        self.counts.update(limits.keys())
        self.last = host
        return True


def pair(
    nonce: bytes, value: bytes, name: str, cookie: bytes = b"", *, by_code: bool = False
) -> pb.Envelope:
    """Make the headset's request, with the PC's cookie once it is known."""
    message = pb.Pair(nonce=nonce, public_value=value, name=name, cookie=cookie, by_code=by_code)
    return pb.Envelope(pair=message)


def read_pair(envelope: pb.Envelope) -> pb.Pair:
    """Return the request in an envelope."""
    message = envelope.pair
    if (
        envelope.WhichOneof("body") != "pair"
        or len(message.nonce) != NONCE_BYTES
        or len(message.cookie) > handshake.MAX_COOKIE_BYTES
    ):
        raise MalformedError("a pairing begins with a nonce")
    _read_value(message.public_value)
    read_text(message.name, MAX_NAME_CHARACTERS)
    return message


def paired(nonce: bytes, value: bytes, proof: bytes) -> pb.Envelope:
    """Make the PC's answer."""
    return pb.Envelope(paired=pb.Paired(nonce=nonce, public_value=value, proof=proof))


def finish(message: pb.Paired, device: int, nonce: bytes, value: bytes, secret: int) -> str | None:
    """Return the headset's pairing key from the PC's answer; None if the code is wrong.

    Raises
    ------
    MalformedError
        If the answer is malformed.
    """
    agreed = agree(device, nonce, value, message.public_value, secret, is_pc=False)
    return agreed.key if hmac.compare_digest(agreed.proof, message.proof) else None


_RESEND_S = 0.2
_PATIENCE_S = 5.0


def pair_by_code(
    invitation: Invitation, device_id: str, name: str = "", timeout_s: float = _PATIENCE_S
) -> str:
    """Return the pairing key agreed with the PC that shows this QR code.

    The PC waits for ten minutes for a connection with this key.

    Raises
    ------
    LinkError
        If no PC answers, the code is another one by now, or the PC takes no more attempts.
    ValueError
        If the identity is invalid.
    """
    address = invitation.host, invitation.port
    return _pair(address, device_id, invitation.code, name, timeout_s, by_code=True)


def pair_by_digits(
    server: Address, device_id: str, digits: str, name: str = "", timeout_s: float = _PATIENCE_S
) -> str:
    """Return the pairing key agreed with a PC that shows these digits.

    Raises as `pair_by_code`; ValueError also if there are not 8 digits.
    """
    digits = exchange.read_digits(digits)
    return _pair(server, device_id, digits, name, timeout_s, by_code=False)


def _pair(
    server: Address, device_id: str, code: str, name: str, timeout_s: float, *, by_code: bool
) -> str:
    device = device_number(device_id)
    nonce, secret = secrets.token_bytes(NONCE_BYTES), exchange.new_secret()
    value = exchange.public_value(code, device, nonce, secret)
    cookie = b""
    address = resolve(*server)
    transport = UdpTransport(local_address(address))
    try:
        end_s = time.monotonic() + timeout_s
        while time.monotonic() < end_s:
            asked = exchange.pair(nonce, value, name, cookie, by_code=by_code)
            transport.send(handshake.seal(exchange.PUBLIC_KEYS.to_pc, device, asked), address)
            for datagram, sender in transport.receive(_RESEND_S):
                answer = _read(datagram, device) if sender == address else None
                if answer is None:
                    continue
                if answer.retry.nonce == nonce:
                    cookie = answer.retry.cookie
                if answer.refused.nonce == nonce:
                    raise LinkError(
                        "the PC takes no more codes after too many wrong ones",
                        "show a new one on it",
                    )
                if answer.paired.nonce == nonce:
                    key = exchange.finish(answer.paired, device, nonce, value, secret)
                    if key is None:
                        raise LinkError("the code is wrong", "read it again from the PC's screen")
                    return key
    finally:
        transport.close()
    raise LinkError(
        f"no PC at {server[0]}:{server[1]} answered within {timeout_s:g} s",
        "let it show a code with handcal pair",
    )


def _read(datagram: bytes, device: int) -> pb.Envelope | None:
    """Return the message of a PC to this device; None for anything else."""
    packet = wire.read(datagram)
    if (
        not isinstance(packet, Packet)
        or packet.sequence != device
        or not wire.is_authentic(exchange.PUBLIC_KEYS.to_headset, datagram)
    ):
        return None
    with suppress(MalformedError):
        return messages.parse(packet.payload)
    return None
