"""Residuals and covariances of least-squares fits, and the verdict on what was fitted."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from handcal.core.types import Float64


def rms(off_px: Float64) -> float:
    """Return the root mean square length of (N, 2) residuals, as OpenCV defines it."""
    return float(np.sqrt(np.mean(np.sum(off_px**2, axis=1))))


def marginal_covariance(
    blocks: Iterable[tuple[Float64, Float64]], residuals: Float64
) -> Float64 | None:
    """Return the covariance of the shared parameters, including the uncertainty of the others.

    The normal equations' Schur complement (Triggs et al., "Bundle adjustment: a modern
    synthesis", 2000, section 6), with the noise estimated from the residuals.

    Parameters
    ----------
    blocks : iterable of ((M, P), (M, Q)) float64
        Of each view, the derivatives of its residuals by the shared and by its own parameters.
    residuals : (N,) float64
        Of all views.

    Returns
    -------
    (P, P) float64 or None
        None if the views do not determine the parameters.
    """
    information: Float64 = np.zeros(())
    count = 0
    for shared, own in blocks:
        # Shared columns, minus their projection onto the view's own columns.
        basis, _ = np.linalg.qr(own)
        rest = shared - basis @ (basis.T @ shared)
        information = information + rest.T @ rest
        count += shared.shape[1] * (count == 0) + own.shape[1]
    scale = np.sqrt(np.diag(information))
    if not (scale > 0).all():
        return None
    scaled = information / np.outer(scale, scale)
    if np.linalg.cond(scaled) > 1e12:
        return None
    variance = residuals @ residuals / max(len(residuals) - count, 1)
    covariance: Float64 = variance * np.linalg.inv(scaled) / np.outer(scale, scale)
    return covariance


def clustered_covariance(J: Float64, residuals: Float64, group: NDArray[np.integer]) -> Float64:
    """Return the covariance (P, P) of the P parameters, treating the groups as independent.

    For correlated residuals, such as all corners of one wrongly tracked board. It is the jackknife
    covariance: the change of the solution, to first order, when each group in turn is left out
    (Bell & McCaffrey 2002, Bias reduction in standard errors for linear regression with multi-stage
    samples). It is not too small even with few groups.

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


CalibrationVerdictName: TypeAlias = Literal["good", "needs more views", "bad"]


@dataclass(frozen=True, slots=True)
class CalibrationVerdict:
    """A verdict on a part of the offline calibration, with its reason; a bad part is not used."""

    name: CalibrationVerdictName
    reason: str

    def unless_few(self, views: int, asked: int, of: str) -> CalibrationVerdict:
        """Return this verdict, or that more views are needed if a good one is of too few."""
        if self.name != "good" or views >= asked:
            return self
        reason = f"{views} {of}, take {asked} or more; {self.reason}"
        return CalibrationVerdict("needs more views", reason)
