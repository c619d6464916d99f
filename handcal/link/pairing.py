"""The pairing keys: one for each device, known to the device and the PC."""

from __future__ import annotations

import json
import logging
import os
import re
import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from threading import RLock

from handcal.core.errors import FileError, LinkError
from handcal.io.configuration import configuration_folder
from handcal.io.files import make_folder, read_limited, write_atomic
from handcal.io.lock import FileLock
from handcal.link.wire import MIN_PAIRING_KEY_BYTES

_LOG = logging.getLogger(__name__)

KEY_VARIABLE = "HANDCAL_PAIRING_KEY"
MAX_DEVICES = 16
MAX_NAME_CHARACTERS = 40
OFFER_S = 600.0
"""Time within which a device must connect with an offered key."""
_MAX_OFFERS = 256  # more than the attempts that an invitation answers
_LOCK_S = 2.0
_MAX_KEY_BYTES = 1024
_MAX_FILE_BYTES = MAX_DEVICES * 2 * _MAX_KEY_BYTES
_DEVICE_ID = re.compile(r"[0-9a-f]{16}")


def pairing_file() -> Path:
    """Return the path of this user's file of paired devices; it need not exist."""
    return configuration_folder() / "pairing.key"


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
        key = _read_secret(path, _MAX_KEY_BYTES)
    else:
        key = os.fsencode(os.environ.get(KEY_VARIABLE, "")).strip()
    if not key:
        raise LinkError("no pairing key", f"set {KEY_VARIABLE} or give a file that holds it")
    if len(key) < MIN_PAIRING_KEY_BYTES:
        raise LinkError(
            f"the pairing key has {len(key)} bytes",
            f"use at least {MIN_PAIRING_KEY_BYTES}",
        )
    return key


@dataclass(frozen=True, slots=True)
class Pairing:
    """A pairing key and the device it belongs to."""

    key: str
    device_id: str = ""
    """Empty until a device connects with this key; then it belongs to that device."""
    name: str = ""
    """The device's name when it first connected."""

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
        if not self.name.isprintable():
            raise ValueError("a device's name has no control characters")


