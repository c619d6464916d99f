"""What the eye shifts set by hand have been: undo and redo. No Qt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from handcal.types import Eye, Float64, readonly

Shifts: TypeAlias = Mapping[Eye, Float64]
"""φ of each eye, (3,) float64, metres."""


def same_shifts(one: Shifts, other: Shifts) -> bool:
    """Whether both hold the same eyes with the same φ."""
    return set(one) == set(other) and all(np.array_equal(one[eye], other[eye]) for eye in one)


def moved(shifts_m: Shifts, eyes: Sequence[Eye], axis: int, by_m: float, limit_m: float) -> Shifts:
    """Return the shifts with one component of some eyes moved by the same amount.

    Parameters
    ----------
    shifts_m : mapping of eye to (3,) float64
    eyes : sequence of eye
        Those that move.
    axis : {0, 1, 2}
    by_m : float
        Less is moved where an eye would otherwise pass the limit.
    limit_m : float
        No component passes ± this; what is beyond already comes back to it.
    """
    lowest_m = max(-limit_m - shifts_m[eye][axis] for eye in eyes)
    highest_m = min(limit_m - shifts_m[eye][axis] for eye in eyes)
    step_m = np.zeros(3)
    step_m[axis] = min(max(by_m, lowest_m), highest_m)
    moved_m = {eye: np.clip(shifts_m[eye] + step_m, -limit_m, limit_m) for eye in eyes}
    return {**shifts_m, **moved_m}


class ShiftHistory:
    """The present shifts, those before, and those undone.

    Parameters
    ----------
    shifts_m : mapping of eye to (3,) float64
        Where it begins; that cannot be undone.
    """

    def __init__(self, shifts_m: Shifts) -> None:
        self._steps = [_frozen(shifts_m)]
        self._at = 0

    @property
    def present(self) -> Shifts:
        """The shifts as they are now."""
        return self._steps[self._at]

    @property
    def can_undo(self) -> bool:
        """Whether anything came before."""
        return self._at > 0

    @property
    def can_redo(self) -> bool:
        """Whether anything was undone since the last change."""
        return self._at + 1 < len(self._steps)

    def change(self, shifts_m: Shifts, *, goes_on: bool = False) -> None:
        """Make other shifts the present ones; what was undone is forgotten.

        Parameters
        ----------
        shifts_m : mapping of eye to (3,) float64
            Nothing happens if they are the present ones.
        goes_on : bool
            Whether this goes on with the last change, as a slider being dragged does, so that both
            are undone together.
        """
        if same_shifts(shifts_m, self.present):
            return
        self._at += not (goes_on and self.can_undo)
        self._steps[self._at :] = [_frozen(shifts_m)]

    def undo(self) -> None:
        """Go back by one change, if there is one."""
        self._at -= self.can_undo

    def redo(self) -> None:
        """Take back the last undo, if there is one."""
        self._at += self.can_redo


def _frozen(shifts_m: Shifts) -> Shifts:
    return MappingProxyType(
        {eye: readonly(shift_m.copy(), np.float64, (3,)) for eye, shift_m in shifts_m.items()}
    )
