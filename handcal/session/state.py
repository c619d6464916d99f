"""The state of a session, built by replaying its journal. No file access."""

from __future__ import annotations

import hashlib
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from enum import StrEnum
from types import MappingProxyType
from typing import Any, Generic, Literal, TypeAlias, TypeVar

import numpy as np

from handcal.core.display import as_shifts
from handcal.core.errors import FileError
from handcal.core.types import (
    EYES,
    CameraIdentity,
    Eye,
    EyeDistance,
    EyePlan,
    Float64,
    HeadsetIdentity,
    Intrinsics,
    PlanName,
    Verification,
)
from handcal.io.settings import read_settings
from handcal.session.journal import Event
from handcal.session.trial import COMPARED, Trial, read_trial

Facts = TypeVar("Facts")


@dataclass(frozen=True, slots=True)
class CameraUsed:
    """The depth camera of a session; ValueError if its intrinsics are not of an image."""

    identity: CameraIdentity
    depth_intrinsics: Intrinsics
    depth_scale_m: float
    """Metres per unit of the depth image."""

    def __post_init__(self) -> None:
        one = self.depth_intrinsics
        sizes = one.width, one.height, one.fx, one.fy, self.depth_scale_m
        if not all(0 < size < np.inf for size in sizes):
            raise ValueError("the camera's size, focal lengths and depth scale must be positive")


@dataclass(frozen=True, slots=True)
class AlignmentFacts:
    """Circumstances of one alignment; None where unknown. ValueError if a value is negative."""

    match_age_s: float | None = None
    """Time between the confirmation and the depth frame taken for it."""
    cursor_moved_m: float | None = None
    hand_moved_m: float | None = None
    """Movement of the hand while the cursor was frozen, and while the wearer confirmed."""
    shape_change_m: float | None = None
    """Root mean square change of the hand's shape from the cursor to the confirmation."""

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            if value is not None and value < 0.0:
                raise ValueError(f"{one.name} must not be negative")


@dataclass(frozen=True, slots=True, eq=False)
class SessionFacts:
    """Facts about a session; None or empty where unknown."""

    camera: CameraUsed | None = None
    headset: HeadsetIdentity | None = None
    plan: EyePlan | PlanName | None = None
    """The plan that was followed, or only the order in which the eyes were aligned."""
    usable_eyes: tuple[Eye, ...] = EYES
    """The eyes that the plan calibrates: only one for a wearer who sees with one eye."""
    former: str = ""
    """Name of the session whose φ this one started from; empty if there is none."""
    eye_distance: EyeDistance | None = None
    """Measured; the results were solved with it."""
    verified: Mapping[Eye, Verification] = field(default_factory=dict)
    """Newest verification of each eye."""
    evidence: tuple[str, ...] = ()
    contradictions: tuple[str, ...] = ()
    """Names of what supports and what contradicts the results."""

    def __post_init__(self) -> None:
        if not self.usable_eyes or len(set(self.usable_eyes)) < len(self.usable_eyes):
            raise ValueError("usable_eyes must name one eye, or both once")
        object.__setattr__(self, "verified", MappingProxyType(dict(self.verified)))


def facts_json(facts: Any) -> Any:
    """Return a dataclass, or a mapping of facts by name, as JSON-able values."""
    if is_dataclass(facts):
        return {one.name: facts_json(getattr(facts, one.name)) for one in fields(facts)}
    if isinstance(facts, Mapping):
        return {name: facts_json(fact) for name, fact in facts.items()}
    if isinstance(facts, np.ndarray):
        return facts.tolist()
    if isinstance(facts, tuple | list):
        return [facts_json(fact) for fact in facts]
    return facts


def with_facts(before: SessionFacts, data: Mapping[str, Any]) -> SessionFacts:
    """Return facts with those in `data`, as `facts_json` gives them, in place of earlier ones.

    Raises
    ------
    ValueError
        If anything in `data` is missing, unknown or invalid.
    """
    facts = read_facts(SessionFacts, data)
    changes = {name: getattr(facts, name) for name in data}
    if "verified" in changes:
        changes["verified"] = {**before.verified, **changes["verified"]}
    return replace(before, **changes)