class Pairings:
    """The devices that may connect to this PC; safe to use from several threads and programs.

    Parameters
    ----------
    pairings : tuple of Pairing
    path : Path, optional
        The file that is kept up to date; only this user can read it. What other programs change in
        it is taken over by `refresh`, and before every change.

    Attributes
    ----------
    all : tuple of Pairing
        The devices, and any stored key that belongs to none yet.
    """

    def __init__(self, pairings: tuple[Pairing, ...], path: Path | None = None) -> None:
        self.all = pairings[-MAX_DEVICES:]
        self._path = path
        self._offers: dict[str, tuple[float, str]] = {}
        self._lock = RLock()
        self._stamp = self._look()

    @classmethod
    def read(cls, path: Path) -> Pairings:
        """Read a file (JSON); a missing one means no pairing.

        Raises
        ------
        FileError
            If the file cannot be read, or is damaged. It is left as it is.
        """
        pairings = cls((), path)  # looked at before it is read: a later change is noticed
        pairings.all = _read(path)
        return pairings

    def refresh(self) -> None:
        """Take over what another program has changed in the file.

        Raises
        ------
        FileError
            If the file cannot be read, or is damaged; the devices known so far stay.
        """
        with self._lock:
            stamp = self._look()
            if self._path is not None and stamp != self._stamp:
                self.all = _read(self._path)
                self._stamp = stamp

    def open_key(self) -> str:
        """Return the stored key with which the next new device connects; make one if needed.

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
            self._change(lambda before: (*before, made))
            return made.key

    def offer(self, key: str, now_s: float | None = None, device_id: str = "") -> None:
        """Let a device connect with a key within `OFFER_S`; the key is not stored before.

        Without `device_id`, any new device may.
        """
        offered = Pairing(key)
        with self._lock:
            end_s = (time.monotonic() if now_s is None else now_s) + OFFER_S
            self._offers[offered.key] = end_s, device_id
            while len(self._offers) > _MAX_OFFERS:
                del self._offers[next(iter(self._offers))]

    def withdraw(self) -> None:
        """End all offers."""
        with self._lock:
            self._offers.clear()

    def offered(self, now_s: float, device_id: str = "") -> tuple[Pairing, ...]:
        """Return the offers to a device that have not ended."""
        with self._lock:
            self._offers = {
                key: (end_s, to) for key, (end_s, to) in self._offers.items() if end_s > now_s
            }
            return tuple(
                Pairing(key) for key, (_, to) in self._offers.items() if to in ("", device_id)
            )

    def bind(self, pairing: Pairing, device_id: str, name: str) -> None:
        """Give an open or offered key to a device, in place of the device's older key.

        Beyond `MAX_DEVICES` the device that was paired first is forgotten.

        Raises
        ------
        FileError
            If the file cannot be written; the key belongs to the device until the program ends.
        """
        bound = Pairing(pairing.key, device_id, name)

        def edit(before: tuple[Pairing, ...]) -> tuple[Pairing, ...]:
            others = (each for each in before if each != pairing and each.device_id != device_id)
            return (*others, bound)

        with self._lock:
            self._offers.pop(pairing.key, None)
            self._change(edit)

    def rename(self, device_id: str, name: str) -> None:
        """Give a device another name, which is only for display.

        Raises
        ------
        LinkError
            If there is no such device.
        ValueError
            If the name is too long.
        FileError
            If the file cannot be written.
        """
        with self._lock:
            self._require(device_id)
            self._change(
                lambda before: tuple(
                    replace(pairing, name=name) if pairing.device_id == device_id else pairing
                    for pairing in before
                )
            )

    def revoke(self, device_id: str) -> None:
        """Forget a device; its session ends, and it connects again only with a new key.

        Raises
        ------
        LinkError
            If there is no such device.
        FileError
            If the file cannot be written; the device is refused until the program ends.
        """
        with self._lock:
            self._require(device_id)
            self._change(
                lambda before: tuple(each for each in before if each.device_id != device_id)
            )

    def renew(self) -> str:
        """Forget every device and return a new key.

        Raises
        ------
        FileError
            If it cannot be written.
        """
        with self._lock:
            self._change(lambda _: ())
            return self.open_key()

    def _require(self, device_id: str) -> None:
        self.refresh()
        if not device_id or all(pairing.device_id != device_id for pairing in self.all):
            raise LinkError(f"no device {device_id!r} is paired", "see handcal devices")

    def _change(self, edit: Callable[[tuple[Pairing, ...]], tuple[Pairing, ...]]) -> None:
        """Change the pairings, in memory even if the file cannot be written."""
        try:
            if self._path is not None:
                make_folder(self._path.parent)
                with _locked(self._path.with_name(f"{self._path.name}.lock")):
                    self.refresh()
                    stored = [asdict(pairing) for pairing in edit(self.all)[-MAX_DEVICES:]]
                    content = json.dumps({"devices": stored}, indent=2)
                    write_atomic(self._path, f"{content}\n".encode(), mode=0o600)
                    self._stamp = self._look()
        finally:
            self.all = edit(self.all)[-MAX_DEVICES:]

    def _look(self) -> tuple[int, int, int] | None:
        """Return what changes when the file is replaced; None without a file."""
        with suppress(OSError):
            if self._path is not None:
                status = self._path.stat()
                return status.st_ino, status.st_mtime_ns, status.st_size
        return None


def _read_secret(path: Path, max_bytes: int) -> bytes:
    """Return the content of a file of keys, with a warning if other users can open it."""
    content = read_limited(path, max_bytes).strip()
    with suppress(OSError):
        if os.name == "posix" and path.stat().st_mode & 0o077:
            _LOG.warning(
                "other users of this computer can open the keys in %s: chmod 600 forbids it; "
                "pair the headsets again if somebody may have read them",
                path,
            )
    return content


def _read(path: Path) -> tuple[Pairing, ...]:
    if not os.path.exists(path):
        return ()
    content = _read_secret(path, _MAX_FILE_BYTES)
    try:
        devices = json.loads(content.decode())["devices"]
        if not isinstance(devices, list) or len(devices) > MAX_DEVICES:
            raise ValueError(f"more than {MAX_DEVICES} devices")
        return tuple(Pairing(**device) for device in devices)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise FileError(
            f"the pairing keys in {path} are damaged",
            "restore the file, or make a new key and enter it in every headset",
        ) from error


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold a lock that others hold only for a moment; FileError if it stays held."""
    end_s = time.monotonic() + _LOCK_S
    while True:
        try:
            lock = FileLock(path)
            break
        except FileError:
            if time.monotonic() > end_s:
                raise
            time.sleep(0.01)
    try:
        yield
    finally:
        lock.release()
