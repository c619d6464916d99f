"""The identity and pairing key of this user's OpenXR headset, stored after it was paired."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path

from handcal.core.errors import FileError
from handcal.io.configuration import configuration_folder
from handcal.io.files import make_folder, read_json, write_atomic
from handcal.link.exchange import pair_by_code, pair_by_digits
from handcal.link.invitation import read_invitation
from handcal.link.pairing import device_number, new_device_id
from handcal.link.transport import Address


def pair(
    text: str, server: Address, name: str = "OpenXR headset"
) -> tuple[Address, tuple[str, bytes]]:
    """Pair with the PC that shows a text or digits, and store the identity.

    Returns
    -------
    server : (host, port)
        The PC; of a text, as it says.
    identity : (device_id, key)

    Raises
    ------
    LinkError
        If no PC answers, or the code is wrong.
    ValueError
        If it is neither such a text nor 8 digits.
    FileError
        If the identity cannot be written.
    """
    device_id = new_device_id()
    if "://" in text:
        invitation = read_invitation(text)
        server = invitation.host, invitation.port
        key = pair_by_code(invitation, device_id, name)
    else:
        key = pair_by_digits(server, device_id, text, name)
    make_folder(_path().parent)
    content = json.dumps({"device": device_id, "key": key})
    write_atomic(_path(), content.encode(), mode=0o600)
    return server, (device_id, key.encode())


def read_identity() -> tuple[str, bytes] | None:
    """Return the stored (device_id, key); None if this user has paired none.

    Raises
    ------
    FileError
        If the file is damaged.
    """
    if not _path().exists():
        return None
    stored = read_json(_path())
    with suppress(KeyError, TypeError, ValueError):
        device_number(stored["device"])
        return stored["device"], stored["key"].encode()
    raise FileError(f"{_path()} is damaged", "pair again: handcal openxr client --pair")


def _path() -> Path:
    return configuration_folder() / "openxr-client.json"
