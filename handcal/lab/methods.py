"""Other calibration methods, for comparison: pure functions on arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import rq

from handcal.core.display import update_matrix
from handcal.core.types import Eye, EyeDisplay, Float64
from handcal.register.rcicp import best_rigid

_MOST = 100_000
_FARTHEST = 1e6


def check_points(name: str, values: ArrayLike, columns: int, fewest: int) -> Float64:
    """Return (N, columns) float64; ValueError names the fault.

    Parameters
    ----------
    name : str
        Name of the values in messages.
    values : array_like
        Metres or pixels.
    columns, fewest : int
        Coordinates of each point, and least number of points.
    """
    points = np.asarray(values, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != columns:
        raise ValueError(f"{name} must have shape (N, {columns}), got {points.shape}")
    if not fewest <= len(points) <= _MOST:
        raise ValueError(
            f"{name} has {len(points)} points; between {fewest} and {_MOST:,} are needed"
        )
    if not (np.abs(points) < _FARTHEST).all():
        raise ValueError(f"{name} contains NaN or infinity, or values beyond {_FARTHEST:,.0f}")
    return points


def check_pairs(
    source: tuple[str, ArrayLike, int], target: tuple[str, ArrayLike, int], fewest: int
) -> tuple[Float64, Float64]:
    """Return both sides of a set of pairs, checked by `check_points` and for equal length.

    Each side is given by its name, its values, and the coordinates of each point.
    """
    sources, targets = (check_points(*side, fewest) for side in (source, target))
    if len(sources) != len(targets):
        raise ValueError(
            f"{source[0]} has {len(sources)} points and {target[0]} {len(targets)}; "
            "each point needs a partner"
        )
    return sources, targets


# The direct linear transform: a projective map from pairs of points, by one SVD.
#
# Equations as in Abdel-Aziz & Karara 1971. Both sides are first centred and each axis scaled to
# variance 1 (after Hartley, "In defense of the eight-point algorithm", 1997). A common scale for
# all axes would weight the noise differently; the authors of INDICA scale each axis
# (docs/methods.md).

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


# SPAAM: a display's whole projection from alignments of single points.
#
# Tuceryan & Navab 2000, "Single point active alignment method (SPAAM) for optical see-through HMD
# calibration for AR"; in print as Tuceryan, Genc & Navab 2002, Presence 11(3), whose abstract and
# procedure this follows. The wearer aligns crosshairs on the display with a tracked point, one
# after the other; the 11 unknowns are solved linearly. Written from the published equations as used
# by the authors of INDICA (`docs/methods.md`), with Hartley's normalisation.

_FEWEST_FOR_SPAAM = 6
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
        ("points_m", points_m, 3), ("pixels", pixels, 2), _FEWEST_FOR_SPAAM
    )
    P = fit_projective(points, targets)
    if not (points @ P[2, :3] + P[2, 3] > 0.0).all():
        raise ValueError("the alignments contradict each other: some points lie behind the eye")
    return P


# Stereo-SPAAM: both eyes' projections from alignments with a stereoscopic mark.
#
# Genc, Sauer, Wenzel, Tuceryan & Navab 2000, "Optical see-through HMD calibration: a stereo
# method"; as in Tuceryan, Genc & Navab 2002: "the user aligns a stereoscopically fused 2D marker,
# which is perceived in depth, with a single target point". So each alignment gives the same point
# to both eyes. Known to us from the abstract of 2002 and from surveys; that each eye is then solved
# as in SPAAM is our reading.


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


# Fingertip alignment: the wearer's fingertip is the tracked point.
#
# Moser & Swan 2016, "Evaluation of user-centric optical see-through head-mounted display
# calibration using a Leap Motion controller" (3DUI): 25 alignments for each eye, solved as in
# SPAAM.
#
# Jun & Kim 2016, "A calibration method for optical see-through head-mounted displays with a depth
# camera" (VR): after a full calibration when the camera is mounted, a simplified one for each
# wearer, 8 alignments according to Hu et al. 2021. We know both publications only from others, and
# not the equations of the latter: here the simplified calibration keeps the offline display and
# solves for the eye.

_FEWEST_FOR_EYE = 2
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
        ("points_E_m", points_E_m, 3), ("pixels", pixels, 2), _FEWEST_FOR_EYE
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


# INDICA: the projection for an eye position measured by an eye tracker.
#
# Itoh & Klinker 2014, "Interaction-free calibration for optical see-through head-mounted displays
# based on 3D eye localization" (3DUI). The *recycled* setup takes an earlier calibration of the
# same display, such as SPAAM's, and moves its viewpoint to the tracked eye; the *full* setup uses a
# model of the display. Formulas as in the authors' own code (github.com/YutaItoh/HMD-Calibration,
# MIT); here both have z forward, and the recycled one is the paper's update matrix.


def solve_indica_recycled(
    P_offline: ArrayLike, display_distance_m: float, eye_m: ArrayLike
) -> Float64:
    """Return an earlier projection, updated for the present position of the eye.

    Parameters
    ----------
    P_offline : (3, 4) array_like
        Pixels from points in a frame of the headset, for the earlier position of the eye.
    display_distance_m : float
        From that viewpoint to the display's focal plane.
    eye_m : (3,) array_like
        The tracked eye, in the same frame.

    Returns
    -------
    (3, 4) float64

    Raises
    ------
    ValueError
        For wrong shapes, NaN, a distance that is not positive, a projection without viewpoint, or
        an eye beyond the focal plane.
    """
    eye = check_points("eye_m", np.asarray(eye_m)[None], 3, 1)[0]
    K, R, viewpoint_m = split_projection(P_offline)
    UQ = update_matrix(R @ (eye - viewpoint_m), display_distance_m)
    T_E = np.eye(4)
    T_E[:3, :3], T_E[:3, 3] = R, -R @ viewpoint_m
    P: Float64 = K @ UQ[:3] @ T_E
    return P


def solve_indica_full(
    focal_px_m: float, centre_px: ArrayLike, T_S_H: ArrayLike, eye_m: ArrayLike
) -> Float64:
    """Return the projection through a display with a known model.

    Parameters
    ----------
    focal_px_m : float
        Pixels per metre on the focal plane: α of the publication.
    centre_px : (2,) array_like
        The pixel at the origin of S.
    T_S_H : (3, 4) or (4, 4) array_like
        From the headset's frame to the display's: x and y along its pixels, z away from the eye,
        origin on the focal plane.
    eye_m : (3,) array_like
        The tracked eye, in the headset's frame.

    Returns
    -------
    (3, 4) float64

    Raises
    ------
    ValueError
        For wrong shapes, NaN, or an eye that is not in front of the focal plane.
    """
    eye = check_points("eye_m", np.asarray(eye_m)[None], 3, 1)[0]
    T = check_points("T_S_H", np.asarray(T_S_H)[:3], 4, 3)
    R, t_m = T[:, :3], T[:, 3]
    x_m, y_m, z_m = R @ eye + t_m
    if z_m >= 0.0:
        raise ValueError("eye_m lies on or beyond the display's focal plane")
    u0, v0 = np.asarray(centre_px, dtype=np.float64)
    # The ray from the eye meets S where its depth from the eye is -z_m.
    K = np.array(
        [
            [-z_m * focal_px_m, 0.0, u0 + focal_px_m * x_m],
            [0.0, -z_m * focal_px_m, v0 + focal_px_m * y_m],
            [0.0, 0.0, 1.0],
        ]
    )
    P: Float64 = K @ R @ np.column_stack([np.eye(3), -eye])
    return P


def split_projection(P: ArrayLike) -> tuple[Float64, Float64, Float64]:
    """Split a projection into ``P ∝ K R [I | -c]``.

    Parameters
    ----------
    P : (3, 4) array_like
        Its sign gives points in front of the eye a positive weight.

    Returns
    -------
    K : (3, 3) float64
        Upper triangular, positive diagonal, K[2, 2] = 1.
    R : (3, 3) float64
        Orthonormal, z forward. Mirrored (det -1) where pixel rows count upward.
    c_m : (3,) float64
        The viewpoint.

    Raises
    ------
    ValueError
        If it has no viewpoint.
    """
    matrix = check_points("the projection", P, 4, 3)[:3]
    if np.linalg.cond(matrix[:, :3]) > 1.0 / np.finfo(np.float64).eps:
        raise ValueError("the projection has no viewpoint: its left 3×3 part is singular")
    K, R = rq(matrix[:, :3])
    signs = np.sign(np.diag(K))
    K, R = K * signs, signs[:, None] * R
    viewpoint_m = np.asarray(-np.linalg.solve(matrix[:, :3], matrix[:, 3]), dtype=np.float64)
    return np.asarray(K / K[2, 2]), np.asarray(R), viewpoint_m


# MPAAM in 3D: several corners of a tracked cube overlaid at once with its virtual counterpart.
#
# Azimi, Qian, Navab & Kazanzides 2017, "Alignment of the virtual scene to the tracking space of a
# mixed reality head-mounted display" (arXiv 1703.05834): four alignments of five corners. The
# headset is treated as a black box that shows 3D points at unknown places; the method solves for
# the map from tracked to shown points. Known to us second hand, from Hu et al. 2021; the three
# models of the map are from memory.

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
        return best_rigid(tracked, shown)
    if model == "affine":
        rows = np.column_stack([tracked, np.ones(len(tracked))])
        return np.vstack([np.linalg.lstsq(rows, shown)[0].T, [0.0, 0.0, 0.0, 1.0]])
    return fit_projective(tracked, shown)


# Published results of these methods, as collected by Hu et al. 2021 (their tables 2 and 3).
#
# Conditions differ between studies: displays, distances, users and what counts as truth.


@dataclass(frozen=True, slots=True)
class PublishedReprojection:
    """Reprojection error in arcmin: median, quartiles, extremes."""

    study: str
    median: float
    q1: float
    q3: float
    min: float
    max: float


@dataclass(frozen=True, slots=True)
class PublishedMisalignment:
    """Misalignment at arm's reach, each as "mean ± sd" where given."""

    study: str
    alignments: str
    x_mm: str = "–"
    y_mm: str = "–"
    z_mm: str = "–"
    across_mm: str = "–"
    across_arcmin: str = "–"
    """Combined error in x and y."""
    rotation_deg: str = "–"
    whole_mm: str = ""
    """Total error, where components are not given."""


