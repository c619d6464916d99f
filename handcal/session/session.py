"""A session: one folder with all data of one calibration, readable after any crash.

::

    NAME/journal.jsonl     the events, one JSON object per line; the only file appended to
         journal.end       the number of the last event, written when the session is closed
         rig.yaml          the rig at the time
         settings.json     the settings at the time
         alignments/1.npz  clouds and poses of each alignment; its number never changes
         results.json      the newest results, if there are any
         notes.txt         the notes, if there are any

The journal decides what exists: an alignment exists once the journal contains it with its checksum,
until the journal records its deletion. The folder is therefore consistent at every moment, and a
killed program loses at most the line it was writing. The journal also holds the rig, the settings
and the results, and the checksum of the notes: it decides what is right where a file differs.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from typing import Any, Literal, Self

from numpy.typing import ArrayLike

from handcal.core.display import as_shifts
from handcal.core.errors import FileError
from handcal.core.types import Alignment, Eye, Rig
from handcal.io.closable import Closable
from handcal.io.files import (
    make_folder,
    read_limited,
    refuse_links,
    remove_leftovers,
    sync_folder,
    write_atomic,
    write_json,
    write_new,
)
from handcal.io.lock import FileLock
from handcal.io.resources import resource_path
from handcal.rig.rig_file import MAX_RIG_BYTES, write_rig
from handcal.session.alignment_file import encode_alignment
from handcal.session.in_force import end_at_close
from handcal.session.journal import JOURNAL, Event, JournalWriter, happens_now, journal_line
from handcal.session.record import MAX_ALIGNMENT_BYTES as MAX_ALIGNMENT_BYTES
from handcal.session.record import MAX_NOTES_CHARACTERS as MAX_NOTES_CHARACTERS
from handcal.session.record import SessionRecord as SessionRecord
from handcal.session.record import alignment_path, load_session, sha256
from handcal.session.state import (
    AlignmentFacts,
    Kind,
    SessionEvent,
    SessionFacts,
    clean_wearer,
    facts_json,
    with_facts,
)
from handcal.session.trial import COMPARED, Comparison, Trial, comparison_json, trial_json


class Session(Closable):
    """Writes to an existing session folder; no other program can write to it until `close`.

    It holds the session's state, which is read from disk once and then follows each event. An event
    of the procedure is in `contents` at once: an alignment, facts, results, φ. If it cannot be
    written, the method raises FileError, and the event is written before the next one, or by
    `write_waiting`. All other methods have no effect if they raise, except that `save_notes` may
    have announced notes that it could not write. When a method returns, its data are on disk.
    `create` starts a new folder; `open` only reads one.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    path : Path

    Raises
    ------
    FileError
        If another program is writing to the session, or `open` fails.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._journal: JournalWriter | None = None
        self._lock = FileLock(path / "lock")
        try:
            self._loaded = load_session(path)
            refuse_links(path / "alignments", path)
            for folder in (path, path / "alignments"):
                if folder.is_dir():
                    remove_leftovers(folder)
            self._journal = JournalWriter(path / JOURNAL, self._loaded.journal)
        except BaseException:
            self.close()
            raise
        self._state = self._loaded.state
        self._next_number = self._journal.next_number
        self._waiting: deque[Callable[[], object]] = deque()
        self._is_changed = False
        self._contents: SessionRecord | None = None

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
            path.mkdir(mode=0o700)  # and so no file in it, with names and hands, is for others
            (path / "alignments").mkdir(mode=0o700)
            sync_folder(path.parent)
        except OSError as error:
            raise FileError(f"cannot create {path}: {error.strerror or error}") from error
        write_rig(path / "rig.yaml", rig)
        write_json(path / "settings.json", dict(settings))
        # The journal is written last: without it, the folder is not a session.
        created = {"rig": _rig_text(path), "settings": dict(settings), "wearer": wearer}
        first = journal_line(happens_now(1, SessionEvent.CREATED, created))
        write_atomic(path / JOURNAL, first)
        return cls(path)

    @staticmethod
    def open(path: Path, rig: Rig | None = None) -> SessionRecord:
        """Read a session, which may be in use or left behind by a crash.

        Parameters
        ----------
        path : Path
        rig : Rig, optional
            Used in place of the stored one.

        Returns
        -------
        SessionRecord
            Without damaged parts, which are listed in `damaged`.

        Raises
        ------
        FileError
            If the folder is not a session, is of another version, no line of its journal is sound,
            or the rig is lost: its file and the journal's first line.
        """
        return load_session(path, rig).contents()

    @property
    def contents(self) -> SessionRecord:
        """The session as it is now; the same object until it changes."""
        if self._contents is None:
            journal = self._require_open()
            record = self._loaded.contents(self._next_number - journal.next_number)
            self._contents = replace(record, journal_bytes=journal.complete_bytes, torn_bytes=0)
        return self._contents

    def require_room(self, kind: Kind) -> None:
        """Raise FileError if no further alignment or trial can be saved."""
        try:
            self._state.items(kind).next_number()
        except ValueError as error:
            raise FileError(f"{self.path} is full: {error}", "start another session") from error

    def record(self, event: str, **data: Any) -> None:
        """Append an event of the procedure with JSON-able data to the journal.

        Raises
        ------
        FileError
            If the journal cannot be written or is full.
        ValueError
            If the data contain NaN, or the event is one of `SessionEvent`.
        """
        if event in set(SessionEvent):
            raise ValueError(f"the event {event} is written by the session itself")
        self._keep(event, data)

    def save_alignment(self, alignment: Alignment, facts: AlignmentFacts | None = None) -> int:
        """Save an alignment with its circumstances; return its number, from 1.

        Raises
        ------
        FileError
            If it cannot be written.
        ValueError
            If it is too large, or the session is full.
        """
        number = self._state.alignments.next_number()
        data = encode_alignment(alignment)
        if len(data) > MAX_ALIGNMENT_BYTES:
            raise ValueError(f"an alignment of {len(data):,} bytes is too large to be saved")
        known = {} if facts is None else {"facts": facts_json(facts)}
        saved = {"number": number, "sha256": sha256(data), **known}
        self._loaded.alignments[number] = alignment
        file = alignment_path(self.path, number)
        self._keep(SessionEvent.ALIGNMENT_SAVED, saved, before=lambda: write_new(file, data))
        return number

    def save_trial(self, trial: Trial) -> int:
        """Save a trial of the user test with the current time; return its number, from 1.

        Raises
        ------
        FileError
            If the journal cannot be written, or the session is full.
        """
        self.require_room("trial")
        number = self._state.trials.next_number()
        self._write(SessionEvent.TRIAL_SAVED, {"number": number, "trial": trial_json(trial)})
        return number

    def save_comparison(self, comparison: Comparison) -> None:
        """Save the answer of a blinded comparison; FileError if it cannot be written."""
        self._write(COMPARED, comparison_json(comparison))

    def delete(self, kind: Kind, number: int) -> None:
        """Mark an alignment or a trial as deleted; with an alignment, the results are discarded.

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
        data = dict(results)
        file = self.path / "results.json"

        def replace_file() -> None:
            write_json(file, data)
            self._is_sound_again(file)

        self._keep(SessionEvent.SOLVED, data, after=replace_file)

    def save_applied(self, shifts_m: Mapping[Eye, ArrayLike]) -> None:
        """Record that the headset renders with the solved φ.

        Raises
        ------
        FileError
            If the journal cannot be written.
        ValueError
            If a φ is not three finite numbers.
        """
        self._keep(SessionEvent.APPLIED, {"eyes": list(shifts_m), "shift_m": _lists(shifts_m)})

    def save_fine_tuned(self, shifts_m: Mapping[Eye, ArrayLike]) -> None:
        """Record that the headset renders with φ set by hand; raises as `save_applied`."""
        self._keep(SessionEvent.FINE_TUNED, {"shift_m": _lists(shifts_m)})

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
        data = text.encode(errors="replace")
        before = self._loaded.notes_sha256
        # Announced first: a crash leaves notes with the one or the other checksum.
        self._write(SessionEvent.NOTES_SAVED, {"sha256": sha256(data), "before_sha256": before})
        write_atomic(file := self.path / "notes.txt", data)
        self._is_sound_again(file)
        self._loaded.notes, self._loaded.notes_sha256 = data.decode(), sha256(data)
        self._contents = None

    def correct_wearer(self, name: str) -> None:
        """Replace the wearer's name or code; ValueError if it is invalid, else as `save_notes`."""
        data = {"wearer": clean_wearer(name), "before": self._state.wearer}
        if data["wearer"] != data["before"]:
            self._write(SessionEvent.WEARER_CORRECTED, data)

    def save_facts(self, **facts: Any) -> None:
        """Record facts by their names in `SessionFacts`; each replaces an earlier one.

        The results are discarded if the eye distance, the usable eyes or a verification change.
        FileError if the journal cannot be written; ValueError if a name is unknown or a value
        invalid.
        """
        data = facts_json(facts)
        with_facts(SessionFacts(), data)
        self._keep(SessionEvent.FACTS_SAVED, data, after=self._remove_old_results)

    def finish(self) -> None:
        """Record the end of the session; FileError if the journal cannot be written.

        Any later event reopens the session, except those in `ASIDE`.
        """
        self._write(SessionEvent.FINISHED, {})

    def write_waiting(self) -> None:
        """Write what could not be written before; FileError if it still cannot be."""
        while self._waiting:
            self._require_own()
            self._waiting[0]()
            self._waiting.popleft()
            self._contents = None

    def close(self) -> None:
        """Release the session for other programs; safe to call twice."""
        if self._journal is not None:
            with suppress(FileError):  # the folder was removed, or the disk is full
                self.write_waiting()
            if self._is_changed:
                with suppress(FileError):
                    self._require_own().write_end(self._loaded.notes_sha256)
            self._contents = self.contents
            end_at_close(self.path)
        self._journal = None
        self._lock.release()

    def _change(self, kind: Kind, what: Literal["deleted", "restored"], number: int) -> None:
        event, data = SessionEvent(f"{kind}_{what}"), {"number": number}
        if kind == "trial":
            self._write(event, data)
        else:
            self._keep(event, data, after=self._remove_old_results)

    def _remove_old_results(self) -> None:
        if self._state.results is None:
            with suppress(OSError):  # the journal says so already
                (self.path / "results.json").unlink(missing_ok=True)

    def _write(self, event: str, data: dict[str, Any]) -> None:
        """Write an event, and only then apply it; nothing changes if it cannot be written."""
        self.write_waiting()
        made = happens_now(self._next_number, event, data)
        self._require_own().append(journal_line(made))
        self._apply(made)

    def _keep(
        self,
        event: str,
        data: dict[str, Any],
        before: Callable[[], object] | None = None,
        after: Callable[[], object] | None = None,
    ) -> None:
        """Apply an event and write it, now or later, between two other writes."""
        journal = self._require_open()
        made = happens_now(self._next_number, event, data)
        line = journal_line(made)  # ValueError before anything is changed
        self._apply(made)
        if before is not None:
            self._waiting.append(before)
        self._waiting.append(lambda: journal.append(line))
        if after is not None:
            self._waiting.append(after)
        self.write_waiting()

    def _is_sound_again(self, file: Path) -> None:
        """Forget the damage of a file that was replaced."""
        damaged = self._loaded.damaged
        self._loaded.damaged = tuple(part for part in damaged if part.file != file.name)

    def _apply(self, event: Event) -> None:
        self._state.apply(event)
        self._loaded.events.append(event)
        self._next_number += 1
        self._is_changed = True
        self._contents = None

    def _require_open(self) -> JournalWriter:
        if self._journal is None:
            raise FileError(f"{self.path} is closed", "open the session again")
        return self._journal

    def _require_own(self) -> JournalWriter:
        """Return the journal; FileError if another program may be writing to it."""
        journal = self._require_open()
        refuse_links(self.path / "alignments", self.path)
        self._lock.require_held()
        journal.require_unchanged()
        return journal


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
        Rig, settings, alignments, trials of the user test, notes and events, without
        damaged parts, which `damaged` lists.

    Raises
    ------
    FileError
        If the folder is not a session, is of another version, or nothing in it can be read.

    Examples
    --------
    >>> import handcal
    >>> session = handcal.open_session(handcal.example_session().path)
    >>> session.wearer, len(session.alignments), len(session.trials)
    ('Simulated wearer', 2, 6)
    """
    return Session.open(Path(path))


def example_session() -> SessionRecord:
    """Return the session shipped with handcal: a simulated wearer with two alignments and trials.

    Examples
    --------
    >>> import handcal
    >>> handcal.example_session().wearer
    'Simulated wearer'
    """
    return open_session(resource_path("example_session"))


def _rig_text(path: Path) -> str:
    return read_limited(path / "rig.yaml", MAX_RIG_BYTES).decode()


def _lists(shifts_m: Mapping[Eye, ArrayLike]) -> dict[Eye, list[float]]:
    return {eye: shift_m.tolist() for eye, shift_m in as_shifts(shifts_m).items()}
