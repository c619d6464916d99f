"""Verification: the wearer moves the drawing of the resting hand until it covers the hand.

A drawing with φ moves and grows on the display as φ changes. For a hand at one place, movement to
the right, movement down and growth determine φ, and vice versa. So the movement that the
wearer makes is the remaining error, and the φ that it leads to is one more observation, with
the precision at which a person sees two outlines coincide.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from handcal.core.types import EyeDisplay, Float64


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
