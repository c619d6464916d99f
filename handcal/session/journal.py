"""The journal of a session: an append-only file, one JSON object per line, safe after a crash."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from handcal.errors import FileError
from handcal.io.files import read_limited

JOURNAL_VERSION = 2
"""Version 2 added deletion and restoring, trials and fine-tuning; version 1 can be read too."""

MAX_JOURNAL_BYTES = 64 * 2**20


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
class JournalContent:
    """The contents of a journal."""

    events: tuple[Event, ...]
    complete_bytes: int
    """Length of the complete lines."""
    torn_bytes: int
    """Length of an incomplete last line, which is ignored; 0 if there is none."""


def happens_now(number: int, name: str, data: dict[str, Any]) -> Event:
    """Return an event with the current time."""
    return Event(number, datetime.now(UTC).isoformat(), name, data)


def journal_line(event: Event) -> bytes:
    """Return an event as a line; ValueError if its data contain NaN."""
    fields = {
        "version": JOURNAL_VERSION,
        "number": event.number,
        "time": event.time,
        "event": event.name,
        "data": event.data,
    }
    return json.dumps(fields, allow_nan=False).encode() + b"\n"


def read_journal(path: Path) -> JournalContent:
    """Read a journal.

    Raises
    ------
    FileError
        If it cannot be read, is too large or of an unknown version, or a complete line is damaged.
    """
    content = read_limited(path, MAX_JOURNAL_BYTES)
    *lines, torn = content.split(b"\n")
    try:
        events = tuple(_parse_line(number, line) for number, line in enumerate(lines, 1))
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error
    return JournalContent(events, len(content) - len(torn), len(torn))


class JournalWriter:
    """Appends to a journal that no other program writes to.

    Parameters
    ----------
    path : Path
    content : JournalContent
        Its present contents; an incomplete last line is removed by the next write.
    """

    def __init__(self, path: Path, content: JournalContent) -> None:
        self._path = path
        self._events = len(content.events)
        self._bytes = content.complete_bytes

    def append(self, name: str, data: dict[str, Any]) -> Event:
        """Append an event with the current time, sync it to disk, and return it.

        Raises
        ------
        FileError
            If the journal cannot be written or is full; its contents are kept.
        ValueError
            If the data contain NaN.
        """
        event = happens_now(self._events + 1, name, data)
        line = journal_line(event)
        if self._bytes + len(line) > MAX_JOURNAL_BYTES:
            raise FileError(f"the journal of {self._path.parent} is full; start another session")
        try:
            # Reopened each time, so that a folder that was moved or removed is noticed.
            with self._path.open("r+b") as file:
                file.seek(self._bytes)
                file.truncate()  # a failed or killed write may have left part of a line
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise FileError(f"cannot write {self._path}: {error.strerror or error}") from error
        self._bytes += len(line)
        self._events += 1
        return event


def _parse_line(number: int, line: bytes) -> Event:
    try:
        fields = json.loads(line)
        version, event = fields["version"], fields["event"]
        time, data = fields["time"], fields["data"]
        found = fields["number"]
    except (ValueError, RecursionError, KeyError, TypeError) as error:
        raise ValueError(f"line {number} is not an event of a session") from error
    if version not in (1, JOURNAL_VERSION):
        raise ValueError(f"session version {version} is not {JOURNAL_VERSION} or 1, those known")
    kinds = isinstance(event, str), isinstance(time, str), isinstance(data, dict)
    if found != number or not all(kinds) or not _is_time(time):
        raise ValueError(f"line {number} is not the event expected there")
    return Event(number, time, event, data)


def _is_time(text: str) -> bool:
    try:
        return datetime.fromisoformat(text).tzinfo is not None
    except ValueError:
        return False
