"""A session: one folder that holds everything about one calibration, readable after any crash.

::

    NAME/journal.jsonl     what happened, one JSON object a line; the only file appended to
         rig.yaml          the rig as it was
         settings.json     the settings as they were
         alignments/1.npz  the clouds and poses of each alignment
         results.json      the newest results, if there are any

An alignment exists from when the journal names it with its checksum until the journal says that it
was dropped, so the folder is consistent at every moment and a killed program costs at most the line
that it was writing.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from handcal.alignment_file import decode_alignment, encode_alignment
from handcal.closable import Closable
from handcal.errors import FileError
from handcal.files import make_folder, read_json, read_limited, write_atomic, write_json
from handcal.lock import FileLock
from handcal.rig.rig_file import MAX_RIG_BYTES, read_rig, write_rig
from handcal.types import Alignment, Rig

SESSION_VERSION = 1
MAX_JOURNAL_BYTES = 64 * 2**20
MAX_ALIGNMENT_BYTES = 16 * 2**20
MAX_ALIGNMENTS = 100

_CREATED = "created"
_ALIGNMENT = "alignment_saved"
_DROPPED = "alignment_dropped"


@dataclass(frozen=True, slots=True)
class Event:
    """One line of the journal.

    Attributes
    ----------
    number : int
        Running number from 1.
    time : str
        UTC, ISO 8601.
    name : str
    data : dict
    """

    number: int
    time: str
    name: str
    data: dict[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class SessionRecord:
    """What a session folder holds.

    Attributes
    ----------
    path : Path
    rig : Rig
    settings : dict
    events : tuple of Event
    alignments : tuple of Alignment
        Those not dropped.
    results : dict or None
        None if none were saved since the last drop.
    journal_bytes : int
        Length of the journal's complete lines.
    torn_bytes : int
        Length of an unfinished last line, which is left out; 0 if there is none.
    """

    path: Path
    rig: Rig
    settings: dict[str, Any]
    events: tuple[Event, ...]
    alignments: tuple[Alignment, ...]
    results: dict[str, Any] | None
    journal_bytes: int
    torn_bytes: int


class Session(Closable):
    """Writes to an existing session folder, which no other program can write to until `close`.

    Whatever a method writes is on the disk when it returns; if it raises FileError, all that was
    written before is still there. `create` starts a new folder; `open` only reads one.

    Parameters
    ----------
    path : Path

    Raises
    ------
    FileError
        If another program is writing to the session, or `open` would refuse it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = FileLock(path / "lock")
        try:
            record = self.open(path)
        except BaseException:
            self.close()
            raise
        self._events = len(record.events)
        self._alignments = len(record.alignments)
        self._journal_bytes = record.journal_bytes

    @classmethod
    def create(
        cls, parent: Path, rig: Rig, settings: Mapping[str, Any], name: str | None = None
    ) -> Self:
        """Start a session in a new folder.

        Parameters
        ----------
        parent : Path
            Created if needed.
        rig : Rig
        settings : mapping
            JSON-able.
        name : str, optional
            Name of the folder; by default the time in UTC.

        Raises
        ------
        FileError
            If the folder exists already or cannot be written.
        ValueError
            If the rig is implausible or the settings hold NaN.
        """
        path = make_folder(parent) / (name or f"{datetime.now(UTC):session-%Y%m%d-%H%M%S-%f}")
        try:
            path.mkdir()
            (path / "alignments").mkdir()
        except OSError as error:
            raise FileError(f"cannot create {path}: {error.strerror or error}") from error
        write_rig(path / "rig.yaml", rig)
        write_json(path / "settings.json", dict(settings))
        # The journal comes last: without it, the folder is no session.
        line = _journal_line(1, _CREATED, {"rig_sha256": _sha256(_rig_bytes(path))})
        write_atomic(path / "journal.jsonl", line)
        return cls(path)

    @staticmethod
    def open(path: Path) -> SessionRecord:
        """Read a session, which may be in use, killed or damaged.

        Raises
        ------
        FileError
            If the folder is not a session, is of an unknown version, or a file in it is missing,
            damaged or too large.
        """
        events, journal_bytes, torn_bytes = _read_journal(path / "journal.jsonl")
        if events[0].data.get("rig_sha256") != _sha256(_rig_bytes(path)):
            raise FileError(f"{path / 'rig.yaml'} is damaged: its checksum is not the journal's")
        saved: list[Event] = []
        for event in events:
            if event.name == _ALIGNMENT:
                saved.append(event)
            elif event.name == _DROPPED:
                del saved[-1:]
        if len(saved) > MAX_ALIGNMENTS:
            raise FileError(f"{path} holds more than {MAX_ALIGNMENTS} alignments")
        results = path / "results.json"
        return SessionRecord(
            path=path,
            rig=read_rig(path / "rig.yaml"),
            settings=read_json(path / "settings.json"),
            events=tuple(events),
            alignments=tuple(
                _read_alignment(_alignment_path(path, number), event.data.get("sha256"))
                for number, event in enumerate(saved, 1)
            ),
            results=read_json(results) if results.exists() else None,
            journal_bytes=journal_bytes,
            torn_bytes=torn_bytes,
        )

    def record(self, event: str, **data: Any) -> None:
        """Append an event with JSON-able data to the journal.

        Raises
        ------
        FileError
            If the journal cannot be written or is full.
        ValueError
            If the data hold NaN, or the event's name is one that the session itself writes.
        """
        if event in (_CREATED, _ALIGNMENT, _DROPPED):
            raise ValueError(f"the event {event} is written by the session itself")
        self._append(event, data)

    def save_alignment(self, alignment: Alignment) -> int:
        """Store an alignment and return its number, from 1.

        Raises
        ------
        FileError
            If it cannot be written, is too large, or the session holds too many.
        """
        number = self._alignments + 1
        if number > MAX_ALIGNMENTS:
            raise FileError(f"{self.path} is full with {MAX_ALIGNMENTS} alignments; start another")
        data = encode_alignment(alignment)
        if len(data) > MAX_ALIGNMENT_BYTES:
            raise FileError(f"an alignment of {len(data):,} bytes is too large to be saved")
        write_atomic(_alignment_path(self.path, number), data)
        self._append(_ALIGNMENT, {"number": number, "sha256": _sha256(data)})
        self._alignments = number
        return number

    def drop_alignment(self) -> None:
        """Leave out the last alignment, and the results with it; the next takes its number.

        Raises
        ------
        FileError
            If the folder cannot be written.
        ValueError
            If there is none.
        """
        if not self._alignments:
            raise ValueError("there is no alignment to drop")
        results = self.path / "results.json"
        try:
            results.unlink(missing_ok=True)
        except OSError as error:
            raise FileError(f"cannot remove {results}: {error.strerror or error}") from error
        self._append(_DROPPED, {"number": self._alignments})
        self._alignments -= 1

    def save_results(self, results: Mapping[str, Any]) -> None:
        """Replace the results, which must be JSON-able; FileError if they cannot be written."""
        write_json(self.path / "results.json", dict(results))

    def close(self) -> None:
        """Let other programs write to the session; safe to call twice."""
        self._lock.release()

    def _append(self, event: str, data: dict[str, Any]) -> None:
        line = _journal_line(self._events + 1, event, data)
        if self._journal_bytes + len(line) > MAX_JOURNAL_BYTES:
            raise FileError(f"the journal of {self.path} is full; start another session")
        path = self.path / "journal.jsonl"
        try:
            # Opened anew each time, so that a folder that has gone is noticed.
            with path.open("r+b") as file:
                file.seek(self._journal_bytes)
                file.truncate()  # what a failed or killed write may have left
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise FileError(f"cannot write {path}: {error.strerror or error}") from error
        self._journal_bytes += len(line)
        self._events += 1


