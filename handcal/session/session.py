"""A session: one folder with all data of one calibration, readable after any crash.

::

    NAME/journal.jsonl     the events, one JSON object per line; the only file appended to
         rig.yaml          the rig at the time
         settings.json     the settings at the time
         alignments/1.npz  clouds and poses of each alignment; its number never changes
         results.json      the newest results, if there are any
         notes.txt         the notes, if there are any

The journal decides what exists: an alignment exists once the journal contains it with its checksum,
until the journal records its deletion. The folder is therefore consistent at every moment, and a
killed program loses at most the line it was writing.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, Self

from numpy.typing import ArrayLike

from handcal.display import as_shifts
from handcal.errors import FileError
from handcal.io.closable import Closable
from handcal.io.files import make_folder, read_json, read_limited, write_atomic, write_json
from handcal.io.lock import FileLock
from handcal.rig.rig_file import MAX_RIG_BYTES, read_rig, write_rig
from handcal.session.alignment_file import decode_alignment, encode_alignment
from handcal.session.journal import (
    Event,
    JournalContent,
    JournalWriter,
    happens_now,
    journal_line,
    read_journal,
)
from handcal.session.state import Kind, SessionEvent, SessionState, clean_wearer
from handcal.session.trial import Trial, trial_json
from handcal.types import Alignment, Eye, Float64, Rig

MAX_ALIGNMENT_BYTES = 16 * 2**20
MAX_NOTES_CHARACTERS = 20_000


@dataclass(frozen=True, slots=True, eq=False)
class SessionRecord:
    """The contents of a session folder."""

    path: Path
    rig: Rig
    settings: dict[str, Any]
    wearer: str
    """Name or code; empty if none was given."""
    notes: str
    events: tuple[Event, ...]
    alignments: Mapping[int, Alignment]
    """The alignments that are not deleted, by number, in the order in which they were saved."""
    deleted_alignments: Mapping[int, Alignment]
    trials: Mapping[int, Trial]
    deleted_trials: Mapping[int, Trial]
    """Trials of the user test, likewise."""
    results: dict[str, Any] | None
    """The newest results; None if none were saved since an alignment was deleted or restored."""
    is_solved: bool
    """True if the results are those of all `alignments`."""
    is_applied: bool
    """True if the headset has acknowledged the projections of these results."""
    applied_shift_m: Mapping[Eye, Float64]
    """each (3,); the φ that the headset rendered with last, solved or set by hand; a missing eye
    was rendered with the offline calibration."""
    fine_tuned: Mapping[Eye, Float64] | None
    """each (3,); the φ last set by hand; None if none was set since the last results."""
    is_finished: bool
    """True if the session was finished, and nothing was recorded since."""
    journal_bytes: int
    """Length of the journal's complete lines."""
    torn_bytes: int
    """Length of an incomplete last line, which is ignored; 0 if there is none."""

    def __repr__(self) -> str:
        counts = f"{len(self.alignments)} alignments, {len(self.trials)} trials"
        return f"<SessionRecord {self.path}: {counts}>"


