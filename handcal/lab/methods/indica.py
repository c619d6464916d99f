"""INDICA: the projection for an eye position measured by an eye tracker.

Itoh & Klinker 2014, "Interaction-free calibration for optical see-through head-mounted displays
based on 3D eye localization" (3DUI). The *recycled* setup takes an earlier calibration of the same
display, such as SPAAM's, and moves its viewpoint to the tracked eye; the *full* setup uses a model
of the display. Formulas as in the authors' own code (github.com/YutaItoh/HMD-Calibration, MIT);
here both have z forward, and the recycled one is the paper's update matrix.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import rq

from handcal.core.display import update_matrix
from handcal.core.types import Float64
from handcal.lab.methods.points import check_points


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
