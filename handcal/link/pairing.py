"""The key that PC and headset share."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

from handcal.errors import LinkError
from handcal.files import read_limited

KEY_VARIABLE = "HANDCAL_PAIRING_KEY"
_MAX_KEY_BYTES = 1024


def new_pairing_key() -> str:
    """Return a fresh key of 192 bits, as text."""
    return secrets.token_urlsafe(24)


def read_pairing_key(path: Path | None = None) -> bytes:
    """Return the key in `path`, or in the environment; never an argument, which others can see.

    Raises
    ------
    LinkError
        If there is none.
    FileError
        If the file cannot be read.
    """
    if path is not None:
        key = read_limited(path, _MAX_KEY_BYTES).strip()
    else:
        key = os.environ.get(KEY_VARIABLE, "").strip().encode()
    if not key:
        raise LinkError(f"no pairing key: set {KEY_VARIABLE} or give a file that holds it")
    return key
