"""The headset's side of pairing by digits."""

from __future__ import annotations

import secrets
import time
from contextlib import suppress

from handcal.core.errors import LinkError
from handcal.link import exchange, greetings, messages, wire
from handcal.link import handcal_pb2 as pb
from handcal.link.fields import MalformedError
from handcal.link.pairing import device_number
from handcal.link.settings import DEFAULT_SETTINGS
from handcal.link.transport import Address, UdpTransport, local_address, resolve
from handcal.link.wire import NONCE_BYTES, Packet

_RESEND_S = 0.2


def pair_by_digits(
    server: Address, device_id: str, digits: str, name: str = "", timeout_s: float = 5.0
) -> str:
    """Return the pairing key agreed with a PC that shows these digits.

    The PC waits for ten minutes for a connection with this key.

    Raises
    ------
    LinkError
        If no PC answers, the digits are wrong, or the PC takes no more attempts.
    ValueError
        If there are not 8 digits, or the identity is invalid.
    """
    digits = exchange.read_digits(digits)
    device = device_number(device_id)
    nonce, secret = secrets.token_bytes(NONCE_BYTES), exchange.new_secret()
    value = exchange.public_value(digits, device, nonce, secret)
    request = greetings.seal(exchange.PUBLIC_KEYS.to_pc, device, exchange.pair(nonce, value, name))
    address = resolve(*server)
    transport = UdpTransport(local_address(address), DEFAULT_SETTINGS.receive_buffer_bytes)
    try:
        end_s = time.monotonic() + timeout_s
        while time.monotonic() < end_s:
            transport.send(request, address)
            for datagram, sender in transport.receive(_RESEND_S):
                answer = _read(datagram, device) if sender == address else None
                if answer is None:
                    continue
                if answer.refused.nonce == nonce:
                    raise LinkError(
                        "the PC takes no more codes after too many wrong ones; show a new one on it"
                    )
                if answer.paired.nonce == nonce:
                    key = exchange.finish(answer.paired, device, nonce, value, secret)
                    if key is None:
                        raise LinkError("the code is wrong; read it again from the PC's screen")
                    return key
    finally:
        transport.close()
    raise LinkError(
        f"no PC at {server[0]}:{server[1]} answered within {timeout_s:g} s; let it show a code "
        "with handcal pair"
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
