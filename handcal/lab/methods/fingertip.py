"""Fingertip alignment: the wearer's fingertip is the tracked point.

Moser & Swan 2016, "Evaluation of user-centric optical see-through head-mounted display calibration
using a Leap Motion controller" (3DUI): 25 alignments for each eye, solved as in SPAAM
(`handcal.lab.methods.spaam`).

Jun & Kim 2016, "A calibration method for optical see-through head-mounted displays with a depth
camera" (VR): after a full calibration when the camera is mounted, a simplified one for each wearer,
8 alignments according to Hu et al. 2021. We know both publications only from others, and not the
equations of the latter: here the simplified calibration keeps the offline display and solves for
the eye.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from handcal.core.types import EyeDisplay, Float64
from handcal.lab.methods.points import check_pairs

FEWEST_ALIGNMENTS = 2
"""Each gives two equations for three unknowns."""

_UNTOLD = 1e-9


def solve_eye_from_points(points_E_m: ArrayLike, pixels: ArrayLike, display: EyeDisplay) -> Float64:
    """Return the eye shift for which a known display fits alignments of single points.

    With ``n = (K H0)^-1 [m; 1]`` and UQ (`handcal.core.display`), each alignment requires
    ``n (z - φ3) = UQ p``, which is linear in φ; divided by z, the residuals are in pixels.

    Parameters
    ----------
    points_E_m : (N, 3) array_like
        The tracked point at each alignment, in E.
    pixels : (N, 2) array_like
        The pixels with which it was aligned.
    display : EyeDisplay

    Returns
    -------
    (3,) float64
        φ from C0 to the eye, in E's axes.

    Raises
    ------
    ValueError
        For fewer than 2 alignments, wrong shapes, NaN, points behind the viewpoint, or points that
        all lie on one ray or on the display.
    """
    points, targets = check_pairs(
        ("points_E_m", points_E_m, 3), ("pixels", pixels, 2), FEWEST_ALIGNMENTS
    )
    depth = points[:, 2]
    if not (depth > 0.0).all():
        raise ValueError("points_E_m has points behind the viewpoint")
    homogeneous = np.column_stack([targets, np.ones(len(targets))])
    rays = np.linalg.solve(display.K @ display.H0, homogeneous.T).T
    rays = rays[:, :2] / rays[:, 2:]
    phi_4 = 1.0 / display.z_C0_S_m
    A = np.zeros((len(points), 2, 3))
    A[:, 0, 0] = A[:, 1, 1] = phi_4 - 1.0 / depth
    A[:, :, 2] = (rays - phi_4 * points[:, :2]) / depth[:, None]
    b = rays - points[:, :2] / depth[:, None]
    shift_m, _, rank, _ = np.linalg.lstsq(A.reshape(-1, 3), b.reshape(-1), rcond=_UNTOLD)
    if rank < 3:
        raise ValueError("the alignments do not determine the eye's position: spread them out")
    return np.asarray(shift_m)
