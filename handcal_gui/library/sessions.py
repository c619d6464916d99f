"""The sessions of a folder: their rows in the library, and what is done to them in a thread."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeAlias

from handcal.calibration.solve_again import check_solvable
from handcal.core.errors import CancelledError, FileError, InUseError
from handcal.core.progress import Progress
from handcal.core.types import EYES
from handcal.export.wearers import spread
from handcal.session.library import (
    EyeOutcome,
    LibraryEntry,
    correct_wearer,
    delete_session,
    deleted_sessions,
    deleted_together,
    read_library,
    restore_session,
)
from handcal.session.record import replay
from handcal.session.repair import repair_session
from handcal_gui.app.translation import tr
from handcal_gui.widgets.error_bars import after_arcmin, error_bars, picture_text
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.result_rows import EYE_NAMES, NOTHING, doubt_word
from handcal_gui.widgets.table import Column, Row
from handcal_gui.widgets.times import local_time

Filter: TypeAlias = Literal["all", "accepted", "repeat", "unfinished", "damaged", "empty"]
FILTERS: Mapping[Filter, str] = {
    "all": tr("All sessions"),
    "accepted": tr("Good"),
    "repeat": tr("Not good"),
    "unfinished": tr("Unfinished"),
    "damaged": tr("Damaged"),
    "empty": tr("Empty"),
}
_KINDS: Mapping[str, Callable[[EyeOutcome], float | None]] = {
    tr("before"): lambda one: one.before_arcmin,
    tr("found"): lambda one: one.found_arcmin,
    tr("after"): after_arcmin,
}
Change: TypeAlias = Mapping[Path, str] | tuple[Path, ...]
"""The reverse of a change: former names of sessions, or the places of deleted ones."""
_MOST_NAMED = 3
_MOST_LINES = 8
_RUNS_HERE = tr("{} is running in this window. Finish it first.")
_RUNS_ELSEWHERE = tr("{} is open in another program. Close it there, then try again.")


@dataclass(frozen=True, slots=True)
class _Shown:
    """A column with the text and the sort key of each session."""

    column: Column
    text: Callable[[LibraryEntry], str]
    key: Callable[[LibraryEntry], Any]


def is_damaged(entry: LibraryEntry) -> bool:
    """Return whether a part of a session, or all of it, cannot be read."""
    return bool(entry.problem or entry.damaged)


def is_of(entry: LibraryEntry, kind: Filter) -> bool:
    """Return whether a session is of a kind; one in which nothing was done is only *empty*."""
    is_accepted = bool(entry.eyes) and all(e.is_accepted for e in entry.eyes.values())
    if entry.is_empty or kind == "empty":
        return entry.is_empty and kind == "empty"
    match kind:
        case "accepted":
            return is_accepted
        case "repeat":
            return bool(entry.eyes) and not is_accepted
        case "unfinished":
            return not (entry.is_finished or entry.problem)
        case "damaged":
            return is_damaged(entry)
    return True


def matches(entry: LibraryEntry, words: Sequence[str]) -> bool:
    """Return whether each word, in lower case, is in a session's names, dates or notes."""
    names = entry.wearer, local_time(entry.started), entry.rig, entry.headset, entry.path.name
    text = " ".join((*names, entry.plan, entry.notes)).casefold()
    return all(word in text for word in words)


def session_row(entry: LibraryEntry) -> Row:
    """Return the row of a session for `COLUMNS`."""
    copy = tr("Repaired in {}").format(entry.repaired_as) if entry.repaired_as else ""
    return Row(
        "",
        tuple(shown.text(entry) for shown in _SHOWN),
        "\n".join(filter(None, (copy, entry.problem or str(entry.path)))),
        entry.path,
        tuple(shown.key(entry) for shown in _SHOWN),
        partial(error_bars, entry.eyes),
        picture_text(entry.eyes),
    )


def selection_text(entries: Sequence[LibraryEntry]) -> str:
    """Return the means over several sessions, each wearer counting once; empty for one."""
    if len(entries) < 2:
        return ""
    eyes = [(entry, eye) for entry in entries for eye in entry.eyes.values()]
    means = []
    for name, error in _KINDS.items():
        errors = ((one.wearer or one.path.name, error(eye)) for one, eye in eyes)
        pairs = [(wearer, arcmin) for wearer, arcmin in errors if arcmin is not None]
        if pairs:
            found = spread(name, pairs)
            sd = "" if found.sd_between is None else f" ± {found.sd_between:.1f}"
            means.append(f"{name} {found.mean:.1f}{sd}′")
    wearers = {entry.wearer or entry.path.name for entry in entries}
    good = sum(eye.is_accepted for _, eye in eyes)
    verified = sum(eye.is_verified for _, eye in eyes)
    counts = tr("{}, {}: {} good, {} verified").format(
        pluralize(len(wearers), tr("wearer"), tr("wearers")),
        pluralize(len(eyes), tr("eye"), tr("eyes")),
        good,
        verified,
    )
    text = tr("{}; mean error {}").format(counts, ", ".join(means)) if means else counts
    return tr("{} (± SD between wearers)").format(text) if " ± " in text else text


