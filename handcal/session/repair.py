"""Checking a session for damage, and copying what is sound into a new one."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Literal, TypeAlias

from handcal.core.errors import FileError, HandError
from handcal.core.progress import Progress
from handcal.core.types import Rig
from handcal.io.files import make_folder, read_limited, sync_folder, write_atomic, write_json
from handcal.register.fuse import fuse_alignments
from handcal.register.results import SolveSettings
from handcal.register.solve import solve_alignment
from handcal.rig.rig_file import write_rig
from handcal.session.journal import JOURNAL, Damage, Event, happens_now, journal_line
from handcal.session.record import (
    MAX_ALIGNMENT_BYTES,
    SessionRecord,
    alignment_path,
    load_session,
    sha256,
)
from handcal.session.state import SessionEvent, SessionState

SessionHealth: TypeAlias = Literal["sound", "damaged", "none"]
_REPLACED = (SessionEvent.CREATED, SessionEvent.COPIED, SessionEvent.NOTES_SAVED)


@dataclass(frozen=True, slots=True)
class SessionCheck:
    """Result of checking a session folder."""

    state: SessionHealth
    """``damaged`` if the rest can be read, ``none`` if nothing can."""
    damaged: tuple[Damage, ...]


def without_unsolvable(
    record: SessionRecord, settings: SolveSettings, progress: Progress = Progress()
) -> SessionRecord:
    """Return a session without the alignments that cannot be solved, which its `damaged` names.

    It is the same object if all can be solved.
    """
    alignments, damaged = dict(record.alignments), list(record.damaged)
    for number, alignment in record.alignments.items():
        try:
            shifts = solve_alignment(alignment, record.rig, settings.method, progress.check)
            fuse_alignments([(alignment, shifts)], record.rig, settings.fuse)
        except (ValueError, HandError) as error:
            del alignments[number]
            what, instead = f"it cannot be solved: {error}", f"alignment {number} was left out"
            damaged.append(Damage(f"alignments/{number}.npz", None, what, instead))
    if len(alignments) == len(record.alignments):
        return record
    return replace(record, alignments=MappingProxyType(alignments), damaged=tuple(damaged))


def check_session(path: Path) -> SessionCheck:
    """Return whether the session in a folder is sound, with all its damaged parts."""
    try:
        record = load_session(path).contents()
    except FileError as error:
        return SessionCheck("none", (Damage(str(path), None, str(error)),))
    return SessionCheck("damaged" if record.damaged else "sound", record.damaged)


def repair_session(path: Path, output: Path, rig: Rig | None = None) -> SessionRecord:
    """Copy what is sound of a session into a new folder, and return the new session.

    Alignments and trials keep their numbers and times; the event `repaired` lists what is missing.

    Parameters
    ----------
    path : Path
        Not changed.
    output : Path
        A new folder.
    rig : Rig, optional
        Used in place of the stored one, if that is damaged.

    Raises
    ------
    FileError
        If the session cannot be read, or the folder exists or cannot be written.
    """
    record = without_unsolvable(load_session(path, rig).contents(), SolveSettings())
    if output.exists():
        raise FileError(f"{output} exists", "choose a new folder")
    hidden = make_folder(output.absolute().parent) / f".{output.name}.repairing"
    try:
        shutil.rmtree(hidden, ignore_errors=True)
        hidden.mkdir(mode=0o700)
        (hidden / "alignments").mkdir(mode=0o700)
        for number in (*record.alignments, *record.deleted_alignments):
            data = read_limited(alignment_path(path, number), MAX_ALIGNMENT_BYTES, path)
            write_atomic(alignment_path(hidden, number), data)
        write_rig(hidden / "rig.yaml", record.rig)
        write_json(hidden / "settings.json", record.settings)
        if record.results is not None:
            write_json(hidden / "results.json", record.results)
        if record.notes:
            write_atomic(hidden / "notes.txt", record.notes.encode())
        lines = (
            journal_line(replace(event, number=number))
            for number, event in enumerate(_events(record, hidden), 1)
        )
        write_atomic(hidden / JOURNAL, b"".join(lines))
        hidden.rename(output)
        sync_folder(output.absolute().parent)
    except OSError as error:
        raise FileError(f"cannot write {output}: {error.strerror or error}") from error
    finally:
        shutil.rmtree(hidden, ignore_errors=True)
    return load_session(output).contents()


def _events(record: SessionRecord, folder: Path) -> Iterator[Event]:
    """Yield the events of the repaired session in `folder`."""
    alignments = {*record.alignments, *record.deleted_alignments}
    trials = {*record.trials, *record.deleted_trials}
    created = {
        "rig": (folder / "rig.yaml").read_text("utf-8"),
        "settings": record.settings,
        "wearer": record.wearer,
    }
    yield Event(1, record.events[0].time, SessionEvent.CREATED, created)
    damaged = [{"file": one.file, "line": one.line, "what": one.text} for one in record.damaged]
    yield happens_now(2, SessionEvent.REPAIRED, {"damaged": damaged})
    state = SessionState()
    state.alignments.has_gaps = state.trials.has_gaps = True
    for event in record.events:
        number = event.data.get("number")
        if event.name in _REPLACED or (
            (event.name.startswith("alignment_") and number not in alignments)
            or (event.name.startswith("trial_") and number not in trials)
        ):
            continue
        with suppress(ValueError):  # it cannot follow those before it, and was left out
            state.apply(event)
            yield event
    notes = sha256(record.notes.encode()) if record.notes else ""
    rest = {
        "results": record.results,
        "is_solved": record.is_solved,  # not if one of the alignments is lost
        "notes_sha256": notes,
    }
    yield happens_now(2, SessionEvent.COPIED, rest)
