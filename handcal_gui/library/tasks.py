"""Tasks of the library: sessions read, checked, repaired and deleted, outside its thread."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from handcal.calibration.solve_again import check_solvable
from handcal.core.errors import CancelledError, FileError, InUseError
from handcal.core.progress import Progress
from handcal.session.library import (
    LibraryEntry,
    correct_wearer,
    delete_session,
    deleted_sessions,
    read_library,
    restore_session,
)
from handcal.session.record import replay
from handcal.session.repair import repair_session
from handcal_gui.app.translation import tr
from handcal_gui.library.sessions_model import SessionRow, make_row
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.sentence import with_advice
from handcal_gui.widgets.times import local_time

Change: TypeAlias = Mapping[Path, str] | tuple[Path, ...]
"""The reverse of a change: former names of sessions, or the places of deleted ones."""
_MOST_NAMED = 3
_MOST_LINES = 8
_RUNS_HERE = tr("{} is running in this window. Finish it first.")
_RUNS_ELSEWHERE = tr("{} is open in another program. Close it there, then try again.")


@dataclass(frozen=True, slots=True)
class Contents:
    """The contents of a folder of sessions."""

    rows: tuple[SessionRow, ...] = ()
    deleted: tuple[Path, ...] = ()
    last: str = ""
    """Name of the session that was deleted last."""
    is_missing: bool = False
    """True if there is no such folder."""


def read_contents(folder: Path, known: Collection[LibraryEntry]) -> Contents:
    """Read a folder of sessions; those `known` are kept if they have not changed."""
    rows = tuple(map(make_row, read_library(folder, known)))
    deleted = deleted_sessions(folder)
    last = _name_of(deleted[-1]) if deleted else ""
    return Contents(rows, deleted, last, is_missing=not os.path.isdir(folder))


def check_sessions(paths: Sequence[Path], found_damaged: set[Path], progress: Progress) -> str:
    """Read every file of some sessions; return which are damaged, as a message and in a set."""

    def check(path: Path) -> None:
        try:
            _require_sound(path)
        except FileError:
            found_damaged.add(path)
            raise

    sound, lines = _each(paths, check, tr("Checking {}"), progress)
    count = pluralize(sound, tr("session"), tr("sessions"))
    said = tr("✓ {} sound, every file read.").format(count)
    return _with_lines(said if sound or not lines else "", lines)


def _require_sound(path: Path) -> None:
    """Raise FileError, with what is damaged, unless a session is sound and can be solved."""
    found = check_solvable(path)
    if found.state == "sound":
        return
    damaged = found.damaged[:_MOST_NAMED]
    # Where nothing can be read, the reason names the folder itself.
    named = "; ".join(one.what if found.state == "none" else str(one) for one in damaged)
    more = len(found.damaged) - _MOST_NAMED
    others = tr(" (and {} more)").format(more) if more > 0 else ""
    if found.state == "none":
        advice = tr("make it readable, or restore it from a backup")
        raise FileError(with_advice(f"{named}{others}", advice))
    repair = tr("; select it alone, and Repair copies what is sound")
    raise FileError(f"{named}{others}{repair}")


def repair_beside(path: Path, progress: Progress) -> str:
    """Copy what is sound of a damaged session to a new one beside it; return a message."""
    progress.at(0.0, tr("Repairing {}").format(path.name))
    if check_solvable(path).state == "sound":
        return tr("{} is sound: there is nothing to repair.").format(_name_of(path))
    output = _free(path.with_name(f"{path.name}-repaired"))
    made = repair_session(path, output)
    kept = pluralize(len(made.alignments), tr("alignment"), tr("alignments"))
    return tr("{} repaired: a copy with {} and {}.").format(
        _name_of(path), kept, pluralize(len(made.trials), tr("trial"), tr("trials"))
    )


def delete_sessions(paths: Sequence[Path], progress: Progress) -> str:
    """Delete some sessions, each of which can be restored; return a message."""
    deleted, lines = _each(paths, delete_session, tr("Deleting {}"), progress)
    count = pluralize(deleted, tr("session"), tr("sessions"))
    return _with_lines(tr("{} deleted.").format(count), lines)


def restore_sessions(paths: Sequence[Path], progress: Progress) -> str:
    """Restore deleted sessions; return a message."""
    restored, lines = _each(paths, restore_session, tr("Restoring {}"), progress)
    count = pluralize(restored, tr("session"), tr("sessions"))
    return _with_lines(tr("{} restored.").format(count), lines)


def correct_names(names: Mapping[Path, str], progress: Progress) -> str:
    """Correct or remove the names of the wearers of some sessions; return a message."""
    corrected, lines = _each(
        list(names), lambda path: correct_wearer(path, names[path]), tr("Correcting {}"), progress
    )
    count = pluralize(corrected, tr("session"), tr("sessions"))
    is_named = any(name.strip() for name in names.values())
    said = tr("Name corrected in {}.") if is_named else tr("Name removed from {}.")
    return _with_lines(said.format(count), lines)


def undo(change: Change, progress: Progress) -> str:
    """Bring back former names or deleted sessions; return a message."""
    if isinstance(change, Mapping):
        return correct_names(change, progress)
    return restore_sessions(change, progress)


def undoable(changes: Sequence[Change], contents: Contents) -> list[Change]:
    """Return what is left to undo of changes, in their order."""
    wearers = {row.entry.path: row.entry.wearer for row in contents.rows}
    restorable = {path.parent.parent / path.name for path in contents.deleted}

    def is_renamed(path: Path, former: str) -> bool:
        return path in restorable or wearers.get(path, former) != former

    left: list[Change] = [
        {path: name for path, name in change.items() if is_renamed(path, name)}
        if isinstance(change, Mapping)
        else tuple(path for path in change if path in contents.deleted)
        for change in changes
    ]
    return list(filter(None, left))


def _each(
    paths: Sequence[Path], do: Callable[[Path], object], doing: str, progress: Progress
) -> tuple[int, list[str]]:
    """Do something to each session, until cancelled.

    Returns
    -------
    done : int
        For how many it succeeded.
    lines : list of str
        Those for which it failed, with the reasons; first how many a cancellation left out.
    """
    lines: list[str] = []
    for tried, path in enumerate(paths):
        try:
            progress.at(tried / len(paths), doing.format(path.name))
            do(path)
        except CancelledError:
            left = pluralize(len(paths) - tried, tr("session"), tr("sessions"))
            return tried - len(lines), [tr("Cancelled: {} left out.").format(left), *lines]
        except InUseError as error:
            where = _RUNS_HERE if error.is_here else _RUNS_ELSEWHERE
            lines.append(where.format(_name_of(path)))
        except (FileError, ValueError) as error:  # a name may be invalid
            lines.append(f"× {_name_of(path)}: {error}")
    return len(paths) - len(lines), lines


def _with_lines(said: str, lines: Sequence[str]) -> str:
    """Return a message with a line for each session, as many as the window has room for."""
    more = len(lines) - _MOST_LINES
    others = [tr("and {} more").format(more)] if more > 0 else []
    return "\n".join(filter(None, (said, *lines[:_MOST_LINES], *others)))


def _free(path: Path) -> Path:
    """Return a path that does not exist, with a number if needed."""
    number = 2
    found = path
    while found.exists():
        found, number = path.with_name(f"{path.name}-{number}"), number + 1
    return found


def _name_of(path: Path) -> str:
    """Return the wearer and the beginning of a session; of an unreadable one the folder."""
    try:
        replayed = replay(path)
    except FileError:
        return path.name
    return f"{replayed.state.wearer or path.name}, {local_time(replayed.journal.events[0].time)}"
