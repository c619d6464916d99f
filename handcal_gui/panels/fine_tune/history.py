"""Undo and redo of eye shifts set by hand. No Qt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from handcal.frozen import readonly
from handcal.types import Eye, Float64

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

    Parameters
    ----------
    shifts_m : mapping of eye to (3,) float64
        Initial shifts, which cannot be undone.

    Attributes
    ----------
    is_replaced : bool
        True while the present shifts are those of others, in place of shifts set by hand.
    """

    def __init__(self, shifts_m: Shifts) -> None:
        self._base = _frozen(shifts_m)
        self._steps = [self._base]
        self._at = 0
        self._before = self._base, self._steps, self._at
        self.is_replaced = False

    @property
    def present(self) -> Shifts:
        """The present shifts."""
        return self._steps[self._at]

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
        if same_shifts(shifts_m, self.present):
            return
        self.is_replaced = False
        self._at += not (goes_on and self.can_undo)
        self._steps[self._at :] = [_frozen(shifts_m)]

    def after(
        self, shifts_m: Shifts, calibrated_m: Shifts = _NONE, by_hand_m: Shifts = _NONE
    ) -> ShiftHistory:
        """Return the history with shifts set by others: an undo away from any set by hand.

        In all steps, the eyes that were not set by hand have the new shifts.

        Parameters
        ----------
        shifts_m : mapping of eye to (3,) float64
        calibrated_m, by_hand_m : mapping of eye to (3,) float64
            Calibrated shifts, and those last set by hand: the shifts of a resumed session.
        """
        if self.is_replaced:
            self._base, self._steps, self._at = self._before
            self.is_replaced = False
            if same_shifts(shifts_m, self.present):
                return self  # others set again what had been set by hand
        if same_shifts(self.present, self._base):
            if not same_shifts(shifts_m, by_hand_m):
                return ShiftHistory(shifts_m)
            resumed = ShiftHistory({**shifts_m, **calibrated_m})
            resumed.change(shifts_m)
            return resumed
        self._before = self._base, self._steps, self._at
        self._steps = [self._on(shifts_m, one) for one in self._steps[: self._at + 1]]
        self._base = _frozen(shifts_m)
        self.change(shifts_m)
        self.is_replaced = True
        return self

    def _on(self, base_m: Shifts, shifts_m: Shifts) -> Shifts:
        """Return a step as if it had been set by hand upon other shifts."""
        by_hand = {
            eye: one
            for eye, one in shifts_m.items()
            if eye not in base_m or not np.array_equal(one, self._base[eye])
        }
        return _frozen({**base_m, **by_hand})

    def undo(self) -> None:
        """Undo the last change, if there is one."""
        self.is_replaced = False
        self._at -= self.can_undo

    def redo(self) -> None:
        """Redo the last undone change, if there is one."""
        self._at += self.can_redo


def _frozen(shifts_m: Shifts) -> Shifts:
    return MappingProxyType(
        {eye: readonly(shift_m.copy(), np.float64, (3,)) for eye, shift_m in shifts_m.items()}
    )
