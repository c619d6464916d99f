"""The journal of a session: an append-only file, one JSON object per line, safe after a crash.

Every line ends with its checksum. A damaged line is left out and reported; all others count.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from handcal.core.errors import FileError
from handcal.io.files import open_no_link, read_limited, whole_number, write_atomic

JOURNAL_VERSION = 3
MAX_JOURNAL_BYTES = 64 * 2**20
JOURNAL, JOURNAL_END = "journal.jsonl", "journal.end"
_MAX_END_BYTES = 1024
_CHECKSUM_DIGITS = 32


@dataclass(frozen=True, slots=True)
class Event:
    """One line of the journal."""

    number: int
    """Running number from 1."""
    time: str
    """UTC, ISO 8601."""
    name: str
    data: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Damage:
    """One damaged part of a session."""

    file: str
    """Path in the session's folder, such as ``alignments/1.npz``."""
    line: int | None
    """Number of the journal's line, from 1; None for another file."""
    what: str
    instead: str = ""
    """The consequence, such as what was left out; empty for nothing."""

    @property
    def text(self) -> str:
        """The damage, and its consequence."""
        return f"{self.what}; {self.instead}" if self.instead else self.what

    def __str__(self) -> str:
        where = self.file if self.line is None else f"{self.file}, line {self.line}"
        return f"{where}: {self.text}"


@dataclass(frozen=True, slots=True)
class JournalContent:
    """The contents of a journal."""

    events: tuple[Event, ...]
    """Those whose lines are sound."""
    complete_bytes: int
    """Length of the complete lines."""
    torn_bytes: int
    """Length of an incomplete last line, which is ignored; 0 if there is none."""
    next_number: int = 1
    """Number of the next event; greater than that of any damaged or missing line."""
    ended: int = 0
    """Number of the last event when the journal was closed; 0 if it never was."""
    notes_sha256: str | None = None
    """Checksum of the notes then; empty without notes, None if unknown."""
    damaged: tuple[Damage, ...] = ()


def happens_now(number: int, name: str, data: dict[str, Any]) -> Event:
    """Return an event with the current time."""
    return Event(number, datetime.now(UTC).isoformat(), name, data)


def journal_line(event: Event) -> bytes:
    """Return an event as a line; ValueError if its data contain NaN.

    Its last member, `sha256`, is the first 32 digits of the SHA-256 of the line without it:
    ``{…}`` becomes ``{…, "sha256": "…"}``.
    """
    fields = {
        "version": JOURNAL_VERSION,
        "number": event.number,
        "time": event.time,
        "event": event.name,
        "data": event.data,
    }
    content = json.dumps(fields, allow_nan=False).encode()
    return content[:-1] + _ending(content)


def read_journal(path: Path) -> JournalContent:
    """Read a journal; damaged lines are left out and reported.

    Raises
    ------
    FileError
        If it cannot be read, is too large, of another version, or without any sound line.
    """
    content = read_limited(path, MAX_JOURNAL_BYTES, path.parent)
    *lines, torn = content.split(b"\n")
    events: list[Event] = []
    damaged: list[Damage] = []
    expected, done_bytes = 1, 0
    for place, line in enumerate(lines, 1):
        try:
            event = _parse_line(path, line)
            if event.number <= (events[-1].number if events else 0):
                raise ValueError("is not the event expected there")
        except ValueError as error:
            damaged.append(Damage(path.name, place, str(error), "left out"))
            expected += 1
        else:
            if event.number > expected:
                damaged.append(_missing(path, place, expected, event.number - 1))
            events.append(event)
            expected = event.number + 1
        done_bytes += len(line) + 1
    if not events:
        why = damaged[0].what if damaged else "is missing"
        raise FileError(f"{path} does not begin as the journal of a session: line 1 {why}")
    ended, notes_sha256 = _read_end(path.with_name(JOURNAL_END), damaged)
    if ended >= expected:
        damaged.append(_missing(path, len(lines), expected, ended))
    return JournalContent(
        events=tuple(events),
        complete_bytes=done_bytes,
        torn_bytes=len(torn),
        next_number=max(expected, ended + 1),
        ended=ended,
        notes_sha256=notes_sha256,
        damaged=tuple(damaged),
    )


