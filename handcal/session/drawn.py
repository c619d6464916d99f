"""The φ of each eye that the headset draws with, and that the export calls final."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from handcal.core.types import EYES, Eye, EyeDisplay, Float64, VerdictName
from handcal.register.benefit import expected_arcmin
from handcal.register.results import USED, Results, read_rendered_shift_m, read_solved_shift_m
from handcal.register.verdict_words import VERDICT_WORDS
from handcal.session.record import SessionRecord
from handcal.session.state import SessionState
from handcal.session.trial import SAME_SHIFT_M

ShiftKind: TypeAlias = Literal["solved", "offline", "set by hand", "earlier"]


@dataclass(frozen=True, slots=True, eq=False)
class DrawnShift:
    """The final φ of one eye."""

    kind: ShiftKind
    """*solved*: of the newest results, whatever their verdict; *offline*: zero; *set by hand*;
    *earlier*: of results before the newest, or of the session before."""
    shift_m: Float64
    """(3,)"""
    is_drawn: bool
    """False for a new result that the headset has not acknowledged: it still draws another φ."""

    def __str__(self) -> str:
        return self.kind if self.is_drawn else f"{self.kind}, not in the headset yet"


def drawn_shifts(
    session: SessionRecord | SessionState, results: Results | None = None
) -> dict[Eye, DrawnShift]:
    """Return the final φ of both eyes.

    Parameters
    ----------
    session : SessionRecord or SessionState
    results : Results, optional
        The session solved again; default: the results that it holds.
    """
    stored = session.results if session.is_solved else None
    stored_m = read_solved_shift_m(stored)
    if results is None:
        solved_m, used_m = stored_m, read_rendered_shift_m(stored)
    else:
        solved_m = {eye: shift.shift_m for eye, shift in results.eyes.items()}
        used_m = dict(results.rendered_shift_m)
    is_waiting = session.fine_tuned is None and not session.is_applied
    drawn = {}
    for eye in EYES:
        applied_m = session.applied_shift_m.get(eye, np.zeros(3))
        shift_m = used_m.get(eye, applied_m) if is_waiting else applied_m
        kind: ShiftKind = "earlier"
        if any(_is_same(shift_m, known.get(eye)) for known in (solved_m, stored_m)):
            kind, shift_m = "solved", solved_m.get(eye, shift_m)
        elif _is_same(shift_m, np.zeros(3)):
            kind = "offline"
        elif _is_same(shift_m, session.set_by_hand_m.get(eye)):
            kind = "set by hand"
        drawn[eye] = DrawnShift(kind, shift_m, _is_same(shift_m, applied_m))
    return drawn


def drawn_error_arcmin(results: Results, display: EyeDisplay, eye: Eye, drawn: DrawnShift) -> float:
    """Return the error to expect of a solved eye that is drawn with its final φ."""
    benefit, solved = results.benefits[eye], results.eyes[eye]
    if drawn.kind == "solved":
        return benefit.after_arcmin
    if drawn.kind == "offline":
        return benefit.without_arcmin
    return expected_arcmin(display, solved.shift_m - drawn.shift_m, solved.covariance_m2)


def is_judged(verdict: str, kind: ShiftKind) -> bool:
    """Return whether the verdict on an eye is about its final φ, and not about one not used."""
    return kind == "solved" or (kind == "offline" and verdict not in USED)


def is_verified(record: SessionRecord, results: Results, eye: Eye, kind: ShiftKind) -> bool:
    """Return whether the wearer verified the final φ of an eye, with the present alignments."""
    return (
        eye in results.verified
        and eye in record.verified_now
        and is_judged(results.verdicts[eye].name, kind)
    )


def result_word(verdict: VerdictName, kind: ShiftKind) -> str:
    """Return the verdict on an eye in a word, or where its φ comes from if that was not judged."""
    return VERDICT_WORDS[verdict] if is_judged(verdict, kind) else kind.capitalize()


def _is_same(shift_m: Float64, other_m: Float64 | None) -> bool:
    return other_m is not None and bool(np.abs(shift_m - other_m).max() < SAME_SHIFT_M)
