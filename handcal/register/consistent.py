"""The default solver: register the hand rigidly to get pairs, then fit φ to the pairs.

A rotation of the hand between the two moments is a nuisance parameter of the hand, not of the eye.
So is a change of its apparent size: bones do not grow, and the prior says so, but exact pairs may
overrule it (the paper's own simulated data shrink the hand by 1 - φ3φ4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from handcal.display import update_matrix
from handcal.geometry import transform
from handcal.register.model import design
from handcal.register.rcicp import best_rotation
from handcal.register.rigid import RigidResult, RigidSettings, register_rigid
from handcal.register.surface import describe_surface, near_cut_edge, nearest
from handcal.types import Bool, EyeShift, Float64

# Standard deviation of the hand's apparent change of size between cursor and alignment.
_SIZE_SIGMA = 3e-4
# Effective number of independent pairs: neighbours share the sensor's error.
_INDEPENDENT_PAIRS = 100.0
# A pair farther apart than this many medians is an outlier, unless it is within a point spacing.
_OUTLIER_MEDIANS = 3.0
# Pairs are searched again while that lowers their mean square by more than this: once on measured
# clouds, on exact ones until every point has found its counterpart.
_GAIN = 0.01
# The registration's residuals are not independent; fitted to 200 simulated alignments.
_REGISTRATION_FACTOR = 4.5
# Lower bound of a registration's error, whatever its residuals say, and the share of the hand's
# movement by a rotation that becomes an error in every direction.
_LEAST_SIGMA_M = 5e-5
_TURNED_SHARE = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class HandMatch:
    """Cursor and hand registered rigidly; the same for both eyes."""

    cursor_m: Float64
    hand_m: Float64
    """(N, 3); both clouds in one frame."""
    cursor_near_cut: Bool
    """(N,)."""
    spacing_m: float
    """Distance between neighbours in the thinned cursor."""
    tree: cKDTree
    """Surface of the cursor."""
    rigid: RigidResult
    """Its target is the cursor, its source the hand."""


def match_hands(
    cursor_m: Float64,
    hand_m: Float64,
    cursor_cut: Bool | None,
    hand_cut: Bool | None,
    settings: RigidSettings = RigidSettings(),
) -> HandMatch:
    """Register the hand at t_b to the cursor, (M, 3) and (N, 3) float64 in any common frame."""
    cursor = describe_surface(cursor_m, cursor_cut, settings.max_points)
    hand = describe_surface(hand_m, hand_cut, settings.max_points)
    return HandMatch(
        cursor_m=cursor_m,
        hand_m=hand_m,
        cursor_near_cut=near_cut_edge(cursor_m, cursor_m, cursor_cut, cursor.spacing_m),
        spacing_m=cursor.spacing_m,
        tree=cKDTree(cursor_m),
        rigid=register_rigid(hand, cursor, settings),
    )


def fit_match(
    match: HandMatch, T_E: Float64, distance_m: float, T_drawn: Float64 | None = None
) -> EyeShift:
    """Fit one eye's φ to registered clouds.

    Parameters
    ----------
    match : HandMatch
    T_E : (4, 4) float64
        To E0(t_b) from the frame of the clouds in `match`.
    distance_m : float
        z(C0→S).
    T_drawn : (4, 4) float64, optional
        Map to the cursor as drawn, if not with the offline calibration: see
        `model.cursor_displacement`.
    """
    T_cursor = T_E if T_drawn is None else T_drawn @ T_E
    T_back = np.asarray(np.linalg.inv(T_cursor))
    hand = transform(T_E, match.hand_m)
    cursor = transform(T_cursor, match.cursor_m)
    shape = hand
    expected = transform(T_cursor @ match.rigid.T_target_source, match.hand_m)
    history: list[float] = []
    while True:
        gap_m, index = nearest(match.tree, transform(T_back, expected))
        kept = ~match.cursor_near_cut[index]
        kept &= gap_m <= max(_OUTLIER_MEDIANS * float(np.median(gap_m[kept])), match.spacing_m)
        error_m2 = float(np.mean(gap_m[kept] ** 2))
        if history and error_m2 >= (1.0 - _GAIN) * history[-1]:
            break
        history.append(error_m2)
        inliers, residuals_m, partner = kept, np.where(kept, gap_m, np.nan), cursor[index[kept]]
        R = best_rotation(_centred(shape[kept]), _centred(partner))
        unturned = partner.mean(axis=0) + _centred(partner) @ R
        shift_m, factor = _fit_pairs(unturned, hand[kept], distance_m, error_m2 / 3.0)
        shape = transform(update_matrix(shift_m, distance_m), hand) / factor
        centre = shape[kept].mean(axis=0)
        expected = centre + (shape - centre) @ R.T
    return EyeShift(
        shift_m=shift_m,
        covariance_m2=_covariance(match, T_E, R, unturned, hand[inliers], distance_m),
        rms_m=float(np.sqrt(history[-1])),
        residuals_m=residuals_m,
        inlier_ratio=float(np.mean(inliers)),
        iterations=len(match.rigid.history_m2) + len(history),
        converged=match.rigid.converged,
        stop_reason=match.rigid.stop_reason,
        history_m2=np.concatenate([match.rigid.history_m2, history]),
        method="consistent",
    )


def _fit_pairs(
    cursor_m: Float64, hand_m: Float64, distance_m: float, variance_m2: float
) -> tuple[Float64, float]:
    """Fit φ and the factor κ in ``κ d = UQ s`` to pairs, κ held near 1 - φ3φ4 by a prior.

    With κ = 1 - φ3φ4 + δ the equation gains the column -d for δ and stays linear.
    """
    A = np.concatenate(
        [design(cursor_m, hand_m, distance_m, exact=True), -cursor_m[:, :, None]], axis=2
    ).reshape(-1, 4)
    normal = A.T @ A
    normal[3, 3] += variance_m2 * len(hand_m) / _INDEPENDENT_PAIRS / _SIZE_SIGMA**2
    solution = np.linalg.solve(normal, A.T @ (cursor_m - hand_m).ravel())
    return solution[:3], 1.0 - solution[2] / distance_m + solution[3]


def _covariance(
    match: HandMatch,
    T_E: Float64,
    R: Float64,
    cursor_m: Float64,
    hand_m: Float64,
    distance_m: float,
) -> Float64:
    """Return the covariance of φ from the uncertainty of the hand's displacement at its centroid.

    It has two parts: the registration's own, and, if the hand returned rotated by R, the unknown
    centre of that rotation, which may be any point of the hand and moves the centroid by (I - R)
    times its distance.
    """
    rigid_fit = match.rigid
    scatter = np.linalg.inv(rigid_fit.information)[3:, 3:]
    registration = _REGISTRATION_FACTOR * rigid_fit.history_m2[-1] * scatter
    R_E = T_E[:3, :3]
    lever = np.eye(3) - R
    turned = lever @ np.cov(hand_m.T) @ lever.T
    least_m2 = _LEAST_SIGMA_M**2 + _TURNED_SHARE**2 * np.trace(turned)
    displacement = R_E @ registration @ R_E.T + turned + least_m2 * np.eye(3)
    gain = np.linalg.inv(design(cursor_m, hand_m, distance_m, exact=True).mean(axis=0))
    return np.asarray(gain @ displacement @ gain.T, dtype=np.float64)


def _centred(points_m: Float64) -> Float64:
    centred: Float64 = points_m - points_m.mean(axis=0)
    return centred