def calibrations_of(wearer: str, entries: Sequence[LibraryEntry]) -> list[LibraryEntry]:
    """Return the solved sessions of a wearer, the oldest first; none of a wearer without a name.

    A repaired copy counts instead of the session that it was copied from.
    """
    found = [entry for entry in entries if wearer and entry.wearer == wearer and entry.eyes]
    copies = {entry.started: entry for entry in found if entry.is_repaired}
    found = [entry for entry in found if copies.get(entry.started, entry) is entry]
    return sorted(found, key=lambda entry: (entry.started, entry.path.name))


@dataclass(frozen=True, slots=True)
class Contents:
    """The contents of a folder of sessions."""

    entries: tuple[LibraryEntry, ...] = ()
    deleted: tuple[Path, ...] = ()
    together: tuple[Path, ...] = ()
    """Those that were deleted with the last one."""
    last: str = ""
    """Name of the session that was deleted last."""
    is_missing: bool = False
    """True if there is no such folder."""


def read_contents(folder: Path, known: Collection[LibraryEntry]) -> Contents:
    """Read a folder of sessions; those `known` are kept if they have not changed."""
    entries, deleted = read_library(folder, known), deleted_sessions(folder)
    last = _name_of(deleted[-1]) if deleted else ""
    is_missing = not os.path.isdir(folder)
    return Contents(entries, deleted, deleted_together(deleted), last, is_missing)


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
    named = "; ".join(one.text if found.state == "none" else str(one) for one in damaged)
    more = len(found.damaged) - _MOST_NAMED
    others = tr(" (and {} more)").format(more) if more > 0 else ""
    if found.state == "none":
        advice = tr("make it readable, or restore it from a backup")
        raise FileError(f"{named}{others}", advice)
    raise FileError(f"{named}{others}", tr("select it alone, and Repair copies what is sound"))


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
    now_ns = time.time_ns()
    deleted, lines = _each(
        paths, lambda path: delete_session(path, now_ns), tr("Deleting {}"), progress
    )
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
    wearers = {entry.path: entry.wearer for entry in contents.entries}
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


def _state(entry: LibraryEntry) -> str:
    if entry.problem:
        return tr("Unreadable")
    if entry.is_empty:
        return tr("Empty")
    if entry.repaired_as:
        return tr("Damaged, has a copy")
    if entry.damaged:
        return tr("Damaged: {}").format(pluralize(entry.damaged, tr("part"), tr("parts")))
    if entry.is_repaired:
        return tr("Repaired copy") if entry.is_finished else tr("Unfinished, repaired copy")
    return tr("Finished") if entry.is_finished else tr("Unfinished")


def _verdicts(entry: LibraryEntry) -> str:
    words = {
        eye: doubt_word(one.trials.target_arcmin) if one.trials and one.is_doubted else one.word
        for eye, one in entry.eyes.items()
    }
    return _each_eye(words) or (NOTHING if entry.problem else tr("Not solved"))


def _finals(entry: LibraryEntry) -> str:
    return _each_eye({eye: one.final for eye, one in entry.eyes.items()}) or NOTHING


def _each_eye(words: Mapping[Any, str]) -> str:
    """Return the words of both eyes, once where they are the same."""
    if len(words) == len(EYES) and len(set(words.values())) == 1:
        return words[EYES[0]]
    return ", ".join(f"{EYE_NAMES[eye].split()[0]} {word}" for eye, word in words.items() if word)


def _errors(kind: str) -> Callable[[LibraryEntry], str]:
    def text(entry: LibraryEntry) -> str:
        if not entry.eyes:
            return NOTHING
        errors = (_KINDS[kind](entry.eyes[eye]) if eye in entry.eyes else None for eye in EYES)
        return " / ".join(NOTHING if one is None else f"{one:.1f}" for one in errors)

    return text


