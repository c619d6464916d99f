"""The alignment equation in φ: prediction of the cursor from the hand, and fit of φ to pairs.

At alignment the cursor point d and the hand point s, both in E0(t_b), fall on one pixel:
``κ d = UQ s``. The paper takes κ = 1 (``exact=False``). A hand does not change its size, so
overlaying it fixes ``κ = 1 - φ3φ4`` (``exact=True``). Both are linear in φ. Per pair, b = d - s::

    exact   (φ4 s_z - 1) φ1 + φ4 (d_x - s_x) φ3 = b_x      paper   (φ4 s_z - 1) φ1 - φ4 s_x φ3 = b_x
            (φ4 s_z - 1) φ2 + φ4 (d_y - s_y) φ3 = b_y              (φ4 s_z - 1) φ2 - φ4 s_y φ3 = b_y
                              (φ4 d_z - 1) φ3   = b_z                                    - φ3 = b_z

In a verification the wearer moves the drawing of the resting hand until it covers the hand. For a
hand at one place, the drawing's movement to the right, movement down and growth determine φ, and
vice versa. So that movement is the remaining error, and the φ that it leads to is one more
observation, with the precision at which a person sees two outlines coincide (`nudged_shift_m`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from handcal.core.display import update_matrix
from handcal.core.geometry import transform
from handcal.core.types import EyeDisplay, Float64

_BALANCE_STEPS = 3


def predict(hand_m: Float64, shift_m: Float64, distance_m: float, *, exact: bool) -> Float64:
    """Return the cursor points that `hand_m` covers, (N, 3), all in E0(t_b)."""
    update = cursor_displacement if exact else update_matrix
    return transform(update(shift_m, distance_m), hand_m)


def cursor_displacement(shift_m: Float64, distance_m: float) -> Float64:
    """Return the (4, 4) affine map of E that puts a cursor where a projection with φ draws it.

    The equation above is for a cursor drawn with the offline calibration. A cursor drawn with
    another φ is equivalent to one moved by this map, of the same size.
    """
    T = update_matrix(shift_m, distance_m)
    T[:3] /= 1.0 - shift_m[2] / distance_m
    return T


def design(cursor_m: Float64, hand_m: Float64, distance_m: float, *, exact: bool) -> Float64:
    """Return the rows of the alignment equation, (N, 3 rows, 3 unknowns)."""
    phi_4 = 1.0 / distance_m
    A = np.zeros((len(hand_m), 3, 3))
    A[:, 0, 0] = A[:, 1, 1] = phi_4 * hand_m[:, 2] - 1.0
    if exact:
        A[:, :2, 2] = phi_4 * (cursor_m[:, :2] - hand_m[:, :2])
        A[:, 2, 2] = phi_4 * cursor_m[:, 2] - 1.0
    else:
        A[:, :2, 2] = -phi_4 * hand_m[:, :2]
        A[:, 2, 2] = -1.0
    return A


def fit_shift(cursor_m: Float64, hand_m: Float64, distance_m: float, *, exact: bool) -> Float64:
    """Return the least-squares φ, (3,), for known pairs: the lower bound of every solver's error.

    Parameters
    ----------
    cursor_m, hand_m : (N, 3) float64
        Pairs, in E0(t_b).
    distance_m : float
        z(C0→S).
    exact : bool
        True for the exact factor, False for the paper's 1.
    """
    A = design(cursor_m, hand_m, distance_m, exact=exact).reshape(-1, 3)
    return np.asarray(np.linalg.solve(A.T @ A, A.T @ (cursor_m - hand_m).ravel()))


def balance(cursor_m: Float64, hand_m: Float64, shift_m: Float64, distance_m: float) -> Float64:
    """Return the φ, (3,), from which no small movement of the hand fits its cursor better.

    An eye at φ sees the hand from another side than its cursor was made from. No movement makes
    both agree everywhere; a wearer who overlays them by least squares in the image balances what
    is left: ``Σ J_sᵀ (u_φ(s) - u_0(d)) = 0``, u on the focal plane and J_s its derivative in s.

    Parameters
    ----------
    cursor_m, hand_m : (N, 3) float64
        Pairs, in E0(t_b), of a hand that is not rotated.
    shift_m : (3,) float64
        φ to start from.
    distance_m : float
        z(C0→S).
    """
    x, y, z = np.ascontiguousarray(hand_m.T)
    drawn_x, drawn_y = distance_m * (cursor_m[:, :2] / cursor_m[:, 2:]).T
    for _ in range(_BALANCE_STEPS):
        depth_m = z - shift_m[2]
        ratio = (distance_m - shift_m[2]) / depth_m
        slope_x, slope_y = (x - shift_m[0]) / depth_m, (y - shift_m[1]) / depth_m
        # J_s is the ratio times G = [[1, 0, -slope_x], [0, 1, -slope_y]]; u_φ(s) changes with φ by
        # 1 minus the ratio times G.
        left_x = ratio * (shift_m[0] + ratio * (x - shift_m[0]) - drawn_x)
        left_y = ratio * (shift_m[1] + ratio * (y - shift_m[1]) - drawn_y)
        weight = ratio * (1.0 - ratio)
        wx, wy = -(weight @ slope_x), -(weight @ slope_y)
        w, wz = weight.sum(), weight @ (slope_x**2 + slope_y**2)
        normal = np.array([[w, 0.0, wx], [0.0, w, wy], [wx, wy, wz]])
        wanted = [left_x.sum(), left_y.sum(), -(left_x @ slope_x + left_y @ slope_y)]
        shift_m = shift_m - np.linalg.solve(normal, wanted)
    return shift_m


def balanced_turn(outline_m: Float64, R: Float64, about_m: Float64) -> Float64:
    """Return the movement, (3,), by which a wearer balances a turned hand on its cursor.

    An outline that is turned about a point covers the original outline exactly nowhere. The
    wearer moves the hand to where both differ least, by least squares in the image.

    Parameters
    ----------
    outline_m : (N, 3) float64
        The cursor's outline, in E.
    R : (3, 3) float64
        The turned outline is ``about_m + (outline_m - about_m) @ R``.
    about_m : (3,) float64
    """
    drawn = outline_m[:, :2] / outline_m[:, 2:]
    turned_m = about_m + (outline_m - about_m) @ R
    moved_m = np.zeros(3)
    J = np.zeros((len(outline_m), 2, 3))
    for _ in range(_BALANCE_STEPS):
        at_m = turned_m + moved_m
        seen = at_m[:, :2] / at_m[:, 2:]
        J[:, 0, 0] = J[:, 1, 1] = 1.0 / at_m[:, 2]
        J[:, :, 2] = -seen / at_m[:, 2:]
        rows = J.reshape(-1, 3)
        moved_m -= np.linalg.solve(rows.T @ rows, rows.T @ (seen - drawn).ravel())
    return moved_m


def nudged_shift_m(
    display: EyeDisplay,
    shift_m: ArrayLike,
    hand_E_m: ArrayLike,
    right_arcmin: float,
    down_arcmin: float,
    size: float = 0.0,
) -> Float64:
    """Return the φ with which what is drawn at the hand has moved and grown.

    On the focal plane, in units of its distance, a point (x, y, z) of E is drawn at
    ``((1 - φ3φ4) x - (1 - φ4 z) φ1) / (z - φ3)``, with the scale ``(1 - φ3φ4) / (z - φ3)``, and
    likewise in y. The scale gives φ3, then the place gives φ1 and φ2.

    Parameters
    ----------
    display : EyeDisplay
    shift_m : (3,) array_like
        φ of the present drawing.
    hand_E_m : (3,) array_like
        Centre of the hand, in E.
    right_arcmin, down_arcmin : float
        Movement on the display, as at its centre.
    size : float
        Relative growth.

    Raises
    ------
    ValueError
        If the hand is not between the eye and the focal plane, the drawing would vanish or
        grow without limit, or a number is not finite.
    """
    shift, hand = np.asarray(shift_m, dtype=np.float64), np.asarray(hand_E_m, dtype=np.float64)
    moved_arcmin = np.array([right_arcmin, down_arcmin])
    if shift.shape != (3,) or hand.shape != (3,):
        raise ValueError("φ and the hand's centre must be three numbers each")
    if not np.isfinite([*shift, *hand, *moved_arcmin, size]).all():
        raise ValueError("φ, the hand's centre and the nudge must be finite")
    phi_4, depth_m = 1.0 / display.z_C0_S_m, hand[2]
    if not max(shift[2], 0.0) < depth_m < display.z_C0_S_m:
        raise ValueError("the hand must be between the eye and the display's focal plane")
    factor = 1.0 - shift[2] * phi_4
    scale = (1.0 + size) * factor / (depth_m - shift[2])
    if scale <= 2.0 * phi_4:
        raise ValueError("the drawing cannot be made as small as that")
    drawn = (factor * hand[:2] - (1.0 - phi_4 * depth_m) * shift[:2]) / (depth_m - shift[2])
    forward_m = (scale * depth_m - 1.0) / (scale - phi_4)
    K = display.K @ display.H0
    moved_px = K[0, 0] * np.tan(np.radians(moved_arcmin / 60.0))
    pixel = K @ [*drawn, 1.0]
    ray = np.linalg.solve(K, [*(pixel[:2] / pixel[2] + moved_px), 1.0])
    aside = (scale * hand[:2] - ray[:2] / ray[2]) * (depth_m - forward_m)
    return np.array([*(aside / (1.0 - phi_4 * depth_m)), forward_m])
