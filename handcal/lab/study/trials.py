"""One simulated alignment: the person's hand, and the solution by each method."""

from __future__ import annotations

from functools import lru_cache

from handcal.register.model import fit_shift
from handcal.register.solve import solve_eye_shift
from handcal.sim.alignments import SimulatedAlignment
from handcal.sim.hand import HandModel, make_hand
from handcal.types import EyeShift, Float64, Method


@lru_cache(maxsize=64)
def study_hand(seed: int) -> HandModel:
    """Return a person's hand, made once in each process."""
    return make_hand(seed)


def solve_trial(made: SimulatedAlignment, method: Method) -> EyeShift:
    """Solve a simulated alignment."""
    return solve_eye_shift(
        made.cursor_m,
        made.hand_m,
        display_distance_m=made.display_distance_m,
        T_E_W=made.T_E_W,
        method=method,
        cursor_cut=made.cursor_cut,
        hand_cut=made.hand_cut,
    )


def floor_error_m(made: SimulatedAlignment, *, exact: bool) -> Float64:
    """Return the error of φ, (3,), that remains when all pairs are known and free of noise."""
    known = made.known_cursor_m, made.known_hand_m
    return fit_shift(*known, made.display_distance_m, exact=exact) - made.shift_m