def _journal_line(number: int, event: str, data: dict[str, Any]) -> bytes:
    fields = {
        "version": SESSION_VERSION,
        "number": number,
        "time": datetime.now(UTC).isoformat(),
        "event": event,
        "data": data,
    }
    return json.dumps(fields, allow_nan=False).encode() + b"\n"


def _read_journal(path: Path) -> tuple[list[Event], int, int]:
    """Return the events, and the length of the complete lines and of the unfinished last one."""
    content = read_limited(path, MAX_JOURNAL_BYTES)
    *lines, torn = content.split(b"\n")
    try:
        events = [_parse_line(number, line) for number, line in enumerate(lines, 1)]
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error
    if not events or events[0].name != _CREATED:
        raise FileError(f"{path} does not begin as the journal of a session")
    return events, len(content) - len(torn), len(torn)


def _parse_line(number: int, line: bytes) -> Event:
    try:
        fields = json.loads(line)
        version, event = fields["version"], fields["event"]
        time, data = fields["time"], fields["data"]
        found = fields["number"]
    except (ValueError, RecursionError, KeyError, TypeError) as error:
        raise ValueError(f"line {number} is not an event of a session") from error
    if version != SESSION_VERSION:
        raise ValueError(f"session version {version} is not {SESSION_VERSION}, the one known")
    kinds = isinstance(event, str), isinstance(time, str), isinstance(data, dict)
    if found != number or not all(kinds):
        raise ValueError(f"line {number} is not the event expected there")
    return Event(number, time, event, data)


def _read_alignment(path: Path, sha256: object) -> Alignment:
    data = read_limited(path, MAX_ALIGNMENT_BYTES)
    if _sha256(data) != sha256:
        raise FileError(f"{path} is damaged: its checksum is not the journal's")
    try:
        return decode_alignment(data)
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error


def _alignment_path(path: Path, number: int) -> Path:
    return path / "alignments" / f"{number}.npz"


def _rig_bytes(path: Path) -> bytes:
    return read_limited(path / "rig.yaml", MAX_RIG_BYTES)


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
