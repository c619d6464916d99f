"""The pairing key that PC and headset share."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

from handcal.errors import LinkError
from handcal.io.files import make_folder, read_limited, write_atomic
from handcal.link.wire import MIN_PAIRING_KEY_BYTES

KEY_VARIABLE = "HANDCAL_PAIRING_KEY"
_MAX_KEY_BYTES = 1024


def new_pairing_key() -> str:
    """Return a new random key of 192 bits, as text."""
    return secrets.token_urlsafe(24)


def read_pairing_key(path: Path | None = None) -> bytes:
    """Return the key from `path` or the environment; arguments are visible to other users.

    Raises
    ------
    LinkError
        If no key is given, or it is too short.
    FileError
        If the file cannot be read.
    """
    if path is not None:
        key = read_limited(path, _MAX_KEY_BYTES).strip()
    else:
        key = os.fsencode(os.environ.get(KEY_VARIABLE, "")).strip()
    if not key:
        raise LinkError(f"no pairing key: set {KEY_VARIABLE} or give a file that holds it")
    if len(key) < MIN_PAIRING_KEY_BYTES:
        raise LinkError(
            f"the pairing key has {len(key)} bytes; use at least {MIN_PAIRING_KEY_BYTES}"
        )
    return key


def write_pairing_key(path: Path) -> str:
    """Write a new key to a file that only this user can read, and return the key.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    key = new_pairing_key()
    make_folder(path.parent)
    write_atomic(path, f"{key}\n".encode(), mode=0o600)
    return key