class Session(Closable):
    """Writes to an existing session folder; no other program can write to it until `close`.

    Data are on disk when a method returns; if it raises FileError, everything written before is
    kept. `create` starts a new folder; `open` only reads one.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    path : Path
    revision : int
        Increases with every write.

    Raises
    ------
    FileError
        If another program is writing to the session, or `open` fails.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.revision = 0
        self._lock = FileLock(path / "lock")
        try:
            record = self.open(path)
        except BaseException:
            self.close()
            raise
        self._state = _replay(path, record.events)
        self._journal = JournalWriter(
            path / "journal.jsonl",
            JournalContent(record.events, record.journal_bytes, record.torn_bytes),
        )

    @classmethod
    def create(
        cls,
        parent: Path,
        rig: Rig,
        settings: Mapping[str, Any],
        name: str | None = None,
        wearer: str = "",
    ) -> Self:
        """Create a session in a new folder.

        Parameters
        ----------
        parent : Path
            Created if needed.
        rig : Rig
        settings : mapping
            JSON-able.
        name : str, optional
            Name of the folder; default: the time in UTC.
        wearer : str
            Name or code, one line of at most 100 characters.

        Raises
        ------
        FileError
            If the folder exists already or cannot be written.
        ValueError
            If the rig is implausible, the settings contain NaN, or the wearer's name is invalid.
        """
        wearer = clean_wearer(wearer)
        path = make_folder(parent) / (name or f"{datetime.now(UTC):session-%Y%m%d-%H%M%S-%f}")
        try:
            path.mkdir()
            (path / "alignments").mkdir()
        except OSError as error:
            raise FileError(f"cannot create {path}: {error.strerror or error}") from error
        write_rig(path / "rig.yaml", rig)
        write_json(path / "settings.json", dict(settings))
        # The journal is written last: without it, the folder is not a session.
        created = {"rig_sha256": _sha256(_rig_bytes(path)), "wearer": wearer}
        first = journal_line(happens_now(1, SessionEvent.CREATED, created))
        write_atomic(path / "journal.jsonl", first)
        return cls(path)

    @staticmethod
    def open(path: Path, before: SessionRecord | None = None) -> SessionRecord:
        """Read a session, which may be in use or left behind by a crash.

        Parameters
        ----------
        path : Path
        before : SessionRecord, optional
            An earlier record of it; its alignments, which never change, are not read again.

        Raises
        ------
        FileError
            If the folder is not a session, is of an unknown version, or a file in it is missing,
            damaged or too large.
        """
        if not (path / "journal.jsonl").is_file():
            raise FileError(
                f"{path} is not a session; choose the folder that contains journal.jsonl"
            )
        journal = read_journal(path / "journal.jsonl")
        state = _replay(path, journal.events)
        if state.rig_sha256 != _sha256(_rig_bytes(path)):
            raise FileError(f"{path / 'rig.yaml'} is damaged: its checksum is not the journal's")
        known = {**before.alignments, **before.deleted_alignments} if before else {}
        results, notes = path / "results.json", path / "notes.txt"
        return SessionRecord(
            path=path,
            rig=read_rig(path / "rig.yaml"),
            settings=read_json(path / "settings.json"),
            wearer=state.wearer,
            notes=_read_notes(notes) if notes.exists() else "",
            events=journal.events,
            alignments=_read_alignments(path, state.alignments.active, known),
            deleted_alignments=_read_alignments(path, state.alignments.deleted, known),
            trials=MappingProxyType(state.trials.active),
            deleted_trials=MappingProxyType(state.trials.deleted),
            results=read_json(results) if results.exists() else None,
            is_solved=state.is_solved and results.exists(),
            is_applied=state.is_applied and results.exists(),
            applied_shift_m=MappingProxyType(state.applied_shift_m),
            fine_tuned=state.fine_tuned and MappingProxyType(state.fine_tuned),
            is_finished=state.is_finished,
            journal_bytes=journal.complete_bytes,
            torn_bytes=journal.torn_bytes,
        )

    def record(self, event: str, **data: Any) -> None:
        """Append an event with JSON-able data to the journal.

        Raises
        ------
        FileError
            If the journal cannot be written or is full.
        ValueError
            If the data contain NaN, or the event is one of `SessionEvent`.
        """
        if event in set(SessionEvent):
            raise ValueError(f"the event {event} is written by the session itself")
        self._append(event, data)

    def save_alignment(self, alignment: Alignment) -> int:
        """Save an alignment and return its number, from 1.

        Raises
        ------
        FileError
            If it cannot be written, is too large, or the session is full.
        """
        number = self._next_number("alignment")
        data = encode_alignment(alignment)
        if len(data) > MAX_ALIGNMENT_BYTES:
            raise FileError(f"an alignment of {len(data):,} bytes is too large to be saved")
        write_atomic(_alignment_path(self.path, number), data)
        self._append(SessionEvent.ALIGNMENT_SAVED, {"number": number, "sha256": _sha256(data)})
        return number

    def save_trial(self, trial: Trial) -> int:
        """Save a trial of the user test with the current time; return its number, from 1.

        Raises
        ------
        FileError
            If the journal cannot be written, or the session is full.
        """
        number = self._next_number("trial")
        self._append(SessionEvent.TRIAL_SAVED, {"number": number, "trial": trial_json(trial)})
        return number

    def delete(self, kind: Kind, number: int) -> None:
        """Mark an alignment or a trial as deleted; results go with an alignment.

        Raises
        ------
        FileError
            If the folder cannot be written.
        ValueError
            If there is none of this number.
        """
        self._state.items(kind).require_active(number)
        self._change(kind, "deleted", number)

    def restore(self, kind: Kind, number: int) -> None:
        """Restore a deleted alignment or trial; raises and removes results as `delete`."""
        self._state.items(kind).require_deleted(number)
        self._change(kind, "restored", number)

    def save_results(self, results: Mapping[str, Any]) -> None:
        """Replace the results of all alignments; FileError if they cannot be written."""
        write_json(self.path / "results.json", dict(results))
        self._append(SessionEvent.SOLVED, dict(results))

    def save_applied(self, shifts_m: Mapping[Eye, ArrayLike]) -> None:
        """Record that the headset renders with the solved φ.

        Raises
        ------
        FileError
            If the journal cannot be written.
        ValueError
            If a φ is not three finite numbers.
        """
        self._append(SessionEvent.APPLIED, {"eyes": list(shifts_m), "shift_m": _lists(shifts_m)})

    def save_fine_tuned(self, shifts_m: Mapping[Eye, ArrayLike]) -> None:
        """Record that the headset renders with φ set by hand; raises as `save_applied`."""
        self._append(SessionEvent.FINE_TUNED, {"shift_m": _lists(shifts_m)})

    def save_notes(self, text: str) -> None:
        """Replace the notes.

        Raises
        ------
        FileError
            If they cannot be written.
        ValueError
            If they are longer than 20,000 characters.
        """
        if len(text) > MAX_NOTES_CHARACTERS:
            raise ValueError(f"notes may have at most {MAX_NOTES_CHARACTERS:,} characters")
        write_atomic(self.path / "notes.txt", text.encode(errors="replace"))
        self.revision += 1

    def finish(self) -> None:
        """Record the end of the session; FileError if the journal cannot be written.

        Anything recorded afterwards makes the session unfinished again.
        """
        self._append(SessionEvent.FINISHED, {})

    def close(self) -> None:
        """Release the session for other programs; safe to call twice."""
        self._lock.release()

    def _next_number(self, kind: Kind) -> int:
        try:
            return self._state.items(kind).next_number()
        except ValueError as error:
            raise FileError(f"{self.path} is full: {error}; start another session") from error

    def _change(self, kind: Kind, what: Literal["deleted", "restored"], number: int) -> None:
        if kind == "alignment":  # the results are those of other alignments
            results = self.path / "results.json"
            try:
                results.unlink(missing_ok=True)
            except OSError as error:
                raise FileError(f"cannot remove {results}: {error.strerror or error}") from error
        self._append(SessionEvent(f"{kind}_{what}"), {"number": number})

    def _append(self, event: str, data: dict[str, Any]) -> None:
        self._state.apply(self._journal.append(event, data))
        self.revision += 1


def open_session(path: str | PathLike[str]) -> SessionRecord:
    """Read a session folder; nothing in it changes.

    Parameters
    ----------
    path : path
        The folder that holds the session's ``journal.jsonl``, or a copy of it; the session may be
        in use, or left by a killed program.

    Returns
    -------
    SessionRecord
        Rig, settings, alignments, trials of the user test, notes and events.

    Raises
    ------
    FileError
        If the folder is not a session, is of an unknown version, or a file in it is missing,
        damaged or too large.

    Examples
    --------
    >>> import handcal
    >>> session = handcal.open_session("resources/example_session")
    >>> session.wearer, len(session.alignments), len(session.trials)
    ('Simulated wearer', 2, 6)
    """
    return Session.open(Path(path))


def _replay(path: Path, events: Sequence[Event]) -> SessionState:
    """Return the state after all events; FileError if they are inconsistent."""
    journal = path / "journal.jsonl"
    if not events or events[0].name != SessionEvent.CREATED:
        raise FileError(f"{journal} does not begin as the journal of a session")
    state = SessionState()
    for event in events:
        try:
            state.apply(event)
        except ValueError as error:
            raise FileError(f"{journal}: line {event.number}: {error}") from error
    return state


def _read_alignments(
    path: Path, checksums: Mapping[int, str], known: Mapping[int, Alignment]
) -> Mapping[int, Alignment]:
    return MappingProxyType(
        {
            number: known.get(number) or _read_alignment(_alignment_path(path, number), sha256)
            for number, sha256 in checksums.items()
        }
    )


def _read_alignment(path: Path, sha256: str) -> Alignment:
    data = read_limited(path, MAX_ALIGNMENT_BYTES)
    if _sha256(data) != sha256:
        raise FileError(f"{path} is damaged: its checksum is not the journal's")
    try:
        return decode_alignment(data)
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error


def _read_notes(path: Path) -> str:
    return read_limited(path, 4 * MAX_NOTES_CHARACTERS).decode(errors="replace")


def _lists(shifts_m: Mapping[Eye, ArrayLike]) -> dict[Eye, list[float]]:
    return {eye: shift_m.tolist() for eye, shift_m in as_shifts(shifts_m).items()}


def _alignment_path(path: Path, number: int) -> Path:
    return path / "alignments" / f"{number}.npz"


def _rig_bytes(path: Path) -> bytes:
    return read_limited(path / "rig.yaml", MAX_RIG_BYTES)


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
