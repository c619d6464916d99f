"""Pairs of cursor and hand points, found fast enough for a live display."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from small_gicp import KdTree

from handcal.core.geometry import rigid, transform
from handcal.core.types import Bool, Float64
from handcal.register.surface import nearest

Pairs: TypeAlias = NDArray[np.intp]

_CURSOR_POINTS = 1000
_STEPS = 4
# As in the solver: a pair farther apart than this many medians is an outlier.
_OUTLIER_MEDIANS = 3.0


def matched_pairs(
    cursor_m: Float64,
    hand_m: Float64,
    rotation_rad: Float64,
    cursor_is_cut: Bool,
    count: int = 300,
) -> Pairs:
    """Pair points of the hand with their nearest cursor points after a registration.

    The rotation is known from the guard, so only the translation is estimated: a coarse
    registration for display. The solver has its own (`handcal.register.consistent`).

    Parameters
    ----------
    cursor_m, hand_m : (N, 3), (M, 3) float64
        In one frame.
    rotation_rad : (3,) float64
        From the cursor to the hand, about that frame's axes.
    cursor_is_cut : (N,) bool
        Points beside a cut edge; pairs that end there are left out, as are outliers.
    count : int
        Number of hand points to pair.

    Returns
    -------
    (K, 2) int
        Indices into cursor and hand.
    """
    cursor_index, hand_index = _thin(len(cursor_m), _CURSOR_POINTS), _thin(len(hand_m), count)
    if not (len(cursor_index) and len(hand_index)):
        return np.empty((0, 2), dtype=np.intp)
    cursor, hand = cursor_m[cursor_index], hand_m[hand_index]
    back = Rotation.from_rotvec(rotation_rad).inv().as_matrix()
    moved = transform(rigid(back), hand - hand.mean(axis=0)) + cursor.mean(axis=0)
    tree = KdTree(cursor)
    for _ in range(_STEPS):
        _, partner = nearest(tree, moved)
        moved += np.median(cursor[partner] - moved, axis=0)
    distance_m, partner = nearest(tree, moved)
    is_kept = ~cursor_is_cut[cursor_index[partner]]
    is_kept &= distance_m <= _OUTLIER_MEDIANS * np.median(distance_m)
    return np.column_stack([cursor_index[partner], hand_index])[is_kept]


def _thin(length: int, count: int) -> NDArray[np.intp]:
    """Return about `count` indices below `length`, evenly spread."""
    return np.arange(0, length, max(1, length // count))