def read_facts(kind: type[Facts], data: object) -> Facts:
    """Return a dataclass from what `facts_json` gives; ValueError if it is invalid."""
    try:
        return read_settings(kind, data, "facts")
    except (FileError, TypeError) as error:  # TypeError: a field is missing
        raise ValueError(str(error)) from error


MAX_ALIGNMENTS = 100
MAX_TRIALS = 1000
_DELETED_LIMIT = 10
"""Largest ratio of all items saved, deleted ones too, to those that are not deleted."""
MAX_WEARER_CHARACTERS = 100

Kind: TypeAlias = Literal["alignment", "trial"]
"""Items of a session that can be deleted and restored."""

Item = TypeVar("Item")


class SessionEvent(StrEnum):
    """The events that a session writes itself and that make up its state."""

    CREATED = "created"
    REPAIRED = "repaired"
    """In a copy of a damaged session: its numbers have gaps."""
    COPIED = "copied"
    """The last event of such a copy: the results and the notes that it holds."""
    NOTES_SAVED = "notes_saved"
    WEARER_CORRECTED = "wearer_corrected"
    FACTS_SAVED = "facts_saved"
    ALIGNMENT_SAVED = "alignment_saved"
    ALIGNMENT_DELETED = "alignment_deleted"
    ALIGNMENT_RESTORED = "alignment_restored"
    TRIAL_SAVED = "trial_saved"
    TRIAL_DELETED = "trial_deleted"
    TRIAL_RESTORED = "trial_restored"
    SOLVED = "solved"
    APPLIED = "applied"
    FINE_TUNED = "fine_tuned"
    FINISHED = "finished"


WENT_BACK = "went_back"
"""The station's event before φ is recorded to which the headset was set back."""

ASIDE = (
    SessionEvent.NOTES_SAVED,
    SessionEvent.WEARER_CORRECTED,
    SessionEvent.COPIED,
    SessionEvent.TRIAL_SAVED,
    SessionEvent.TRIAL_DELETED,
    SessionEvent.TRIAL_RESTORED,
    SessionEvent.FINE_TUNED,
    WENT_BACK,
    COMPARED,
)
"""Events after which a finished session stays finished: of its user test, and corrections."""

VERIFYING = "verifying"
"""The station's event at the start of a verification and after each nudge."""


@dataclass(slots=True, eq=False)
class NumberedItems(Generic[Item]):
    """Items numbered from 1 that can be deleted and restored; a number is never used twice."""

    kind: Kind
    limit: int
    """Most active items."""
    active: dict[int, Item] = field(default_factory=dict)
    deleted: dict[int, Item] = field(default_factory=dict)
    taken: int = 0
    """Numbers up to this one are not used again, even if their items are unknown."""
    has_gaps: bool = False
    """True if numbers may be missing, because the session is or was damaged."""

    def last(self) -> int:
        """Return the greatest number given so far; 0 if there is none."""
        return max((self.taken, *self.active, *self.deleted))

    def next_number(self) -> int:
        """Return the number of the next item; ValueError if there are too many."""
        number = 1 + self.last()
        if len(self.active) >= self.limit or number > _DELETED_LIMIT * self.limit:
            raise ValueError(f"no room for more than {self.limit} {self.kind}s")
        return number

    def save(self, number: int, item: Item) -> None:
        """Add an item; ValueError unless its number is the next one, or later with gaps."""
        first, last = self.next_number(), _DELETED_LIMIT * self.limit
        if not first <= number <= (last if self.has_gaps else first):
            raise ValueError(f"{self.kind} {number} is not the next")
        self.active[number] = item

    def require_active(self, number: int) -> None:
        """Raise ValueError unless there is an active item of this number."""
        if number not in self.active:
            raise ValueError(f"there is no {self.kind} {number}")

    def require_deleted(self, number: int) -> None:
        """Raise ValueError unless there is a deleted item of this number."""
        if number not in self.deleted:
            raise ValueError(f"there is no deleted {self.kind} {number}")
        if len(self.active) >= self.limit:
            raise ValueError(f"no room for more than {self.limit} {self.kind}s")

    def delete(self, number: int) -> None:
        """Delete an active item; ValueError if there is none."""
        self.require_active(number)
        self.deleted[number] = self.active.pop(number)

    def restore(self, number: int) -> None:
        """Restore a deleted item to its place; ValueError if there is none, or no room."""
        self.require_deleted(number)
        self.active = dict(sorted({**self.active, number: self.deleted.pop(number)}.items()))


