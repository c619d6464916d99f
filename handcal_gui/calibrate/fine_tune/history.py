"""Undo and redo of eye shifts set by hand. No Qt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from handcal.core.frozen import readonly
from handcal.core.types import Eye, Float64

Shifts: TypeAlias = Mapping[Eye, Float64]
"""φ of each eye, (3,) float64, metres."""
_NONE: Shifts = MappingProxyType({})


def same_shifts(one: Shifts, other: Shifts) -> bool:
    """Return whether both hold the same eyes with the same φ."""
    return set(one) == set(other) and all(np.array_equal(one[eye], other[eye]) for eye in one)


def moved(shifts_m: Shifts, eyes: Sequence[Eye], axis: int, by_m: float, limit_m: float) -> Shifts:
    """Return the shifts with one component of some eyes moved by the same amount.

    Parameters
    ----------
    shifts_m : mapping of eye to (3,) float64
    eyes : sequence of eye
        The eyes to move.
    axis : {0, 1, 2}
    by_m : float
        The step; reduced if an eye would otherwise exceed the limit.
    limit_m : float
        Largest magnitude of a component; larger ones are reduced to it.
    """
    lowest_m = max(-limit_m - shifts_m[eye][axis] for eye in eyes)
    highest_m = min(limit_m - shifts_m[eye][axis] for eye in eyes)
    step_m = np.zeros(3)
    step_m[axis] = min(max(by_m, lowest_m), highest_m)
    moved_m = {eye: np.clip(shifts_m[eye] + step_m, -limit_m, limit_m) for eye in eyes}
    return {**shifts_m, **moved_m}


class ShiftHistory:
    """The present shifts, the earlier ones, and the undone ones.

    Each step holds the eyes set by hand, upon the shifts that others set.

    Parameters
    ----------
    shifts_m : mapping of eye to (3,) float64
        Initial shifts, which cannot be undone.
    by_hand_m : mapping of eye to (3,) float64
        Shifts set by hand upon them before.

    Attributes
    ----------
    is_replaced : bool
        True while the present shifts are those of others, in place of shifts set by hand.
    """

    def __init__(self, shifts_m: Shifts, by_hand_m: Shifts = _NONE) -> None:
        self._base = self._own_base = _frozen(shifts_m)  # the latter: before a replacement
        self._steps = [_NONE]
        self._at = 0
        self.is_replaced = False
        self.change({**shifts_m, **by_hand_m})

    @property
    def present(self) -> Shifts:
        """The present shifts."""
        return MappingProxyType({**self._base, **self._steps[self._at]})

    @property
    def can_undo(self) -> bool:
        """True if there is something to undo."""
        return self._at > 0

    @property
    def can_redo(self) -> bool:
        """True if there is something to redo."""
        return self._at + 1 < len(self._steps)

    def change(self, shifts_m: Shifts, *, goes_on: bool = False) -> None:
        """Set the present shifts; undone ones are discarded.

        Parameters
        ----------
        shifts_m : mapping of eye to (3,) float64
            Ignored if equal to the present ones.
        goes_on : bool
            True if this continues the last change, as when a slider is dragged, so that both are
            undone together.
        """
        present = self.present
        by_hand = {eye: one for eye, one in shifts_m.items() if not _same(one, present[eye])}
        if not by_hand:
            return
        step = _frozen({**self._steps[self._at], **by_hand})
        self.is_replaced = False
        self._at += not (goes_on and self.can_undo)
        self._steps[self._at :] = [step]

    def see(self, shifts_m: Shifts) -> None:
        """Take shifts set by others: what was set by hand and is not among them is an undo away."""
        steps = self._steps[: self._at + 1]
        if self.is_replaced:
            steps.pop()  # of the last replacement
        else:
            self._own_base = self._base
        last = steps[-1]
        kept = _frozen({eye: one for eye, one in last.items() if _same(one, shifts_m[eye])})
        self._base = _frozen({**shifts_m, **{eye: self._own_base[eye] for eye in kept}})
        self.is_replaced = len(kept) < len(last)
        if self.is_replaced:
            steps.append(kept)
        self._steps, self._at = steps, len(steps) - 1

    def undo(self) -> None:
        """Undo the last change, if there is one."""
        self.is_replaced = False
        self._at -= self.can_undo

    def redo(self) -> None:
        """Redo the last undone change, if there is one."""
        self._at += self.can_redo


def _same(one: Float64, other: Float64) -> bool:
    return bool(np.array_equal(one, other))


def _frozen(shifts_m: Shifts) -> Shifts:
    return MappingProxyType(
        {eye: readonly(shift_m.copy(), np.float64, (3,)) for eye, shift_m in shifts_m.items()}
    )
