"""Covariance of a least-squares fit whose residuals hang together in groups."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handcal.types import Float64


def clustered_covariance(J: Float64, residuals: Float64, group: NDArray[np.integer]) -> Float64:
    """Return the covariance (P, P) of the P parameters, the groups taken for independent.

    The sandwich estimate (Liang & Zeger 1986, Longitudinal data analysis using generalized linear
    models), for residuals that err together, as all corners of one wrongly tracked board.

    Parameters
    ----------
    J : (M, P) float64
        Derivatives of the residuals.
    residuals : (M,) float64
    group : (M,) int
        Number of each residual's group, from 0 up; two groups at least.
    """
    bread = np.linalg.pinv(J.T @ J)
    count = int(group.max()) + 1
    scores = np.zeros((count, J.shape[1]))
    np.add.at(scores, group, J * residuals[:, None])
    covariance: Float64 = bread @ (scores.T @ scores) @ bread * count / (count - 1)
    return 0.5 * (covariance + covariance.T)
