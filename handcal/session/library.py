"""The sessions in a folder, by their journals; deletes them and restores deleted ones."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.core.types import EYES, PLAN_WORDS, Eye, VerdictName
from handcal.io.files import make_folder, read_limited, sync_folder
from handcal.io.lock import FileLock
from handcal.register.benefit import expected_arcmin
from handcal.register.results import RESULTS_VERSION, read_rendered_shift_m, read_solved_shift_m
from handcal.register.verdict_words import VERDICT_WORDS
from handcal.rig.rig_file import MAX_RIG_BYTES, parse_rig
from handcal.session.drawn import DrawnShift, ShiftKind, drawn_shifts, is_judged, result_word
from handcal.session.journal import JOURNAL, find_journals, read_journal
from handcal.session.record import (
    MAX_ALIGNMENT_BYTES,
    MAX_NOTES_CHARACTERS,
    Replayed,
    alignment_path,
    replay,
    sha256,
    simulated_parts,
)
from handcal.session.session import Session
from handcal.session.state import ASIDE, VERIFYING, SessionEvent, SessionState, clean_wearer
from handcal.session.trial import (
    COMPARED,
    EyeTrials,
    is_doubted,
    judge_trials,
    trial_errors_arcmin,
)

_NOTES_CHARACTERS = 200
_DONE = {SessionEvent.NOTES_SAVED, SessionEvent.REPAIRED, COMPARED, VERIFYING}
"""Events that speak against an empty session."""
DELETED = ".deleted"
"""Folder, inside the folder of sessions, to which deleted sessions are moved."""


@dataclass(frozen=True, slots=True)
class EyeOutcome:
    """The result of one eye as the session holds it."""

    verdict: str
    before_arcmin: float | None
    """Error that is expected without the calibration."""
    expected_arcmin: float | None
    """Error expected with the final φ: the offline calibration has that before."""
    remaining_arcmin: float | None
    """Error after the wearer's verification; None if the final φ was not verified."""
    found_arcmin: float | None = None
    """Error that the verification found, whether its result is used or not."""
    trials: EyeTrials | None = None
    """Those of the calibrated φ; None without any."""
    final: str = ""
    """The final φ in words, as `handcal.session.drawn.DrawnShift` gives it; empty if unknown."""
    kind: ShiftKind | None = None
    """The kind of the final φ; None if unknown."""
    is_verified: bool = False
    """True if the wearer verified what is final, with the present alignments."""

    @property
    def is_judged(self) -> bool:
        """True if the verdict is about the final φ."""
        return self.kind is None or is_judged(self.verdict, self.kind)

    @property
    def word(self) -> str:
        """The verdict in a word, or where a final φ comes from that was not judged."""
        if self.verdict not in VERDICT_WORDS:
            return self.verdict
        return result_word(cast(VerdictName, self.verdict), self.kind or "solved")

    @property
    def is_accepted(self) -> bool:
        """True if the verdict on the final φ is *accept*."""
        return self.verdict == "accept" and self.is_judged

    @property
    def is_doubted(self) -> bool:
        """True if trials contradict that."""
        return self.is_accepted and is_doubted(self.verdict, self.trials)


@dataclass(frozen=True, slots=True)
class LibraryEntry:
    """A session in the library."""

    path: Path
    stamp: tuple[int, int]
    """Time of change (ns) and length of the journal when it was read."""
    problem: str = ""
    """Reason why nothing can be read; empty if something can."""
    started: str = ""
    """UTC, ISO 8601."""
    wearer: str = ""
    former_wearers: tuple[str, ...] = ()
    """Names before each correction."""
    rig: str = ""
    headset: str = ""
    """Names; empty if unknown."""
    plan: str = ""
    eye_distance_m: float | None = None
    """Measured, or solved; None if unknown."""
    notes: str = ""
    is_simulated: bool = False
    """True if a part of it was simulated."""
    eyes: Mapping[Eye, EyeOutcome] = field(default_factory=lambda: MappingProxyType({}))
    """Of the newest results, if they are those of all alignments."""
    alignments: int = 0
    trials: int = 0
    """Numbers of those that are not deleted."""
    is_empty: bool = False
    """True if nothing was done in it: no alignment, verification, trial or note, even deleted."""
    target_arcmin: float | None = None
    """Largest expected error that the lab accepts, as set in the session; None if unknown."""
    is_finished: bool = False
    is_repaired: bool = False
    """True for the sound parts of a session, copied by a repair."""
    damaged: int = 0
    """Damaged parts of the journal, and alignments or a rig file other than those it records."""
    repaired_as: str = ""
    """Name of a repaired copy of this damaged session, in the same folder; empty without one."""


