"""How well a least-squares fit of shared and per-view parameters knows the shared ones."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from handcal.types import Float64


def marginal_covariance(
    blocks: Iterable[tuple[Float64, Float64]], residuals: Float64
) -> Float64 | None:
    """Return the covariance of the shared parameters, the others' uncertainty included.

    The normal equations' Schur complement (Triggs et al., "Bundle adjustment: a modern
    synthesis", 2000, section 6), with the noise taken from the residuals.

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
        # What is left of the shared columns once the view's own have explained what they can.
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
