"""The interrupted sessions in a folder, which can be resumed."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from handcal.errors import FileError
from handcal.io.lock import FileLock
from handcal.session.journal import JOURNAL, Event, read_journal
from handcal.session.session import Session
from handcal.session.state import ASIDE, SessionEvent


@dataclass(frozen=True, slots=True)
class UnfinishedSession:
    """A session whose journal does not end in `finished`."""

    path: Path
    started: str = ""
    """UTC, ISO 8601; empty if unknown."""
    wearer: str = ""
    alignments: int = 0
    trials: int = 0
    """Numbers of those that are not deleted."""
    damaged: int = 0
    """Number of damaged parts, which are left out when it is resumed."""
    problem: str = ""
    """Reason why it cannot be resumed, such as another program; empty if it can."""
    is_repaired: bool = False
    """True if a repaired copy of this damaged session is in the same folder."""


def unfinished_sessions(parent: Path) -> list[UnfinishedSession]:
    """Return the unfinished sessions among the folders in `parent`, the newest first."""
    journals = {journal.parent: _events(journal) for journal in parent.glob(f"*/{JOURNAL}")}
    copied = {
        events[0].time
        for events in journals.values()
        if any(event.name == SessionEvent.REPAIRED for event in events)
    }
    found = [_inspect(path, events, copied) for path, events in journals.items()]
    return sorted(
        (session for session in found if session is not None),
        key=lambda session: (session.started, session.path.name),
        reverse=True,
    )


def _events(journal: Path) -> tuple[Event, ...]:
    """Return the events of a journal; none if it cannot be read, for which `_inspect` says why."""
    try:
        return read_journal(journal).events
    except FileError:
        return ()


def _inspect(
    path: Path, events: tuple[Event, ...], copied: Collection[str]
) -> UnfinishedSession | None:
    names = [event.name for event in events]
    if [name for name in names if name not in ASIDE][-1:] == [SessionEvent.FINISHED]:
        return None
    started = events[0].time if events else ""
    try:
        FileLock(path / "lock").release()  # only a test: reading takes too long to hold it
        record = Session.open(path)
    except FileError as error:
        return UnfinishedSession(path, started, problem=str(error))
    is_original = bool(record.damaged) and SessionEvent.REPAIRED not in names
    return UnfinishedSession(
        path,
        started,
        record.wearer,
        len(record.alignments),
        len(record.trials),
        len(record.damaged),
        is_repaired=is_original and started in copied,
    )
