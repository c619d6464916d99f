"""SPAAM: a display's whole projection from alignments of single points.

Tuceryan & Navab 2000, "Single point active alignment method (SPAAM) for optical see-through HMD
calibration for AR"; in print as Tuceryan, Genc & Navab 2002, Presence 11(3), whose abstract and
procedure this follows. The wearer aligns crosshairs on the display with a tracked point, one after
the other; the 11 unknowns are solved linearly. Written from the published equations as used by the
authors of INDICA (`docs/methods.md`), with Hartley's normalisation.
"""

from __future__ import annotations

from numpy.typing import ArrayLike

from handcal.core.types import Float64
from handcal.lab.methods.dlt import fit_projective
from handcal.lab.methods.points import check_pairs

FEWEST_ALIGNMENTS = 6
"""Each gives two equations for 11 unknowns."""


def solve_spaam(points_m: ArrayLike, pixels: ArrayLike) -> Float64:
    """Return one eye's projection from its alignments.

    Parameters
    ----------
    points_m : (N, 3) array_like
        The tracked point at each alignment, in one frame of the headset; N from 6, in practice
        20 or more.
    pixels : (N, 2) array_like
        The crosshairs with which it was aligned.

    Returns
    -------
    (3, 4) float64
        Pixels from points in that frame, norm 1.

    Raises
    ------
    ValueError
        For fewer than 6 alignments, wrong shapes, NaN, degenerate points (such as on a plane), or
        alignments that place points behind the eye.
    """
    points, targets = check_pairs(
        ("points_m", points_m, 3), ("pixels", pixels, 2), FEWEST_ALIGNMENTS
    )
    P = fit_projective(points, targets)
    if not (points @ P[2, :3] + P[2, 3] > 0.0).all():
        raise ValueError("the alignments contradict each other: some points lie behind the eye")
    return P
