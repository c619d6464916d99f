"""Bounded reading of untrusted files; atomic writing."""

from __future__ import annotations

import errno
import json
import os
import re
import secrets
import shutil
import stat
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handcal.core.errors import FileError
from handcal.core.types import UInt8

MAX_JSON_BYTES = 16 * 2**20
_MOST_DIGITS = 20  # 64 bits and a sign: neither NumPy nor a float overflows
_JUNCTION = 0xA0000003  # IO_REPARSE_TAG_MOUNT_POINT: a link to a folder on Windows
_TEMPORARY = re.compile(r"\..+\.[0-9a-f]{16}", re.DOTALL)
_PLY_TYPES = {"f4": "float", "f8": "double", "u1": "uchar"}


def user_path(text: str | Path) -> Path:
    """Return a path as typed, with ``~`` for a user's folder; that of no user stays as it is.

    `Path.expanduser` raises RuntimeError then, which nobody expects of a typed path.
    """
    return Path(os.path.expanduser(text))  # noqa: PTH111


def write_atomic(path: Path, data: bytes, mode: int = 0o666) -> None:
    """Write `data` so that `path` always holds either the old content or all of the new.

    When it returns, the new content survives a power cut: file and folder are synced.

    Parameters
    ----------
    path : Path
    data : bytes
    mode : int
        Permissions, less the umask and what its folder denies; 0o600 hides a secret from others.

    Raises
    ------
    FileError
        If the folder is missing, not writable or full, or `path` is a device, a pipe or a folder.
    """
    temporary = path.parent / f".{path.name}.{secrets.token_hex(8)}"
    try:
        if path.exists() and not path.is_file():
            raise FileError(f"cannot write {path}: it is a folder, a device or a pipe")
        try:
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
            descriptor = os.open(temporary, flags, mode & path.parent.stat().st_mode)
            with os.fdopen(descriptor, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)  # closed by now, or Windows refuses
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
        sync_folder(path.parent)
    except OSError as error:
        raise FileError(f"cannot write {path}: {error.strerror or error}") from error


def write_new(path: Path, data: bytes) -> None:
    """Write a file that nothing refers to yet, in place of a leftover, and sync file and folder.

    This costs one sync less than `write_atomic`; a killed program may leave part of the file.

    Raises
    ------
    FileError
        If the folder is missing, not writable or full.
    """
    try:
        path.unlink(missing_ok=True)
        with open(path, "xb", opener=open_no_link) as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        sync_folder(path.parent)
    except OSError as error:
        raise FileError(f"cannot write {path}: {error.strerror or error}") from error


def sync_folder(path: Path) -> None:
    """Write the entries of a folder to the disk; OSError if that fails.

    Without it, a power cut can undo that a file was created or replaced. Windows offers nothing of
    the kind, and some network file systems refuse.
    """
    if os.name == "nt":
        return
    folder = os.open(path, os.O_RDONLY)
    try:
        os.fsync(folder)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(folder)


def remove_leftovers(folder: Path) -> None:
    """Remove the temporary files that `write_atomic` left in a folder when it was killed.

    Raises
    ------
    FileError
        If one cannot be removed.
    """
    try:
        for path in folder.iterdir():
            if _TEMPORARY.fullmatch(path.name) and path.is_file():
                path.unlink()
    except OSError as error:
        raise FileError(f"cannot clean up {folder}: {error.strerror or error}") from error


def require_suffix(path: Path, suffix: str) -> None:
    """Raise FileError unless a file to be written has the suffix of its format, as ``.png``."""
    if path.suffix.lower() != suffix:
        raise FileError(f"{path} must end in {suffix}, the format that is written")


def read_limited(path: Path, max_bytes: int, inside: Path | None = None) -> bytes:
    """Return the content of `path`.

    Parameters
    ----------
    path : Path
    max_bytes : int
    inside : Path, optional
        A folder above it that may come from somebody else: links in it are not followed.

    Raises
    ------
    FileError
        If it cannot be read, is a device or a pipe, holds more than `max_bytes`, or is a link or in
        a linked folder `inside`.
    """
    if inside is not None:
        refuse_links(path, inside)
    opener = _open_at_once if inside is None else open_no_link
    try:
        with open(path, "rb", opener=opener) as file:
            found = os.fstat(file.fileno())
            if not stat.S_ISREG(found.st_mode):
                raise FileError(f"cannot read {path}: it is a device or a pipe")
            size = found.st_size  # which is allocated, not the limit
            data = file.read(size + 1) if size <= max_bytes else b""
            if size < len(data) <= max_bytes:  # it grows, or does not know its size
                data += file.read(max_bytes + 1 - len(data))
    except OSError as error:
        raise FileError(f"cannot read {path}: {error.strerror or error}") from error
    if max(size, len(data)) > max_bytes:
        raise FileError(f"{path} is larger than the {max_bytes:,} bytes allowed for it")
    return data


