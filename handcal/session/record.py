"""Reading of a session: only what is damaged is lost, and it is reported."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from handcal.core.errors import FileError
from handcal.core.types import Alignment, Eye, Float64, Rig
from handcal.io.files import read_json, read_limited
from handcal.register.results import Results, read_rendered_shift_m
from handcal.register.solve import check_alignment
from handcal.rig.rig_file import MAX_RIG_BYTES, parse_rig
from handcal.session.alignment_file import decode_alignment
from handcal.session.journal import (
    JOURNAL,
    Damage,
    Event,
    JournalContent,
    read_journal,
)
from handcal.session.state import (
    VERIFYING,
    AlignmentFacts,
    SessionEvent,
    SessionFacts,
    SessionState,
)
from handcal.session.trial import EyeTrials, Trial, judge_trials, trial_errors_arcmin

MAX_ALIGNMENT_BYTES = 16 * 2**20
MAX_NOTES_CHARACTERS = 20_000


@dataclass(frozen=True, slots=True, eq=False)
class SessionRecord:
    """The contents of a session folder.

    Attributes
    ----------
    path
        The session's folder.
    rig
        The rig of the session.
    settings
        The contents of ``settings.json``.
    wearer
        Name or code; empty if none was given.
    notes
        Free text; empty if there is none.
    events
        The journal, oldest first.
    alignments
        The alignments that are not deleted, by number, in the order in which they were saved.
    deleted_alignments
        The deleted ones, likewise.
    trials
        Trials of the user test that are not deleted, by number.
    deleted_trials
        The deleted ones, likewise.
    results
        The newest results; None if none were saved since an alignment was deleted or restored, or
        the eye distance or a verification was changed.
    is_solved
        True if the results are those of all `alignments`.
    is_applied
        True if the headset has acknowledged the projections of these results.
    applied_shift_m
        each (3,); the φ that the headset rendered with last, solved or set by hand; a missing eye
        was rendered with the offline calibration.
    fine_tuned
        each (3,); the φ last set by hand; None if none was set since the last results.
    is_finished
        True if the session was finished, and nothing but `ASIDE` was recorded since.
    journal_bytes
        Length of the journal's complete lines.
    torn_bytes
        Length of an incomplete last line, which is ignored; 0 if there is none.
    facts
        What was measured or chosen in the session: eye distance, plan, camera, headset,
        verifications.
    verified_now
        Eyes verified with the present alignments.
    alignment_facts
        Of each alignment, deleted ones too.
    last_alignment
        Greatest number of an alignment, lost ones too; the next one is greater.
    set_by_hand_m
        each (3,); φ last set by hand since the results, of the eyes that are drawn with it.
    went_back
        True if φ was last set by going back, and not for every eye to one set by hand.
    damaged
        Parts that are damaged; their contents are missing here, or were read from a copy.
    unwritten
        The events that could not be written yet, and are only in the program's memory.
    """

    path: Path
    rig: Rig
    settings: dict[str, Any]
    wearer: str
    notes: str
    events: tuple[Event, ...]
    alignments: Mapping[int, Alignment]
    deleted_alignments: Mapping[int, Alignment]
    trials: Mapping[int, Trial]
    deleted_trials: Mapping[int, Trial]
    results: dict[str, Any] | None
    is_solved: bool
    is_applied: bool
    applied_shift_m: Mapping[Eye, Float64]
    fine_tuned: Mapping[Eye, Float64] | None
    is_finished: bool
    journal_bytes: int
    torn_bytes: int
    facts: SessionFacts = field(default_factory=SessionFacts)
    verified_now: frozenset[Eye] = frozenset()
    alignment_facts: Mapping[int, AlignmentFacts] = field(default_factory=dict)
    last_alignment: int = 0
    set_by_hand_m: Mapping[Eye, Float64] = field(default_factory=dict)
    went_back: bool = False
    damaged: tuple[Damage, ...] = ()
    unwritten: tuple[Event, ...] = ()

    @property
    def is_solvable(self) -> bool:
        """True if it holds an alignment or a verification; a slipped headset is only verified.

        A verification in which nothing was moved, or whose place is unknown, is no evidence.
        """
        return bool(self.alignments) or any(
            one.was_moved and one.hand_E_m is not None
            for newest in self.facts.verified.values()
            for one in (*newest.earlier, newest)
        )

    @property
    def is_worth_resuming(self) -> bool:
        """True if it holds an alignment, a trial or a verification, be it one only begun."""
        is_verifying = any(event.name == VERIFYING for event in self.events)
        return bool(self.alignments or self.trials or self.facts.verified or is_verifying)

    @property
    def simulated(self) -> str:
        """Parts of the session that were simulated, in words; empty if all was real."""
        return simulated_parts(self.settings)

    @property
    def refused(self) -> int:
        """Number of confirmations refused, for any reason."""
        return sum(event.name == "refused" for event in self.events)

    @property
    def left_out(self) -> str:
        """The damage in one line; empty if the session is sound."""
        if not self.damaged:
            return ""
        more = f" (and {len(self.damaged) - 1} more)" if len(self.damaged) > 1 else ""
        return f"the session is damaged: {self.damaged[0]}{more}"

    def __repr__(self) -> str:
        counts = f"{len(self.alignments)} alignments, {len(self.trials)} trials"
        damaged = f", {len(self.damaged)} parts damaged" if self.damaged else ""
        return f"<SessionRecord {self.path}: {counts}{damaged}>"


def eye_trials(
    results: Results, record: SessionRecord, target_arcmin: float
) -> dict[Eye, EyeTrials]:
    """Return the trials of a session's results, of each eye that has some.

    Stored results count, too, if they are of all alignments: another version may have solved them
    with another φ.
    """
    stored_m = read_rendered_shift_m(record.results if record.is_solved else None)
    trials = (one for one in record.trials.values() if one.eye in results.eyes)
    errors = trial_errors_arcmin(trials, results.rendered_shift_m, stored_m)
    return judge_trials(errors, target_arcmin)


def simulated_parts(settings: Mapping[str, Any]) -> str:
    """Return the parts that a session's settings simulate, in words; empty if all was real."""
    station = settings.get("station")
    if not isinstance(station, dict):
        return ""
    parts = (("source", "simulator", "camera"), ("headset", "virtual", "headset and wearer"))
    return ", ".join(what for name, value, what in parts if station.get(name) == value)


