"""The interrupted sessions in a folder, which can be resumed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handcal.core.errors import FileError
from handcal.io.lock import FileLock
from handcal.session.journal import find_journals, read_journal
from handcal.session.record import SessionRecord
from handcal.session.session import Session
from handcal.session.state import ASIDE, VERIFYING, SessionEvent


@dataclass(frozen=True, slots=True)
class UnfinishedSession:
    """A session whose journal does not end in `finished`, but for what is `ASIDE`."""

    path: Path
    started: str = ""
    """UTC, ISO 8601; empty if unknown."""
    wearer: str = ""
    alignments: int = 0
    trials: int = 0
    """Numbers of those that are not deleted."""
    verified: int = 0
    """Number of verified eyes; after a slipped headset they are all there is."""
    is_verifying: bool = False
    """True if a verification was begun, of which nothing else may remain."""
    damaged: int = 0
    """Number of damaged parts, which are left out when it is resumed."""
    problem: str = ""
    """Reason why it cannot be resumed, such as another program; empty if it can."""
    advice: str = ""
    """Advice, if the reason gives one; empty if none."""
    is_repaired: bool = False
    """True if a repaired copy of this damaged session is in the same folder."""

    @property
    def is_worth_resuming(self) -> bool:
        """True if it holds an alignment, a trial or a verification, be it one only begun."""
        return bool(self.alignments or self.trials or self.verified or self.is_verifying)


def summarize(
    record: SessionRecord, started: str = "", *, has_copy: bool = False
) -> UnfinishedSession:
    """Return what an unfinished session holds; `has_copy`: a repaired copy is beside it."""
    return UnfinishedSession(
        record.path,
        started,
        record.wearer,
        len(record.alignments),
        len(record.trials),
        len(record.facts.verified),
        any(event.name == VERIFYING for event in record.events),
        len(record.damaged),
        is_repaired=bool(record.damaged) and has_copy,
    )


def unfinished_and_repaired(parent: Path) -> tuple[list[UnfinishedSession], set[Path]]:
    """Return the unfinished sessions among the folders in `parent`, the newest first.

    Also return the folders of all sessions, finished or not, of which it holds a repaired copy.
    """
    outlines = {journal.parent: _outline(journal) for journal in find_journals(parent)}
    copied = {began for began, names in outlines.values() if SessionEvent.REPAIRED in names}
    repaired = {
        path
        for path, (began, names) in outlines.items()
        if began in copied and SessionEvent.REPAIRED not in names
    }
    found = [_inspect(path, *outline, path in repaired) for path, outline in outlines.items()]
    unfinished = sorted(
        (session for session in found if session is not None),
        key=lambda session: (session.started, session.path.name),
        reverse=True,
    )
    return unfinished, repaired


def _outline(journal: Path) -> tuple[str, tuple[str, ...]]:
    """Return the beginning of a session and the names of its events; empty if unreadable."""
    try:
        events = read_journal(journal).events
    except FileError:  # `_inspect` says why
        return "", ()
    return events[0].time, tuple(event.name for event in events)


def _inspect(
    path: Path, started: str, names: tuple[str, ...], has_copy: bool
) -> UnfinishedSession | None:
    if [name for name in names if name not in ASIDE][-1:] == [SessionEvent.FINISHED]:
        return None
    try:
        FileLock(path / "lock").release()  # only a test: reading takes too long to hold it
        record = Session.open(path)
    except FileError as error:
        return UnfinishedSession(path, started, problem=error.what, advice=error.advice)
    return summarize(record, started, has_copy=has_copy)
