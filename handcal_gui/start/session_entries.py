"""Which sessions the start page offers, and what it says of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handcal.errors import FileError
from handcal.journal import read_journal
from handcal.unfinished import UnfinishedSession, unfinished_sessions
from handcal_gui.widgets.times import local_time


@dataclass(frozen=True, slots=True)
class Entry:
    """One session.

    Attributes
    ----------
    path : Path
    text : str
    is_enabled : bool
        Whether it may be chosen; otherwise `text` says why not.
    """

    path: Path
    text: str
    is_enabled: bool = True


@dataclass(frozen=True, slots=True)
class Offers:
    """What may be resumed, and what may be opened again."""

    unfinished: tuple[Entry, ...]
    recent: tuple[Entry, ...]


def find_offers(folder: Path, recent: Sequence[Path]) -> Offers:
    """Look through the folder of the sessions, and at those opened last; takes a while.

    An unfinished session that holds nothing yet is not worth resuming.
    """
    return Offers(
        unfinished=tuple(
            _unfinished(session)
            for session in unfinished_sessions(folder)
            if session.problem or session.alignments or session.trials
        ),
        recent=tuple(_recent(path) for path in recent if path.exists()),
    )


def _unfinished(session: UnfinishedSession) -> Entry:
    if session.problem:
        text = f"{session.path.name}: {session.problem}"
        return Entry(session.path, text, is_enabled=False)
    count = f"{session.alignments} alignment{'' if session.alignments == 1 else 's'}"
    return Entry(session.path, f"{_title(session.wearer, session.started)} · {count}")


def _recent(path: Path) -> Entry:
    try:
        created = read_journal(path / "journal.jsonl").events[0]
    except (FileError, IndexError) as error:
        return Entry(path, f"{path.name}: {error or 'empty'}", is_enabled=False)
    return Entry(path, _title(str(created.data.get("wearer", "")), created.time))


def _title(wearer: str, started: str) -> str:
    return f"{wearer or 'No name'} · {local_time(started)}"