@dataclass(slots=True, eq=False)
class SessionState:
    """The state of a session after the events applied so far."""

    rig: str = ""
    """Content of the rig file; empty if the first line of the journal is lost."""
    rig_sha256: str = ""
    """Its checksum."""
    settings: dict[str, Any] | None = None
    """None if that line is lost."""
    wearer: str = ""
    former_wearers: list[str] = field(default_factory=list)
    """Names before each correction."""
    notes_sha256: tuple[str | None, ...] = ()
    """Checksums of the notes that may be stored: the newest, and those before; an empty text if
    there are none. Empty if unknown."""
    results: dict[str, Any] | None = None
    """The newest results."""
    older_results: list[dict[str, Any]] = field(default_factory=list)
    """Those before."""
    facts: SessionFacts = field(default_factory=SessionFacts)
    alignment_facts: dict[int, AlignmentFacts] = field(default_factory=dict)
    alignments: NumberedItems[str] = field(
        default_factory=lambda: NumberedItems("alignment", MAX_ALIGNMENTS)
    )
    """Checksums."""
    trials: NumberedItems[Trial] = field(default_factory=lambda: NumberedItems("trial", MAX_TRIALS))
    is_solved: bool = False
    is_applied: bool = False
    is_finished: bool = False
    applied_shift_m: dict[Eye, Float64] = field(default_factory=dict)
    fine_tuned: dict[Eye, Float64] | None = None
    """These five as in `handcal.session.session.SessionRecord`."""
    _verified_with: dict[Eye, frozenset[int]] = field(default_factory=dict)
    _by_hand: dict[Eye, Float64] = field(default_factory=dict)
    _is_going_back: bool = False
    _is_back: bool = False

    @property
    def verified_now(self) -> frozenset[Eye]:
        """The eyes verified with the present alignments."""
        now = frozenset(self.alignments.active)
        return frozenset(eye for eye, then in self._verified_with.items() if then == now)

    @property
    def set_by_hand_m(self) -> dict[Eye, Float64]:
        """Each (3,); φ last set by hand since the results, of the eyes that are drawn with it."""
        drawn, by_hand = self.fine_tuned or {}, self._by_hand
        return {eye: m for eye, m in drawn.items() if eye in by_hand and (m == by_hand[eye]).all()}

    @property
    def went_back(self) -> bool:
        """True if φ was last set by going back, and not for every eye to one set by hand."""
        return self._is_back and len(self.set_by_hand_m) < len(self.fine_tuned or {})

    def items(self, kind: Kind) -> NumberedItems[Any]:
        """Return the alignments or the trials."""
        return self.alignments if kind == "alignment" else self.trials

    def apply(self, event: Event) -> None:
        """Apply an event; only those of `SessionEvent` change the state.

        Raises
        ------
        ValueError
            If the event lacks data, or cannot follow the events before it.
        """
        try:
            self._apply(event.name, event.data, event.time)
        except KeyError as error:
            raise ValueError(f"{event.name} lacks {error}") from error
        except (TypeError, AttributeError, OverflowError) as error:
            raise ValueError(f"{event.name} contains invalid data: {error}") from error
        if event.name not in ASIDE:
            self.is_finished = event.name == SessionEvent.FINISHED

    def _apply(self, name: str, data: dict[str, Any], time: str) -> None:
        match name:
            case SessionEvent.CREATED:
                self._bind(data["rig"], data["settings"])
                self.wearer = clean_wearer(data.get("wearer", ""))
            case SessionEvent.REPAIRED:
                self.alignments.has_gaps = self.trials.has_gaps = True
            case SessionEvent.COPIED:
                self.notes_sha256 = (data["notes_sha256"],)
                self._set_results(data["results"])
                if not data["is_solved"]:
                    self.is_solved = self.is_applied = False
            case SessionEvent.NOTES_SAVED:
                self.notes_sha256 = data["sha256"], data["before_sha256"]
            case SessionEvent.WEARER_CORRECTED:
                former = clean_wearer(data["before"])
                self.wearer = clean_wearer(data["wearer"])
                self.former_wearers.append(former)
            case SessionEvent.FACTS_SAVED:
                before, self.facts = self.facts, with_facts(self.facts, data)
                now = dict.fromkeys(data.get("verified", ()), frozenset(self.alignments.active))
                self._verified_with.update(now)
                is_same = (
                    self.facts.eye_distance == before.eye_distance
                    and self.facts.usable_eyes == before.usable_eyes
                    and dict(self.facts.verified) == dict(before.verified)
                )
                if not is_same:
                    self.is_solved = self.is_applied = False
                    self._set_results(None)
            case SessionEvent.ALIGNMENT_SAVED:
                facts = read_facts(AlignmentFacts, data.get("facts", {}))
                self.alignments.save(_number(data), data["sha256"])
                self.alignment_facts[_number(data)] = facts
            case SessionEvent.ALIGNMENT_DELETED:
                self.alignments.delete(_number(data))
            case SessionEvent.ALIGNMENT_RESTORED:
                self.alignments.restore(_number(data))
            case SessionEvent.TRIAL_SAVED:
                self.trials.save(_number(data), read_trial(data["trial"], time))
            case SessionEvent.TRIAL_DELETED:
                self.trials.delete(_number(data))
            case SessionEvent.TRIAL_RESTORED:
                self.trials.restore(_number(data))
            case SessionEvent.SOLVED:
                self._set_results(data)
                self.is_solved, self.is_applied, self.fine_tuned = True, False, None
                self._by_hand = {}
            case SessionEvent.APPLIED:
                self.applied_shift_m |= as_shifts(data["shift_m"])
                self.is_applied = self.is_solved
            case SessionEvent.FINE_TUNED:
                # After a slip, φ of the session before is recorded first.
                is_former = bool(self.facts.former) and not self.applied_shift_m
                self.fine_tuned = as_shifts(data["shift_m"])
                self.applied_shift_m |= self.fine_tuned
                self._is_back, self._is_going_back = self._is_going_back, False
                if not (self._is_back or is_former):
                    self._by_hand = self.fine_tuned
        if name == WENT_BACK:
            self._is_going_back = True
        if name.startswith("alignment_"):
            self.is_solved = self.is_applied = False
        if name in (SessionEvent.ALIGNMENT_DELETED, SessionEvent.ALIGNMENT_RESTORED):
            self._set_results(None)

    def _bind(self, rig: str, settings: object) -> None:
        """Take the rig and the settings from an event."""
        if not isinstance(settings, dict):
            raise TypeError("the settings are not an object")
        self.rig_sha256 = hashlib.sha256(rig.encode()).hexdigest()
        self.rig, self.settings = rig, settings
        self.notes_sha256 = ("",)

    def _set_results(self, results: Any) -> None:
        if not isinstance(results, dict | None):
            raise ValueError("its results are no object")
        if self.results is not None:
            self.older_results.append(self.results)
        self.results = results


def _number(data: Mapping[str, Any]) -> int:
    """Return the number in an event, which must be an int: true and 1.0 equal 1 too."""
    number = data["number"]
    if type(number) is not int:
        raise ValueError(f"a number must be whole, not {number!r}")
    return number


def clean_wearer(name: str) -> str:
    """Return a wearer's name or code without surrounding white space.

    Raises
    ------
    ValueError
        If it is longer than 100 characters or contains line breaks or control characters.
    """
    name = name.strip()
    if len(name) > MAX_WEARER_CHARACTERS:
        raise ValueError(f"a wearer's name may have at most {MAX_WEARER_CHARACTERS} characters")
    if any(unicodedata.category(letter) in ("Cc", "Cs", "Zl", "Zp") for letter in name):
        raise ValueError("a wearer's name must not contain line breaks or control characters")
    return name
