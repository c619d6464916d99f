"""MPAAM in 3D: several corners of a tracked cube overlaid at once with its virtual counterpart.

Azimi, Qian, Navab & Kazanzides 2017, "Alignment of the virtual scene to the tracking space of a
mixed reality head-mounted display" (arXiv 1703.05834): four alignments of five corners. The headset
is treated as a black box that shows 3D points at unknown places; the method solves for the map from
tracked to shown points. Known to us second hand, from Hu et al. 2021; the three models of the map
are from memory.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from handcal.core.geometry import rigid
from handcal.core.types import Float64
from handcal.lab.methods.dlt import fit_projective
from handcal.lab.methods.points import check_pairs

MapModel: TypeAlias = Literal["isometric", "affine", "perspective"]
FEWEST_PAIRS: dict[MapModel, int] = {"isometric": 3, "affine": 4, "perspective": 5}

_FLAT = 1e-6


def solve_mpaam(tracked_m: ArrayLike, shown_m: ArrayLike, model: MapModel) -> Float64:
    """Return the map from real points to the virtual points that cover them.

    Parameters
    ----------
    tracked_m : (N, 3) array_like
        Corners of the real cube in the headset's frame, of all alignments.
    shown_m : (N, 3) array_like
        The same corners of the virtual cube as placed in the virtual scene.
    model : {"isometric", "affine", "perspective"}
        6, 12 or 15 unknowns.

    Returns
    -------
    (4, 4) float64
        From tracked to virtual points, homogeneous: a point rendered at ``T p`` covers p.

    Raises
    ------
    ValueError
        For an unknown model, too few pairs, wrong shapes, NaN, or points on a line (isometric) or
        on a plane (else); perspective also where five points in general position are lacking.
    """
    if model not in FEWEST_PAIRS:
        raise ValueError(f"unknown model {model!r}: choose from {', '.join(FEWEST_PAIRS)}")
    tracked, shown = check_pairs(
        ("tracked_m", tracked_m, 3), ("shown_m", shown_m, 3), FEWEST_PAIRS[model]
    )
    widths = np.linalg.svd(tracked - tracked.mean(axis=0), compute_uv=False)
    if widths[1 if model == "isometric" else 2] < _FLAT * widths[0]:
        where = "one line" if model == "isometric" else "one plane"
        raise ValueError(f"tracked_m lies on {where}: align the cube at different places")
    if model == "isometric":
        return _fit_isometric(tracked, shown)
    if model == "affine":
        rows = np.column_stack([tracked, np.ones(len(tracked))])
        return np.vstack([np.linalg.lstsq(rows, shown)[0].T, [0.0, 0.0, 0.0, 1.0]])
    return fit_projective(tracked, shown)


def _fit_isometric(source: Float64, target: Float64) -> Float64:
    """Return the least-squares rigid motion (Kabsch 1976)."""
    middle, goal = source.mean(axis=0), target.mean(axis=0)
    U, _, Vt = np.linalg.svd((target - goal).T @ (source - middle))
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U) * np.linalg.det(Vt)]) @ Vt
    return rigid(R, goal - R @ middle)
