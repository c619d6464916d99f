"""Stereo-SPAAM: both eyes' projections from alignments with a stereoscopic mark.

Genc, Sauer, Wenzel, Tuceryan & Navab 2000, "Optical see-through HMD calibration: a stereo method";
as in Tuceryan, Genc & Navab 2002: "the user aligns a stereoscopically fused 2D marker, which is
perceived in depth, with a single target point". So each alignment gives the same point to both
eyes. Known to us from the abstract of 2002 and from surveys; that each eye is then solved as in
SPAAM is our reading.
"""

from __future__ import annotations

from collections.abc import Mapping

from numpy.typing import ArrayLike

from handcal.core.types import Eye, Float64
from handcal.lab.methods.spaam import solve_spaam


def solve_stereo_spaam(
    points_m: ArrayLike, pixels: Mapping[Eye, ArrayLike]
) -> Mapping[Eye, Float64]:
    """Return both eyes' projections.

    Parameters
    ----------
    points_m : (N, 3) array_like
        The tracked point at each alignment, in one frame of the headset.
    pixels : mapping of eye to (N, 2) array_like
        The pixels at which each eye's half of the mark was drawn.

    Returns
    -------
    mapping of eye to (3, 4) float64

    Raises
    ------
    ValueError
        See `solve_spaam`; the message names the eye.
    """
    projections: dict[Eye, Float64] = {}
    for eye, drawn_px in pixels.items():
        try:
            projections[eye] = solve_spaam(points_m, drawn_px)
        except ValueError as error:
            raise ValueError(f"{eye} eye: {error}") from error
    return projections
