"""The pairing keys: one for each device, known to the device and the PC."""

from __future__ import annotations

import json
import os
import re
import secrets
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import RLock

from handcal.errors import FileError, LinkError
from handcal.io.files import make_folder, read_limited, write_atomic
from handcal.link.wire import MIN_PAIRING_KEY_BYTES

KEY_VARIABLE = "HANDCAL_PAIRING_KEY"
MAX_DEVICES = 16
MAX_NAME_CHARACTERS = 40
_MAX_KEY_BYTES = 1024
_MAX_FILE_BYTES = MAX_DEVICES * 2 * _MAX_KEY_BYTES
_DEVICE_ID = re.compile(r"[0-9a-f]{16}")


def new_pairing_key() -> str:
    """Return a new random key of 192 bits, as text."""
    return secrets.token_urlsafe(24)


def new_device_id() -> str:
    """Return a new random identity of a device."""
    return secrets.token_hex(8)


def device_number(device_id: str) -> int:
    """Return a device's identity as sent in the handshake.

    Raises
    ------
    ValueError
        Unless it has 16 hexadecimal digits in lower case.
    """
    if not _DEVICE_ID.fullmatch(device_id):
        raise ValueError(f"a device's identity has 16 hexadecimal digits, not {device_id!r}")
    return int(device_id, 16)


def read_pairing_key(path: Path | None = None) -> bytes:
    """Return a device's key from `path` or the environment; arguments are visible to other users.

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


@dataclass(frozen=True, slots=True)
class Pairing:
    """A pairing key and the device it belongs to."""

    key: str
    device_id: str = ""
    """Empty until a device connects with this key; then it belongs to that device."""
    name: str = ""
    """The device's name when it connected first."""

    def __post_init__(self) -> None:
        count = len(self.key.encode())
        if not MIN_PAIRING_KEY_BYTES <= count <= _MAX_KEY_BYTES:
            raise ValueError(
                f"the pairing key has {count} bytes; use at least {MIN_PAIRING_KEY_BYTES}"
            )
        if self.device_id:
            device_number(self.device_id)
        if len(self.name) > MAX_NAME_CHARACTERS:
            raise ValueError(f"a device's name has at most {MAX_NAME_CHARACTERS} characters")


class Pairings:
    """The devices that may connect to this PC; safe to use from several threads.

    Parameters
    ----------
    pairings : tuple of Pairing
    path : Path, optional
        The file that is kept up to date; only this user can read it.
    """

    def __init__(self, pairings: tuple[Pairing, ...], path: Path | None = None) -> None:
        self.all = pairings[-MAX_DEVICES:]
        self._path = path
        self._lock = RLock()

    @classmethod
    def read(cls, path: Path) -> Pairings:
        """Read a file: JSON, or a bare key as version 1 wrote it. A missing one is no pairing.

        Raises
        ------
        FileError
            If the file cannot be read, or is damaged. It is left as it is.
        """
        if not path.exists():
            return cls((), path)
        content = read_limited(path, _MAX_FILE_BYTES).strip()
        try:
            text = content.decode()
            if not text.startswith("{"):
                return cls((Pairing(text),), path)
            devices = json.loads(text)["devices"]
            if not isinstance(devices, list) or len(devices) > MAX_DEVICES:
                raise ValueError(f"more than {MAX_DEVICES} devices")
            pairings = tuple(Pairing(**device) for device in devices)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise FileError(
                f"the pairing keys in {path} are damaged; restore the file, or make a new key and "
                "enter it in every headset"
            ) from error
        return cls(pairings, path)

    def open_key(self) -> str:
        """Return the key with which the next new device connects; make one if there is none.

        Raises
        ------
        FileError
            If it cannot be written.
        """
        with self._lock:
            for pairing in self.all:
                if not pairing.device_id:
                    return pairing.key
            made = Pairing(new_pairing_key())
            self._change((*self.all, made))
            return made.key

    def bind(self, pairing: Pairing, device_id: str, name: str) -> None:
        """Give an open key to a device, in place of the device's older key.

        Beyond `MAX_DEVICES` the device that was paired first is forgotten.

        Raises
        ------
        FileError
            If the file cannot be written; the key belongs to the device until the program ends.
        """
        with self._lock:
            others = (one for one in self.all if one is not pairing and one.device_id != device_id)
            self._change((*others, Pairing(pairing.key, device_id, name)))

    def renew(self) -> str:
        """Forget every device and return a new key.

        Raises
        ------
        FileError
            If it cannot be written.
        """
        with self._lock:
            self._change(())
            return self.open_key()

    def _change(self, pairings: tuple[Pairing, ...]) -> None:
        self.all = pairings[-MAX_DEVICES:]
        if self._path is not None:
            content = json.dumps({"devices": [asdict(one) for one in self.all]}, indent=2)
            make_folder(self._path.parent)
            write_atomic(self._path, f"{content}\n".encode(), mode=0o600)
