"""The sessions listed on the start page, and the text of each."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path

from handcal.core.errors import FileError
from handcal.core.types import Eye
from handcal.io.files import modified_s
from handcal.session.journal import find_journals
from handcal.session.library import EyeOutcome, eye_outcomes
from handcal.session.record import replay
from handcal.session.unfinished import UnfinishedSession, unfinished_and_repaired
from handcal_gui.app.preferences import MOST_RECENT
from handcal_gui.app.translation import tr
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.times import local_time


@dataclass(frozen=True, slots=True)
class Entry:
    """A listed session."""

    path: Path
    text: str
    is_enabled: bool = True
    """True if it can be chosen; otherwise `text` contains the reason."""
    wearer: str = ""
    """Name or code; empty if it is not known."""
    eyes: Mapping[Eye, EyeOutcome] = field(default_factory=dict)
    """Results of the eyes, as far as they are known."""


@dataclass(frozen=True, slots=True)
class KnownSessions:
    """Sessions that can be resumed, and recent sessions that can be opened."""

    unfinished: tuple[Entry, ...]
    recent: tuple[Entry, ...]

    @property
    def wearers(self) -> tuple[str, ...]:
        """The wearers of all these sessions, each once."""
        names = (entry.wearer for entry in (*self.recent, *self.unfinished))
        return tuple(dict.fromkeys(filter(None, names)))


def find_sessions(folder: Path, recent: Sequence[Path]) -> KnownSessions:
    """Return the unfinished sessions in a folder, and the recent ones; may take a while.

    Recent are those opened last, then the newest others in the folder. Left out are empty sessions,
    and damaged ones of which there is a repaired copy: the library names both.
    """
    unfinished, repaired = unfinished_and_repaired(folder)
    listed = {path.absolute() for path in (*recent, *(session.path for session in unfinished))}
    journals = sorted(find_journals(folder), key=modified_s, reverse=True)
    others = (path.parent for path in journals if path.parent.absolute() not in listed)
    hidden = {path.absolute() for path in repaired}
    found = (path for path in chain(recent, others) if path.absolute() not in hidden)
    offered = (_recent(path) for path in found if os.path.exists(path))
    return KnownSessions(
        unfinished=tuple(
            _unfinished(session)
            for session in unfinished
            if not session.is_repaired and (session.problem or session.is_worth_resuming)
        ),
        recent=tuple(islice((entry for entry in offered if entry is not None), MOST_RECENT)),
    )


def _unfinished(session: UnfinishedSession) -> Entry:
    if session.problem:
        return _unreadable(session.path, session.problem, session.advice)
    counts = _counts(session)
    text = _text(session.wearer, session.started, *counts)
    if not any(counts):
        text += tr(" · verification begun")
    if session.damaged:
        text += tr(" · damaged: {} left out").format(
            pluralize(session.damaged, tr("part"), tr("parts"))
        )
    return Entry(session.path, text, wearer=session.wearer)


def _counts(session: UnfinishedSession) -> tuple[int, int, int]:
    return session.alignments, session.verified, session.trials


def _recent(path: Path) -> Entry | None:
    try:
        replayed = replay(path)
    except FileError as error:
        return _unreadable(path, error.what, error.advice)
    state, events = replayed.state, replayed.journal.events
    alignments, trials = state.alignments, state.trials
    held = alignments.active, alignments.deleted, trials.active, trials.deleted
    if not (any(held) or state.facts.verified):
        return None
    counts = len(alignments.active), len(state.facts.verified), len(trials.active)
    text = _text(state.wearer, events[0].time, *counts)
    return Entry(path, text, wearer=state.wearer, eyes=eye_outcomes(state))


def _unreadable(path: Path, why: str, advice: str) -> Entry:
    """Return a session that cannot be chosen, with the reason and what to do."""
    named = why.replace(str(path), path.name)
    text = named if path.name in named else f"{path.name}: {named}"
    otherwise = tr("make it readable, restore it from a backup, or delete it in All sessions")
    return Entry(path, f"{text}; {advice or otherwise}", is_enabled=False)


def _text(wearer: str, started: str, alignments: int, verified: int, trials: int) -> str:
    held = (
        (alignments, tr("alignment"), tr("alignments")),
        (0 if alignments else verified, tr("verified eye"), tr("verified eyes")),
        (trials, tr("trial"), tr("trials")),
    )
    counts = ", ".join(pluralize(*one) for one in held if one[0])
    return " · ".join(filter(None, (wearer or tr("Without a name"), local_time(started), counts)))
