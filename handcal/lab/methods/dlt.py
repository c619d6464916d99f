"""The direct linear transform: a projective map from pairs of points, by one SVD.

Equations as in Abdel-Aziz & Karara 1971. Both sides are first centred and each axis scaled to
variance 1 (after Hartley, "In defense of the eight-point algorithm", 1997). A common scale for all
axes would weight the noise differently; the authors of INDICA scale each axis (docs/methods.md).
"""

from __future__ import annotations

import numpy as np

from handcal.core.types import Float64

# Below this share of the largest singular value, a second solution fits as well as the first.
_AMBIGUOUS = 1e-6


def fit_projective(source: Float64, target: Float64) -> Float64:
    """Return the projective map from `source` (N, n) to `target` (N, m): (m + 1, n + 1), norm 1.

    Each pair gives m equations. The sign is such that most points have a positive weight.

    Raises
    ------
    ValueError
        If more than one map fits the pairs.
    """
    T_source, x = _normalise(source)
    T_target, y = _normalise(target)
    count, m = target.shape
    n = x.shape[1]
    rows = np.zeros((count, m, m + 1, n))
    for axis in range(m):
        rows[:, axis, axis] = x
        rows[:, axis, m] = -y[:, axis, None] * x
    # The row of zeros keeps the null vector when there is one equation less than unknowns.
    system = np.vstack([rows.reshape(count * m, -1), np.zeros((m + 1) * n)])
    _, sizes, Vt = np.linalg.svd(system, full_matrices=False)
    if sizes[-2] < _AMBIGUOUS * sizes[0]:
        raise ValueError(
            "the points do not determine the projection: spread them in all directions and in "
            "depth, not on one plane"
        )
    normal = Vt[-1].reshape(m + 1, n)
    P = np.linalg.solve(T_target, normal @ T_source)
    weights = source @ P[-1, :-1] + P[-1, -1]
    sign = 1.0 if np.median(weights) > 0.0 else -1.0
    result: Float64 = sign * P / np.linalg.norm(P)
    return result


def _normalise(points: Float64) -> tuple[Float64, Float64]:
    """Return the homogeneous map that normalises points, and the (N, n + 1) mapped points."""
    centroid, widths = points.mean(axis=0), points.std(axis=0)
    scales = 1.0 / np.where(widths > 0.0, widths, 1.0)
    T = np.diag([*scales, 1.0])
    T[:-1, -1] = -scales * centroid
    return T, np.column_stack([(points - centroid) * scales, np.ones(len(points))])