def _open_at_once(path: str, flags: int) -> int:
    """Open a file; a pipe without waiting for its writer."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def open_no_link(path: str, flags: int) -> int:
    """Open a file as `_open_at_once`, but no link; a new one is as private as its folder."""
    flags |= getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0)
    if not flags & os.O_CREAT:
        return os.open(path, flags)
    return os.open(path, flags, 0o666 & os.stat(os.path.dirname(path) or ".").st_mode)  # noqa: PTH116, PTH120


def refuse_links(path: Path, inside: Path) -> None:
    """Raise FileError if `path` or a folder between it and `inside` is a link or a junction.

    A folder from somebody else may hold links to files of the user's: following one would read,
    change or delete those.
    """
    part, below, end = os.fspath(path), "", os.fspath(inside)
    while part not in ("", below, end):
        with suppress(OSError):  # nothing is there
            found = os.lstat(part)
            if stat.S_ISLNK(found.st_mode) or getattr(found, "st_reparse_tag", 0) == _JUNCTION:
                raise FileError(f"{part} is a link, which is not followed here", "remove it")
        part, below = os.path.dirname(part), part  # noqa: PTH120


def modified_s(path: Path) -> float:
    """Return the time at which a file was last changed; 0 if it cannot be read or is gone."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def make_folder(path: Path, inside: Path | None = None) -> Path:
    """Create `path` with its parents if needed, on the disk, and return it.

    Raises
    ------
    FileError
        If it cannot be created, or is a link or in one; `inside` as for `read_limited`.
    """
    if inside is not None:
        refuse_links(path, inside)
    try:
        created = [folder for folder in (path, *path.parents) if not folder.exists()]
        path.mkdir(parents=True, exist_ok=True)
        for folder in reversed(created):
            sync_folder(folder.parent)
    except OSError as error:
        raise FileError(f"cannot create the folder {path}: {error.strerror or error}") from error
    return path


def require_writable(folder: Path) -> None:
    """Raise FileError if no file can be written to a folder, which need not exist yet."""
    folder = folder.absolute()
    there = next(path for path in (folder, *folder.parents) if os.path.exists(path))
    if not there.is_dir():
        raise FileError(f"{there} is a file", "choose a folder")
    if not os.access(there, os.W_OK | os.X_OK):
        raise FileError(f"cannot write to {there}", "choose another folder")
    if shutil.disk_usage(there).total == 0:  # such as /proc, which lets its owner write
        raise FileError(f"nothing can be stored in {there}", "choose another folder")


def write_json(path: Path, value: object) -> None:
    """Write `value` as indented JSON, atomically; NaN is refused with ValueError."""
    write_atomic(path, (json.dumps(value, indent=2, allow_nan=False) + "\n").encode())


def read_json(path: Path, inside: Path | None = None) -> dict[str, Any]:
    """Return the JSON object in `path`; `inside` as for `read_limited`.

    Raises
    ------
    FileError
        If it cannot be read, is too large, or is not a JSON object.
    """
    data = read_limited(path, MAX_JSON_BYTES, inside)
    try:
        value = json.loads(data, parse_int=whole_number)
    except UnicodeDecodeError as error:
        raise FileError(f"{path} is not valid JSON: not a text file") from error
    except (ValueError, RecursionError) as error:
        raise FileError(f"{path} is not valid JSON: {error}") from error
    if not isinstance(value, dict):
        raise FileError(f"{path} must hold a JSON object")
    return value


def whole_number(digits: str) -> int:
    """Return a whole number of JSON that a float can hold; ValueError if it is larger."""
    if len(digits) > _MOST_DIGITS:
        raise ValueError("a whole number is too large")
    return int(digits)


def write_ply(
    path: Path,
    points_m: NDArray[np.floating],
    colors: UInt8 | None = None,
    properties: Mapping[str, NDArray[Any]] | None = None,
    comments: Sequence[str] = (),
) -> None:
    """Write (N, 3) points in metres as binary PLY, in their own precision.

    Parameters
    ----------
    path : Path
    points_m : (N, 3) float32 or float64
    colors : (N, 3) uint8, optional
        RGB.
    properties : mapping of name to (N,) float32, float64 or uint8, optional
        Further values of each point; floats may be NaN.
    comments : sequence of str
        Further lines of the header, in ASCII.
    """
    columns: dict[str, NDArray[Any]] = {axis: points_m[:, i] for i, axis in enumerate("xyz")}
    if colors is not None:
        columns |= {channel: colors[:, i] for i, channel in enumerate(("red", "green", "blue"))}
    columns |= properties or {}
    vertices = np.empty(
        len(points_m),
        dtype=[(name, column.dtype.newbyteorder("<")) for name, column in columns.items()],
    )
    for name, column in columns.items():
        vertices[name] = column
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {line}" for line in ("metres", *comments)),
        f"element vertex {len(vertices)}",
        *(
            f"property {_PLY_TYPES[column.dtype.str[1:]]} {name}"
            for name, column in columns.items()
        ),
        "end_header\n",
    ]
    write_atomic(path, "\n".join(header).encode() + vertices.tobytes())
