"""Proof of an address: a MAC over it, which only who receives there can return.

As WireGuard's cookie and QUIC's Retry; nothing is stored about who asks.
"""

from __future__ import annotations

import hmac
import math
import secrets

from handcal.link.transport import Address

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