@dataclass(frozen=True, slots=True, eq=False)
class Replayed:
    """A session's journal, and the state that its events lead to."""

    journal: JournalContent
    state: SessionState
    damaged: tuple[Damage, ...]
    """Those of the journal, and the events that cannot follow those before."""


def replay(path: Path) -> Replayed:
    """Read the journal of the session in a folder.

    Raises
    ------
    FileError
        If the folder is not a session, or its journal is unreadable as a whole.
    """
    try:
        is_session = (path / JOURNAL).is_file()
    except OSError as error:
        raise FileError(f"cannot read {path}: {error.strerror or error}") from error
    if not is_session:
        raise FileError(f"{path} is not a session", f"choose the folder that contains {JOURNAL}")
    journal = read_journal(path / JOURNAL)
    damaged = list(journal.damaged)
    first = journal.events[0]
    if first.number == 1 and first.name != SessionEvent.CREATED:
        raise FileError(f"{path / JOURNAL} does not begin as the journal of a session")
    state = SessionState()
    state.alignments.has_gaps = state.trials.has_gaps = bool(damaged)
    for event in journal.events:
        try:
            state.apply(event)
        except ValueError as error:
            what = f"event {event.number} cannot follow those before it: {error}"
            damaged.append(Damage(JOURNAL, event.number, what, "left out"))
            state.alignments.has_gaps = state.trials.has_gaps = True
    if damaged:  # a number may be that of an alignment whose event is lost
        stored = (one.stem for one in path.glob("alignments/*.npz"))
        taken = (int(name) for name in stored if name.isdecimal() and len(name) < 4)
        state.alignments.taken = max(taken, default=0)
    return Replayed(journal, state, tuple(damaged))


