"""Checks of the input points shared by all point-based methods."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from handcal.core.types import Float64

_MOST = 100_000
_FARTHEST = 1e6


def check_points(name: str, values: ArrayLike, columns: int, fewest: int) -> Float64:
    """Return (N, columns) float64; ValueError names the fault.

    Parameters
    ----------
    name : str
        Name of the values in messages.
    values : array_like
        Metres or pixels.
    columns, fewest : int
        Coordinates of each point, and least number of points.
    """
    points = np.asarray(values, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != columns:
        raise ValueError(f"{name} must have shape (N, {columns}), got {points.shape}")
    if not fewest <= len(points) <= _MOST:
        raise ValueError(
            f"{name} has {len(points)} points; between {fewest} and {_MOST:,} are needed"
        )
    if not (np.abs(points) < _FARTHEST).all():
        raise ValueError(f"{name} contains NaN or infinity, or values beyond {_FARTHEST:,.0f}")
    return points


def check_pairs(
    source: tuple[str, ArrayLike, int], target: tuple[str, ArrayLike, int], fewest: int
) -> tuple[Float64, Float64]:
    """Return both sides of a set of pairs, checked by `check_points` and for equal length.

    Each side is given by its name, its values, and the coordinates of each point.
    """
    sources, targets = (check_points(*side, fewest) for side in (source, target))
    if len(sources) != len(targets):
        raise ValueError(
            f"{source[0]} has {len(sources)} points and {target[0]} {len(targets)}; "
            "each point needs a partner"
        )
    return sources, targets
