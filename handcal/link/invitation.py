"""An invitation to pair: the PC's address and a one-time code, as a text and as a QR code."""

from __future__ import annotations

import re
import secrets
from dataclasses import dataclass

import segno

from handcal.core.errors import LinkError

CODE_CHARACTERS = 26
_ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZ234567"
_BORDER = 4
_TEXT = re.compile(
    rf"HANDCAL://(?:\[(?P<ipv6>[0-9A-F:.]+)\]|(?P<host>[A-Z0-9.-]+)):(?P<port>[0-9]{{1,5}})"
    rf"/(?P<code>[{_ALPHABET}]{{{CODE_CHARACTERS}}})(?:\?.*)?"
)


def new_code() -> str:
    """Return a new random one-time code of 130 bits."""
    return "".join(secrets.choice(_ALPHABET) for _ in range(CODE_CHARACTERS))


@dataclass(frozen=True, slots=True)
class Invitation:
    """Everything that a headset needs in order to connect for the first time."""

    host: str
    """Address of the PC in numbers, or its name."""
    port: int
    code: str
    """One-time code, by which the pairing key is agreed."""
    digits: str = ""
    """Short code for a headset that knows the address; not part of the QR code."""

    @property
    def text(self) -> str:
        """The text of the QR code, as ``HANDCAL://192.168.1.20:47800/ABCDEFGHIJKLMNOPQRSTUVWXYZ``.

        It is in capitals, which take less space in a QR code.
        """
        host = self.host.partition("%")[0].upper()
        return f"HANDCAL://{f'[{host}]' if ':' in host else host}:{self.port}/{self.code}"


def read_invitation(text: str) -> Invitation:
    """Return the invitation in a text, scanned or typed, in upper or lower case.

    Raises
    ------
    LinkError
        If it is not an invitation.
    """
    parts = _TEXT.fullmatch(text.strip().upper())
    if parts is None or not 0 < int(parts["port"]) < 65536:
        raise LinkError(
            "this is not an invitation from handcal",
            "scan the QR code of handcal pair",
        )
    return Invitation((parts["ipv6"] or parts["host"]).lower(), int(parts["port"]), parts["code"])


def qr_matrix(text: str) -> tuple[tuple[bool, ...], ...]:
    """Return the QR code of a text by rows, with its border; True is dark."""
    rows = segno.make_qr(text, error="m").matrix_iter(border=_BORDER)
    return tuple(tuple(bool(module) for module in row) for row in rows)


def qr_lines(text: str) -> list[str]:
    """Return the QR code of a text as lines of half blocks, to print black on white."""
    rows = [*qr_matrix(text)]
    if len(rows) % 2:
        rows.append((False,) * len(rows))
    return [
        "".join(" ▄▀█"[2 * above + below] for above, below in zip(*pair, strict=True))
        for pair in zip(rows[::2], rows[1::2], strict=True)
    ]