@dataclass(slots=True, eq=False)
class LoadedSession:
    """The parts of which `SessionRecord` is made; a session in use changes them as it writes."""

    path: Path
    rig: Rig
    settings: dict[str, Any]
    notes: str
    notes_sha256: str | None
    """Empty without notes, None if they are damaged."""
    state: SessionState
    events: list[Event]
    alignments: dict[int, Alignment]
    """All that are sound, deleted ones too."""
    journal: JournalContent
    """As read."""
    damaged: tuple[Damage, ...]

    def contents(self, unwritten: int = 0) -> SessionRecord:
        """Return the contents as they are now; `unwritten` events are not on disk yet."""
        state = self.state
        active, deleted = (
            MappingProxyType({n: self.alignments[n] for n in those if n in self.alignments})
            for those in (state.alignments.active, state.alignments.deleted)
        )
        is_complete = state.results is not None and len(active) == _solved_count(state)
        return SessionRecord(
            path=self.path,
            rig=self.rig,
            settings=self.settings,
            wearer=state.wearer,
            notes=self.notes,
            events=tuple(self.events),
            alignments=active,
            deleted_alignments=deleted,
            trials=MappingProxyType(dict(state.trials.active)),
            deleted_trials=MappingProxyType(dict(state.trials.deleted)),
            results=state.results,
            is_solved=state.is_solved and is_complete,
            is_applied=state.is_applied and is_complete,
            applied_shift_m=MappingProxyType(dict(state.applied_shift_m)),
            fine_tuned=state.fine_tuned and MappingProxyType(state.fine_tuned),
            set_by_hand_m=MappingProxyType(state.set_by_hand_m),
            went_back=state.went_back,
            is_finished=state.is_finished,
            journal_bytes=self.journal.complete_bytes,
            torn_bytes=self.journal.torn_bytes,
            facts=state.facts,
            verified_now=state.verified_now,
            alignment_facts=MappingProxyType(dict(state.alignment_facts)),
            last_alignment=state.alignments.last(),
            damaged=self.damaged,
            unwritten=tuple(self.events[len(self.events) - unwritten :]),
        )


def _solved_count(state: SessionState) -> int:
    """Return the number of alignments that the results were solved from.

    It is less than the journal's if some were lost before, and greater if some are lost since.
    """
    solved = (state.results or {}).get("alignments")
    return len(solved) if isinstance(solved, list) else len(state.alignments.active)


def load_session(path: Path, rig: Rig | None = None) -> LoadedSession:
    """Read a session once; the parameters and errors are those of `Session.open`."""
    replayed = replay(path)
    journal, state = replayed.journal, replayed.state
    damaged = list(replayed.damaged)
    rig = _read_rig(path, state, damaged) if rig is None else rig
    checksums = {**state.alignments.active, **state.alignments.deleted}
    alignments = _read_alignments(path, checksums, damaged)
    _check_results(path / "results.json", state, damaged)
    settings = _read_settings(path / "settings.json", state, damaged)
    notes, notes_sha256 = _read_notes(path / "notes.txt", _notes_checksums(replayed), damaged)
    return LoadedSession(
        path=path,
        rig=rig,
        settings=settings,
        notes=notes,
        notes_sha256=notes_sha256,
        state=state,
        events=list(journal.events),
        alignments=alignments,
        journal=journal,
        damaged=tuple(damaged),
    )


def alignment_path(path: Path, number: int) -> Path:
    """Return the file of an alignment of the session in `path`."""
    return path / "alignments" / f"{number}.npz"


def sha256(data: bytes) -> str:
    """Return the checksum by which the journal knows a file."""
    return hashlib.sha256(data).hexdigest()