REPROJECTION = (
    PublishedReprojection("Hu et al. 2021, rcICP, 1", 10.87, 8.18, 13.18, 5.55, 17.16),
    PublishedReprojection("Itoh & Klinker 2014, SPAAM", 11.76, 10.25, 13.26, 7.11, 16.67),
    PublishedReprojection("Itoh & Klinker 2014, INDICA", 14.49, 12.10, 16.08, 10.42, 17.32),
    PublishedReprojection("Moser & Swan 2016, stylus, 25", 9.57, 6.13, 14.80, 0.66, 13.09),
    PublishedReprojection("Moser & Swan 2016, finger, 25", 16.98, 10.83, 25.51, 0.93, 46.87),
)
"""The row on SPAAM is in the paper's source but not in its table. The stylus's third quartile is
above its maximum, as printed."""

MISALIGNMENT = (
    PublishedMisalignment(
        *("Hu et al. 2021", "1, hand", "0.85 ± 0.52", "0.88 ± 0.53", "2.85 ± 2.03"),
        *("1.37 ± 0.42", "8.81 ± 2.69", "1.76 ± 0.99"),
    ),
    PublishedMisalignment(
        *("Azimi et al. 2017", "4 × 5, cube", "0.94 ± 0.74", "0.83 ± 0.63", "3.51 ± 2.67"),
    ),
    PublishedMisalignment("Guo et al. 2019", "5, box", rotation_deg="5.42", whole_mm="6.83"),
    PublishedMisalignment("Jun & Kim 2016", "8, fingertip", whole_mm="about 10"),
)
"""Measured with cameras or users; not all of the same quantity."""
