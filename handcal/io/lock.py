"""A file lock that one program at a time can hold.

The system releases it when its holder ends for any reason, so a lock cannot go stale; the
process id in the file is only for people to read.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from io import FileIO
from pathlib import Path

from handcal.core.errors import FileError, InUseError
from handcal.io.files import open_no_link, refuse_links

_MOST_BYTES = 64

if sys.platform == "win32":
    import msvcrt

    # Windows locks bytes against reading too: lock one far beyond the process id.
    _LOCKED_BYTE = 2**30

    def _try_lock(file: FileIO) -> None:
        file.seek(_LOCKED_BYTE)
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        file.seek(0)
else:
    import fcntl

    def _try_lock(file: FileIO) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


class FileLock:
    """Holds the lock at `path` from construction to `release`.

    Raises
    ------
    InUseError
        If this or another program holds it.
    FileError
        If the file cannot be opened, is a link, or is not one that a lock has written.
    """

    def __init__(self, path: Path) -> None:
        refuse_links(path, path.parent)
        try:
            file = open(path, "a+b", buffering=0, opener=open_no_link)  # noqa: SIM115
            file.seek(0)
            holder = (file.read(_MOST_BYTES) or b"").strip(b"\0").decode(errors="replace")
        except OSError as error:
            is_gone = isinstance(error, FileNotFoundError)
            advice = "" if is_gone else "make it writable, or use a copy of it elsewhere"
            raise FileError(
                f"cannot lock {path.parent}: {error.strerror or error}", advice
            ) from error
        if holder.strip("0123456789"):
            file.close()
            raise FileError(
                f"{path} is no lock of handcal, as it holds something else",
                "move it away",
            )
        try:
            _try_lock(file)
        except OSError as error:
            file.close()
            is_here = holder == str(os.getpid())
            whose = "this program" if is_here else "another program"
            raise InUseError(
                f"{path.parent} is in use by process {holder or 'unknown'}, {whose}",
                "close it there, then try again",
                is_here=is_here,
            ) from error
        with suppress(OSError):  # only for people to read: a full disk locks nobody out
            file.truncate(0)
            file.write(str(os.getpid()).encode())
        self._file = file
        self._path = path

    def require_held(self) -> None:
        """Raise FileError if the folder or the lock's file was removed or replaced."""
        try:
            is_same = os.path.samestat(self._path.lstat(), os.fstat(self._file.fileno()))
        except FileNotFoundError:
            is_same = False
        except OSError as error:
            raise FileError(f"cannot read {self._path}: {error.strerror or error}") from error
        if is_same:
            return
        folder = self._path.parent
        if not os.path.exists(folder):
            raise FileError(f"cannot write to {folder}: it was moved or deleted")
        raise FileError(
            f"cannot write to {folder}: it was replaced or restored, or its lock was deleted, so "
            "another program may be writing to it",
            "open it again",
        )

    def release(self) -> None:
        """Release the lock; safe to call twice."""
        self._file.close()