def read_library(
    folder: Path, known: Collection[LibraryEntry] = (), progress: Progress = Progress()
) -> tuple[LibraryEntry, ...]:
    """Return the sessions in a folder, the newest first.

    Parameters
    ----------
    folder : Path
        Need not exist.
    known : collection of LibraryEntry
        Entries read before, which are kept if their journal has not changed.
    progress : Progress

    Raises
    ------
    CancelledError
        If it was cancelled.
    """
    before = {(entry.path, entry.stamp): entry for entry in known}
    journals = find_journals(folder)
    entries = []
    for done, journal in enumerate(journals):
        progress.at(done / len(journals), "Reading sessions")
        try:
            status = journal.stat()
        except OSError:  # it has just been moved away
            continue
        stamp = status.st_mtime_ns, status.st_size
        entries.append(before.get((journal.parent, stamp)) or _read(journal.parent, stamp))
    copies = {entry.started: entry.path.name for entry in entries if entry.is_repaired}
    for i, entry in enumerate(entries):
        is_original = bool(entry.damaged) and not entry.is_repaired
        copy = copies.get(entry.started, "") if is_original else ""
        if copy != entry.repaired_as:
            entries[i] = replace(entry, repaired_as=copy)
    return tuple(sorted(entries, key=lambda one: (one.started, one.path.name), reverse=True))


def correct_wearer(path: Path, name: str) -> None:
    """Replace the name of a session's wearer; the journal keeps the former one.

    Raises
    ------
    FileError
        If the session is open in a program, cannot be read, or cannot be written.
    ValueError
        If the name is invalid.
    """
    _require_there(path)
    clean_wearer(name)  # before anything is written
    with Session(path) as session:
        session.correct_wearer(name)


def delete_session(path: Path, at_ns: int | None = None) -> Path:
    """Move a session to the folder of deleted ones, and return its place there.

    Parameters
    ----------
    path : Path
    at_ns : int, optional
        Time of the deletion, kept as that of the folder: sessions deleted together have the same,
        by which `deleted_together` knows them after a restart.

    Raises
    ------
    FileError
        If it is open in a program, or cannot be moved.
    """
    _require_there(path)
    if not (path / JOURNAL).is_file():
        raise FileError(f"{path} is not a session, so nothing was deleted")
    FileLock(path / "lock").release()  # only a test, or another program would lose its folder
    folder = path.absolute().parent
    bin_folder = make_folder(folder / DELETED, folder)
    names = (path.name, *(f"{path.name}-{number}" for number in range(2, 10_000)))
    place = _move(path, next(bin_folder / one for one in names if not (bin_folder / one).exists()))
    if at_ns is not None:
        with suppress(OSError):  # then it is restored alone
            os.utime(place, ns=(at_ns, at_ns))
    return place


def restore_session(path: Path) -> Path:
    """Move a deleted session back, and return its place.

    Raises
    ------
    FileError
        If there is another session of its name, or it cannot be moved.
    """
    target = path.parent.parent / path.name
    if path.parent.name != DELETED:
        raise FileError(f"{path} is not in a folder {DELETED}, so nothing was restored")
    if target.exists():
        raise FileError(f"{target} exists", "rename it, then restore again")
    return _move(path, target)


def deleted_sessions(folder: Path) -> tuple[Path, ...]:
    """Return the deleted sessions of a folder, the most recently deleted one last."""
    found = [journal.parent for journal in find_journals(folder / DELETED)]
    return tuple(sorted(found, key=lambda path: (_changed_ns(path), path.name)))


