"""A session's life of random operations, and what must be in the folder after each of them.

A model says what the session holds. An operation that has returned must be in the folder, one that
was interrupted may be or not, and nothing else may differ.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from handcal.core.errors import FileError
from handcal.io.resources import resource_path
from handcal.session.session import Session, SessionRecord

Operation: TypeAlias = tuple[str, Any]

EXAMPLE = Session.open(resource_path("example_session"))
MOST_ALIGNMENTS = 12
KEPT = "add", "delete", "restore", "solve", "tune", "plan"
"""Operations that a session keeps in memory if it cannot write them."""
_OPERATIONS = "add", "add", "trial", "delete", "restore", "solve", "tune", "notes", "plan", "reopen"


@dataclass(frozen=True, slots=True)
class Model:
    """The contents of a session."""

    kept: frozenset[int] = frozenset()
    deleted: frozenset[int] = frozenset()
    """Alignments."""
    trials: int = 0
    notes: str = ""
    shift_m: float | None = None
    is_solved: bool = False
    plan: str | None = None


def draw(chance: random.Random, model: Model) -> Operation:
    """Draw an operation that the model allows."""
    kind = chance.choice(_OPERATIONS)
    match kind:
        case "delete" if model.kept:
            return kind, chance.choice(sorted(model.kept))
        case "restore" if model.deleted and len(model.kept) < MOST_ALIGNMENTS:
            return kind, chance.choice(sorted(model.deleted))
        case "delete" | "restore" | "add" if len(model.kept) < MOST_ALIGNMENTS:
            return "add", None
        case "tune":
            return kind, chance.randint(1, 20) / 1000
        case "notes":
            return kind, "n" * chance.randint(1, 9000)
        case "plan":
            return kind, chance.choice(("paper", "recommended"))
        case "solve" | "trial" | "reopen":
            return kind, None
    return "trial", None


def after(model: Model, operation: Operation) -> Model:
    """Return the contents after an operation."""
    kind, value = operation
    match kind:
        case "add":
            number = max(model.kept | model.deleted, default=0) + 1
            return replace(model, kept=model.kept | {number}, is_solved=False)
        case "delete":
            kept, deleted = model.kept - {value}, model.deleted | {value}
            return replace(model, kept=kept, deleted=deleted, is_solved=False)
        case "restore":
            kept, deleted = model.kept | {value}, model.deleted - {value}
            return replace(model, kept=kept, deleted=deleted, is_solved=False)
        case "trial":
            return replace(model, trials=model.trials + 1)
        case "solve":
            return replace(model, is_solved=True)
        case "tune":
            return replace(model, shift_m=value)
        case "notes":
            return replace(model, notes=value)
        case "plan":
            return replace(model, plan=value)
    return model


def do(session: Session, operation: Operation) -> Session:
    """Do an operation; return the session, which ``reopen`` opens again."""
    kind, value = operation
    match kind:
        case "add":
            session.save_alignment(EXAMPLE.alignments[1])
        case "delete":
            session.delete("alignment", value)
        case "restore":
            session.restore("alignment", value)
        case "trial":
            session.save_trial(EXAMPLE.trials[1])
        case "solve":
            session.save_results(_results(session.contents))
        case "tune":
            session.save_fine_tuned({"left": [value, 0.0, 0.0]})
        case "notes":
            session.save_notes(value)
        case "plan":
            session.save_facts(plan=value)
        case "reopen":
            session.close()
            return Session(session.path)
    return session


def found(record: SessionRecord) -> Model:
    """Return the contents of a session as read; alignments with other contents do not count."""
    kept = {number for number, one in record.alignments.items() if _is_whole(one)}
    deleted = {number for number, one in record.deleted_alignments.items() if _is_whole(one)}
    shift_m = record.applied_shift_m.get("left")
    return Model(
        frozenset(kept),
        frozenset(deleted),
        len(record.trials),
        record.notes,
        None if shift_m is None else float(shift_m[0]),
        record.is_solved and record.results == _results(record),
        record.facts.plan,
    )


def _results(record: SessionRecord) -> dict[str, Any]:
    """Return the example's results as if they were of the session's alignments."""
    example = dict(EXAMPLE.results or {})
    return example | {"alignments": example["alignments"][:1] * len(record.alignments)}


def _is_whole(alignment: Any) -> bool:
    whole = EXAMPLE.alignments[1]
    return np.array_equal(alignment.hand_m, whole.hand_m) and np.array_equal(
        alignment.cursor_m, whole.cursor_m
    )


def complaint(path: Path, possible: set[Model]) -> str:
    """Return the difference of a session from all it may hold, or its damage; or nothing."""
    try:
        record = Session.open(path)
    except FileError as error:
        return f"unreadable: {error}"
    if record.damaged:
        return f"damaged: {record.left_out}"
    now = found(record)
    if now in possible:
        return ""
    nearest = min(possible, key=lambda one: len(list(_differences(one, now))))
    return f"lost or changed: {', '.join(_differences(nearest, now))}"


def _differences(wanted: Model, now: Model) -> Iterator[str]:
    for name in Model.__slots__:
        one, other = getattr(wanted, name), getattr(now, name)
        if one != other:
            yield f"{name} {str(one)[:40]} became {str(other)[:40]}"
