"""The headset's side of pairing."""

from __future__ import annotations

import secrets
import time
from contextlib import suppress

from handcal.core.errors import LinkError
from handcal.link import exchange, handshake, messages, wire
from handcal.link import handcal_pb2 as pb
from handcal.link.fields import MalformedError
from handcal.link.invitation import Invitation
from handcal.link.pairing import device_number
from handcal.link.settings import DEFAULT_SETTINGS
from handcal.link.transport import Address, UdpTransport, local_address, resolve
from handcal.link.wire import NONCE_BYTES, Packet

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
    transport = UdpTransport(local_address(address), DEFAULT_SETTINGS.receive_buffer_bytes)
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