def deleted_together(deleted: Collection[Path]) -> tuple[Path, ...]:
    """Return those of the `deleted_sessions` that were deleted with the last one."""
    times = {path: _modified_ns(path) for path in deleted}
    last = next(reversed(times.values()), None)
    return tuple(path for path, at_ns in times.items() if at_ns == last)


def _modified_ns(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:  # another program has just restored it
        return 0


def _require_there(path: Path) -> None:
    if not path.exists():
        raise FileError(f"{path} is no longer there: another program moved or deleted it")


def _changed_ns(path: Path) -> int:
    try:
        return path.stat().st_ctime_ns
    except OSError:  # another program has just restored it
        return 0


def _move(path: Path, target: Path) -> Path:
    try:
        path.rename(target)
        sync_folder(target.parent)
        sync_folder(path.absolute().parent)
    except OSError as error:
        raise FileError(f"cannot move {path}: {error.strerror or error}") from error
    return target


def _read(path: Path, stamp: tuple[int, int]) -> LibraryEntry:
    try:
        replayed = replay(path)
    except FileError as error:
        return LibraryEntry(path, stamp, problem=str(error))
    state = replayed.state
    return LibraryEntry(
        path,
        stamp,
        started=replayed.journal.events[0].time,
        wearer=state.wearer,
        former_wearers=tuple(state.former_wearers),
        rig=_rig_name(path, state),
        headset=state.facts.headset.name if state.facts.headset else "",
        plan=PLAN_WORDS[state.facts.plan] if state.facts.plan else "",
        eye_distance_m=_eye_distance_m(state),
        notes=_notes(path, state),
        is_simulated=bool(simulated_parts(state.settings or {})),
        eyes=MappingProxyType(eye_outcomes(state)),
        alignments=len(state.alignments.active),
        trials=len(state.trials.active),
        is_empty=_is_empty(replayed),
        target_arcmin=_lab_target_arcmin(state.settings),
        is_finished=state.is_finished,
        is_repaired=any(one.name == SessionEvent.REPAIRED for one in replayed.journal.events),
        damaged=len(replayed.damaged) + _damaged_files(path, state),
    )


def eye_outcomes(state: SessionState) -> dict[Eye, EyeOutcome]:
    """Return the results of a session's eyes; those that it does not hold are left out."""
    results = (state.results if state.is_solved else None) or {}
    if results.get("version") != RESULTS_VERSION:  # their numbers may mean something else
        return {}
    found = results.get("eyes")
    eyes = found if isinstance(found, dict) else {}
    trials = state.trials.active.values()
    errors = trial_errors_arcmin(trials, read_rendered_shift_m(results))
    target_arcmin = _lab_target_arcmin(state.settings)
    judged = judge_trials(errors, math.inf if target_arcmin is None else target_arcmin)
    drawn = drawn_shifts(state)
    solved = read_solved_shift_m(results)
    return {
        eye: _outcome(
            eyes[eye],
            judged.get(eye),
            drawn[eye] if eye in solved else None,
            is_verified=eye in state.verified_now,
        )
        if eye not in solved or drawn[eye].kind in ("solved", "offline")
        else _moved_outcome(state, eye, eyes[eye], judged.get(eye), drawn[eye])
        for eye in EYES
        if isinstance(eyes.get(eye), dict)
    }


def _is_empty(replayed: Replayed) -> bool:
    """Return whether nothing was done in a session, so that nothing is lost without it."""
    state = replayed.state
    is_kept = state.alignments.last() or state.trials.last() or state.facts.verified
    names = {event.name for event in replayed.journal.events}
    return not (is_kept or replayed.damaged or names & _DONE)


def _eye_distance_m(state: SessionState) -> float | None:
    """Return the distance between the eyes as measured, else as solved."""
    if state.facts.eye_distance is not None:
        return state.facts.eye_distance.value_m
    return _number((state.results or {}).get("eye_distance_m") if state.is_solved else None)


def _notes(path: Path, state: SessionState) -> str:
    """Return the notes in one line, without checking them; empty if there are none."""
    if state.notes_sha256 in ((), ("",)):
        return ""
    try:
        data = read_limited(path / "notes.txt", 4 * MAX_NOTES_CHARACTERS, path)
    except FileError:
        return ""
    return " ".join(data.decode(errors="replace").split())[:_NOTES_CHARACTERS]


def _damaged_files(path: Path, state: SessionState) -> int:
    """Return the number of files whose checksum is not the journal's, without decoding them."""
    checksums = {**state.alignments.active, **state.alignments.deleted}
    files = {alignment_path(path, number): one for number, one in checksums.items()}
    if state.rig_sha256:
        files[path / "rig.yaml"] = state.rig_sha256
    return sum(not _is_sound(path, file, checksum) for file, checksum in files.items())


def _is_sound(path: Path, file: Path, checksum: str) -> bool:
    try:
        return sha256(read_limited(file, MAX_ALIGNMENT_BYTES, path)) == checksum
    except FileError:
        return False


def _lab_target_arcmin(settings: Mapping[str, Any] | None) -> float | None:
    """Return the lab's target of a session's settings; None if they have none."""
    found: object = settings
    for name in ("calibration", "solve", "verdict", "target_arcmin"):
        found = found.get(name) if isinstance(found, dict) else None
    return _number(found)


def _rig_name(path: Path, state: SessionState) -> str:
    try:
        content = state.rig.encode() or read_limited(path / "rig.yaml", MAX_RIG_BYTES, path)
        return parse_rig(content).name
    except (FileError, ValueError):
        return ""


def _outcome(
    one: Mapping[str, Any],
    trials: EyeTrials | None,
    drawn: DrawnShift | None,
    *,
    is_verified: bool,
) -> EyeOutcome:
    """Return an eye's result; whatever is missing or not a number is unknown."""
    benefit, measured = one.get("benefit"), one.get("measured_arcmin")
    verdict, expected = str(one.get("verdict", "")), benefit if isinstance(benefit, dict) else {}
    before_arcmin = _number(expected.get("without_arcmin"))
    found, left = measured if isinstance(measured, list) and len(measured) == 2 else (None, None)
    is_offline = verdict == "keep" if drawn is None else drawn.kind == "offline"
    return EyeOutcome(
        verdict,
        before_arcmin,
        before_arcmin if is_offline else _number(expected.get("after_arcmin")),
        None if is_offline else _number(left),
        _number(found),
        trials,
        str(drawn or ""),
        drawn.kind if drawn else None,
        is_verified=is_verified
        and found is not None
        and (drawn is None or is_judged(verdict, drawn.kind)),
    )


def _moved_outcome(
    state: SessionState,
    eye: Eye,
    one: Mapping[str, Any],
    trials: EyeTrials | None,
    drawn: DrawnShift,
) -> EyeOutcome:
    """Return the result of an eye whose final φ is neither the solved nor the offline one."""
    expected = None
    with suppress(ValueError, KeyError, TypeError):
        display = parse_rig(state.rig.encode()).eyes[eye]
        solved_m = np.array(one["shift_m"], np.float64)
        covariance_m2 = np.array(one["covariance_m2"], np.float64).reshape(3, 3)
        expected = expected_arcmin(display, solved_m - drawn.shift_m, covariance_m2)
    outcome = _outcome(one, trials, drawn, is_verified=False)
    return replace(outcome, expected_arcmin=_number(expected), remaining_arcmin=None)


def _number(value: object) -> float | None:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and math.isfinite(value) else None  # type: ignore[arg-type]


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
    is_worth_resuming: bool = False
    """As in `SessionRecord`."""
    damaged: int = 0
    """Number of damaged parts, which are left out when it is resumed."""
    problem: str = ""
    """Reason why it cannot be resumed, such as another program; empty if it can."""
    advice: str = ""
    """Advice, if the reason gives one; empty if none."""
    is_repaired: bool = False
    """True if a repaired copy of this damaged session is in the same folder."""


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
    return UnfinishedSession(
        path,
        started,
        record.wearer,
        len(record.alignments),
        len(record.trials),
        len(record.facts.verified),
        record.is_worth_resuming,
        len(record.damaged),
        is_repaired=bool(record.damaged) and has_copy,
    )