def _worst(kind: str) -> Callable[[LibraryEntry], float]:
    """Return the error of the worse eye; infinite unless it is known of every solved eye."""

    def key(entry: LibraryEntry) -> float:
        errors = [_KINDS[kind](one) for one in entry.eyes.values()]
        known = [error for error in errors if error is not None]
        return max(known) if known and len(known) == len(errors) else float("inf")

    return key


def _trials(entry: LibraryEntry) -> str:
    """Return the mean errors of the trials of each eye's last calibration, and their numbers."""
    if not entry.trials:
        return NOTHING
    trials = [entry.eyes[eye].trials if eye in entry.eyes else None for eye in EYES]
    if not any(trials):
        return tr("{} of earlier φ").format(entry.trials)
    means = " / ".join(NOTHING if one is None else f"{one.mean_arcmin:.1f}" for one in trials)
    counts = "/".join(str(one.count) if one else "0" for one in trials)
    is_over = any(one is not None and one.is_over for one in trials)
    return (tr("⚠ {} n={}") if is_over else tr("{} n={}")).format(means, counts)


def _worst_trials(entry: LibraryEntry) -> float:
    errors = (one.trials.mean_arcmin for one in entry.eyes.values() if one.trials is not None)
    return max(errors, default=float("inf"))


def _eye_distance(entry: LibraryEntry) -> str:
    return NOTHING if entry.eye_distance_m is None else f"{1e3 * entry.eye_distance_m:.1f}"


def _text(title: str, tooltip: str, text: Callable[[LibraryEntry], str], rank: int = 0) -> _Shown:
    column = Column(title, tooltip, is_number=False, rank=rank)
    return _Shown(column, lambda entry: text(entry) or NOTHING, lambda e: text(e).casefold())


def _error(title: str, kind: str, tooltip: str, rank: int = 0) -> _Shown:
    column = Column(tr("{} ′\nleft / right").format(title), tooltip, rank=rank)
    return _Shown(column, _errors(kind), _worst(kind))


_SHOWN = (
    _text(
        tr("Wearer"),
        tr("Name or code; of a session that cannot be read, its folder"),
        lambda e: e.wearer or (e.path.name if e.problem else ""),
    ),
    _Shown(
        Column(tr("Date"), tr("Start, local time"), is_number=False),
        lambda e: local_time(e.started) or NOTHING,
        lambda e: e.started,
    ),
    _text(
        tr("Verdict"),
        tr("Of the newest results; ⚠ trials of a good φ are over the lab's target on average"),
        _verdicts,
    ),
    _error(
        tr("Before"),
        tr("before"),
        tr("Error expected without the calibration, in arcminutes: the grey bars of the picture"),
        5,
    ),
    _error(
        tr("Found"),
        tr("found"),
        tr("Error that the wearer's verification found, in arcminutes; – was not verified"),
        4,
    ),
    _error(
        tr("After"),
        tr("after"),
        tr("Error expected with the final φ, in arcminutes: the coloured bars of the picture"),
    ),
    _Shown(
        Column(
            tr("Trials ′\nleft / right"),
            tr(
                "Error of each eye's last calibrated φ relative to φ set by hand, in arcminutes:\n"
                "the mean over its trials, and their numbers: 0 if all were of an earlier φ.\n"
                "⚠ over the lab's target: look at the trials; if φ was set well by hand, calibrate "
                "again"
            ),
            rank=6,
        ),
        _trials,
        _worst_trials,
    ),
    _text(
        tr("Final φ"),
        tr("The φ that the headset draws with and the export calls final"),
        _finals,
        2,
    ),
    _text(
        tr("State"),
        tr("Check lists what is damaged; Repair copies the rest"),
        lambda e: tr("{}, simulated").format(_state(e)) if e.is_simulated else _state(e),
        1,
    ),
    _text(tr("Notes"), tr("The beginning of the notes"), lambda e: e.notes, 7),
    _text(tr("Plan"), tr("The plan that was followed"), lambda e: e.plan, 8),
    _Shown(
        Column(tr("Eyes mm"), tr("Distance between the eyes, measured or else solved"), rank=9),
        _eye_distance,
        lambda e: e.eye_distance_m or 0.0,
    ),
    _text(tr("Rig"), tr("Name of the rig"), lambda e: e.rig, 10),
    _text(tr("Headset"), tr("Name of the headset"), lambda e: e.headset, 11),
    _text(
        tr("Session"),
        tr("Name of the session's folder, by which the tables of an export name it"),
        lambda e: e.path.name,
        12,
    ),
)
COLUMNS = tuple(shown.column for shown in _SHOWN)
