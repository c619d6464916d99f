"""One simulated alignment: the person's hand, and the solution by each method."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from handcal.core.geometry import transform
from handcal.core.types import EyeShift, Float64, Method
from handcal.register.model import fit_shift
from handcal.register.rcicp import solve_paper
from handcal.register.solve import solve_eye_shift
from handcal.sim.alignments import SimulatedAlignment
from handcal.sim.hand import HandModel, make_hand

BEST_ITERATE: Final = "paper, best iterate"
"""The published iteration, ended at the smallest distance of the pairs instead of the last."""


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


def solve_by_paper(
    cursor_m: Float64, hand_m: Float64, T_E_W: Float64, distance_m: float
) -> tuple[int, dict[str, Float64]]:
    """Return the paper's number of iterations, and φ as published and of its best iterate."""
    found = solve_paper(transform(T_E_W, cursor_m), transform(T_E_W, hand_m), distance_m)
    return len(found.history_m2), {"paper": found.shift_m, BEST_ITERATE: found.best_shift_m}


def floor_error_m(made: SimulatedAlignment, *, exact: bool) -> Float64:
    """Return the error of φ, (3,), that remains when all pairs are known and free of noise."""
    known = made.known_cursor_m, made.known_hand_m
    return fit_shift(*known, made.display_distance_m, exact=exact) - made.shift_m
