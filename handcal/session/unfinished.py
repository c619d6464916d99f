"""The interrupted sessions in a folder, which can be resumed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handcal.errors import FileError
from handcal.io.lock import FileLock
from handcal.session.journal import read_journal
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


def unfinished_sessions(parent: Path) -> list[UnfinishedSession]:
    """Return the unfinished sessions among the folders in `parent`, the newest first."""
    journals = parent.glob("*/journal.jsonl")
    found = [_inspect(journal.parent) for journal in journals]
    return sorted(
        (session for session in found if session is not None),
        key=lambda session: (session.started, session.path.name),
        reverse=True,
    )


def _inspect(path: Path) -> UnfinishedSession | None:
    started = ""
    try:
        events = read_journal(path / "journal.jsonl").events
        if events:
            started = events[0].time
            last = [event.name for event in events if event.name not in ASIDE][-1:]
            if last == [SessionEvent.FINISHED]:
                return None
        FileLock(path / "lock").release()  # only a test: reading takes too long to hold it
        record = Session.open(path)
    except FileError as error:
        return UnfinishedSession(path, started, problem=str(error))
    return UnfinishedSession(
        path,
        started,
        record.wearer,
        len(record.alignments),
        len(record.trials),
        len(record.damaged),
    )