def _read_rig(path: Path, state: SessionState, damaged: list[Damage]) -> Rig:
    """Return the rig: from its file, or from the journal's copy if there is one.

    Raises
    ------
    FileError
        If the file is damaged and there is no copy.
    """
    file = path / "rig.yaml"
    try:
        data = read_limited(file, MAX_RIG_BYTES, path)
        rig = parse_rig(data)
        if state.rig_sha256 not in (sha256(data), ""):
            raise ValueError("its checksum is not the journal's")
    except (FileError, ValueError) as error:
        if not state.rig:
            raise FileError(
                f"{file} is damaged: {error}",
                "repair the session with another copy of the rig file",
            ) from error
        damaged.append(Damage("rig.yaml", None, str(error), "the journal's copy was read"))
        try:
            return parse_rig(state.rig.encode())
        except ValueError as worse:
            raise FileError(
                f"{file} and its copy in the journal are damaged: {worse}",
                "repair the session with another copy of the rig file",
            ) from worse
    if not state.rig_sha256:
        damaged.append(Damage("rig.yaml", None, "its checksum, in the journal, is lost"))
    return rig


def _read_settings(file: Path, state: SessionState, damaged: list[Damage]) -> dict[str, Any]:
    """Return the settings of the journal, or of the file if the journal's first line is lost."""
    try:
        settings = read_json(file, file.parent)
        if state.settings is not None and settings != state.settings:
            raise FileError(f"{file} is not what the journal holds")
    except FileError as error:
        used = "nothing was read" if state.settings is None else "the journal's copy was read"
        damaged.append(Damage(file.name, None, str(error), used))
        return state.settings or {}
    return settings if state.settings is None else state.settings


def _check_results(file: Path, state: SessionState, damaged: list[Damage]) -> None:
    """Compare the file of the results with the journal."""
    try:
        results = read_json(file, file.parent) if os.path.lexists(file) else None
        # A killed program may leave the file of earlier results.
        if results not in (None, state.results, *state.older_results):
            raise FileError(f"{file} is not what the journal holds")
    except FileError as error:
        damaged.append(Damage(file.name, None, str(error), "the journal's copy was read"))


def _notes_checksums(replayed: Replayed) -> tuple[str | None, ...]:
    """Return the checksums that the notes may have; empty if unknown."""
    journal = replayed.journal
    saved = [event.number for event in journal.events if event.name == SessionEvent.NOTES_SAVED]
    if journal.notes_sha256 is not None and max(saved, default=0) <= journal.ended:
        return (journal.notes_sha256,)
    return replayed.state.notes_sha256


def _read_notes(
    file: Path, checksums: tuple[str | None, ...], damaged: list[Damage]
) -> tuple[str, str | None]:
    """Return the notes and their checksum: empty without notes, None if they are damaged."""
    data, found = b"", ""
    try:
        if os.path.lexists(file):
            data = read_limited(file, 4 * MAX_NOTES_CHARACTERS, file.parent)
            found = sha256(data)
        if checksums and found not in checksums:
            raise FileError("its checksum is not the journal's")
    except FileError as error:
        used = "it was read as it is" if found else "nothing was read"
        damaged.append(Damage(file.name, None, str(error), used))
        return data.decode(errors="replace"), None
    return data.decode(errors="replace"), found


def _read_alignments(
    path: Path, checksums: Mapping[int, str], damaged: list[Damage]
) -> dict[int, Alignment]:
    """Return those of the alignments that are sound."""
    alignments = {}
    for number, checksum in checksums.items():
        file = alignment_path(path, number)
        try:
            alignments[number] = _read_alignment(path, file, checksum)
        except (FileError, ValueError) as error:
            name = file.relative_to(path).as_posix()
            damaged.append(Damage(name, None, str(error), f"alignment {number} was left out"))
    return alignments


def _read_alignment(path: Path, file: Path, checksum: str) -> Alignment:
    data = read_limited(file, MAX_ALIGNMENT_BYTES, path)
    if sha256(data) != checksum:
        raise ValueError("its checksum is not the journal's")
    alignment = decode_alignment(data)
    check_alignment(alignment)
    return alignment
