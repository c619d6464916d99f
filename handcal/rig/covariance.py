"""Covariance of a least-squares fit whose residuals hang together in groups."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handcal.types import Float64


def clustered_covariance(J: Float64, residuals: Float64, group: NDArray[np.integer]) -> Float64:
    """Return the covariance (P, P) of the P parameters, the groups taken for independent.

    For residuals that err together, as all corners of one wrongly tracked board. It is the
    jackknife's: how much the solution moves when one group after the other is left out, to first
    order (Bell & McCaffrey 2002, Bias reduction in standard errors for linear regression with
    multi-stage samples), which few groups do not make too small.

    Parameters
    ----------
    J : (M, P) float64
        Derivatives of the residuals.
    residuals : (M,) float64
    group : (M,) int
        Number of each residual's group, from 0 up; two groups at least.
    """
    information = J.T @ J
    count = int(group.max()) + 1
    moves = np.empty((count, J.shape[1]))
    for number in range(count):
        inside = group == number
        rest = information - J[inside].T @ J[inside]
        moves[number] = np.linalg.pinv(rest, hermitian=True) @ (J[inside].T @ residuals[inside])
    covariance: Float64 = moves.T @ moves * (count - 1) / count
    return 0.5 * (covariance + covariance.T)