class JournalWriter:
    """Appends to a journal that no other program writes to.

    Parameters
    ----------
    path : Path
    content : JournalContent
        Its present contents; an incomplete last line is removed by the next write.

    Attributes
    ----------
    next_number : int
        Number of the next event.
    """

    def __init__(self, path: Path, content: JournalContent) -> None:
        self._path = path
        self.next_number = content.next_number
        self._bytes = content.complete_bytes
        self._torn_bytes = content.torn_bytes
        found = path.lstat()
        self._file = found.st_dev, found.st_ino

    @property
    def complete_bytes(self) -> int:
        """Length of the complete lines."""
        return self._bytes

    def append(self, line: bytes) -> None:
        """Append the line of the event `next_number`, and sync it to disk.

        Raises
        ------
        FileError
            If the journal cannot be written or is full; its contents are kept.
        """
        if self._bytes + len(line) > MAX_JOURNAL_BYTES:
            raise FileError(f"the journal of {self._path.parent} is full", "start another session")
        try:
            # Reopened each time, so that a folder that was moved or removed is noticed.
            with open(self._path, "r+b", opener=open_no_link) as file:
                self._torn_bytes = max(self._torn_bytes, len(line))
                file.seek(self._bytes)
                file.truncate()  # a failed or killed write may have left part of a line
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise FileError(f"cannot write {self._path}: {error.strerror or error}") from error
        self._bytes += len(line)
        self._torn_bytes = 0
        self.next_number += 1

    def write_end(self, notes_sha256: str | None) -> None:
        """Store the number of the last event, so that a journal cut short later is noticed."""
        fields = {
            "version": JOURNAL_VERSION,
            "number": self.next_number - 1,
            "notes_sha256": notes_sha256,
        }
        content = json.dumps(fields).encode()
        write_atomic(self._path.with_name(JOURNAL_END), content[:-1] + _ending(content))

    def require_unchanged(self) -> None:
        """Raise FileError unless the file is the one that was read, with what was added since."""
        try:
            found = self._path.lstat()
        except OSError as error:
            raise FileError(f"cannot write {self._path}: {error.strerror or error}") from error
        is_known = self._bytes <= found.st_size <= self._bytes + self._torn_bytes
        if (found.st_dev, found.st_ino) != self._file or not is_known:
            raise FileError(
                f"cannot write {self._path}: it was changed or replaced by another program",
                "open the session again",
            )


def _ending(content: bytes) -> bytes:
    checksum = hashlib.sha256(content).hexdigest()[:_CHECKSUM_DIGITS]
    return b', "sha256": "%s"}\n' % checksum.encode()


def _missing(path: Path, place: int, first: int, last: int) -> Damage:
    what = f"event {first} is" if first == last else f"events {first} to {last} are"
    return Damage(path.name, place, f"{what} missing here")


def _parse_sound(path: Path, line: bytes) -> dict[str, Any]:
    """Return the object in a line that ends with its checksum.

    Raises
    ------
    FileError
        If the line is sound, but of another version.
    ValueError
        If it is damaged.
    """
    try:
        fields: dict[str, Any] = json.loads(line, parse_int=whole_number)
        version = fields["version"]
    except (ValueError, RecursionError, KeyError, TypeError) as error:
        raise ValueError("is not an event of a session") from error
    content = line[: 1 - len(_ending(b""))] + b"}"
    is_sound = line + b"\n" == content[:-1] + _ending(content)
    if type(version) is not int or version != JOURNAL_VERSION:
        problem = f"has version {version!r}, not {JOURNAL_VERSION}; use the handcal that wrote it"
        if is_sound:
            raise FileError(f"{path} {problem}")
        raise ValueError(problem)
    if not is_sound:
        raise ValueError("does not have its checksum")
    return fields


def find_journals(folder: Path) -> list[Path]:
    """Return the journals of the sessions in a folder, as far as it can be read."""
    try:
        journals = [path / JOURNAL for path in sorted(folder.iterdir())]
    except OSError:
        return []
    return [journal for journal in journals if os.path.exists(journal)]


def _parse_line(path: Path, line: bytes) -> Event:
    """Return the event of a line; ValueError if it is damaged."""
    fields = _parse_sound(path, line)
    try:
        event = Event(fields["number"], fields["time"], fields["event"], fields["data"])
    except KeyError as error:
        raise ValueError("is not an event of a session") from error
    kinds = isinstance(event.name, str), isinstance(event.time, str), isinstance(event.data, dict)
    if type(event.number) is not int or not all(kinds) or not _is_time(event.time):
        raise ValueError("is not the event expected there")
    return event


def _read_end(path: Path, damaged: list[Damage]) -> tuple[int, str | None]:
    """Return `ended` and `notes_sha256` of `JournalContent`."""
    if not path.exists():
        return 0, None
    try:
        line = read_limited(path, _MAX_END_BYTES, path.parent)
        if not line.endswith(b"\n"):
            raise ValueError("is cut short")
        fields = _parse_sound(path, line[:-1])
        number, notes_sha256 = fields["number"], fields["notes_sha256"]
        if type(number) is not int or not isinstance(notes_sha256, str | None):
            raise ValueError("holds no number or no checksum")
    except (FileError, ValueError, KeyError) as error:
        damaged.append(Damage(path.name, None, str(error), "not used"))
        return 0, None
    return number, notes_sha256


def _is_time(text: str) -> bool:
    try:
        return datetime.fromisoformat(text).tzinfo is not None
    except ValueError:
        return False
