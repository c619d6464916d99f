"""The view of each eye through the display: the hand, and the overlay drawn by the headset.

The simulator knows the true eye and renders its view. For a real headset the view is predicted with
the calibrated eye position.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from handcal.core.display import arcmin_from_px, eye_projection
from handcal.core.frozen import freeze
from handcal.core.geometry import project
from handcal.core.types import Eye, EyeDisplay, Float64, UInt8

_NEAREST_M = 0.05
_NO_TARGET_M = np.empty((0, 3))


@dataclass(frozen=True, slots=True, eq=False)
class Overlay:
    """The live hand's outline as drawn by the headset, and its error on the hand."""

    outline_px: Float64
    """(N, 2); point by point as `EyeView.hand_px`."""
    error_px: float | None
    error_arcmin: float | None
    """Mean distance between these points; None without an outline."""

    def __post_init__(self) -> None:
        freeze(self, "outline_px", np.float64, None, 2)


@dataclass(frozen=True, slots=True, eq=False)
class EyeView:
    """One eye's view, in pixels of its display."""

    eye: Eye
    width_px: int
    height_px: int
    """Size of the display."""
    hand_px: Float64
    """(N, 2); outline of the live hand as the eye sees it through the display."""
    drawn: Overlay
    """Drawn with the present φ; lies on the hand if the calibration is right."""
    offline: Overlay
    """Drawn with the offline calibration, as before any alignment."""
    cursor_px: Float64
    """(M, 2); the cursor as drawn by the headset; empty if there is none."""
    target_px: Float64
    """(4, 2); the user test's target as the eye sees it at its place; empty while it is not
    shown."""
    drawn_target_px: Float64
    """(4, 2); the target as drawn by the headset; coincides if the calibration is right."""
    is_true: bool
    """True for the simulated wearer's true eye; False if the view is predicted."""
    image: UInt8 | None = None
    """(h, w, 3); RGB of the world behind the display, scaled to it; None if unknown."""

    def __post_init__(self) -> None:
        freeze(self, "hand_px", np.float64, None, 2)
        freeze(self, "cursor_px", np.float64, None, 2)
        freeze(self, "target_px", np.float64, None, 2)
        freeze(self, "drawn_target_px", np.float64, None, 2)
        freeze(self, "image", np.uint8, None, None, 3)


def render_eye_view(
    eye: Eye,
    display: EyeDisplay,
    eye_shift_m: ArrayLike,
    drawn_shift_m: ArrayLike,
    outline_E_m: Float64,
    cursor_E_m: Float64,
    target_E_m: Float64 = _NO_TARGET_M,
    *,
    is_true: bool,
    image: UInt8 | None = None,
) -> EyeView:
    """Return the view of an eye, of a hand and the overlay drawn for an eye with another φ.

    Parameters
    ----------
    eye : {"left", "right"}
    display : EyeDisplay
    eye_shift_m : (3,) array_like
        φ of the viewing eye.
    drawn_shift_m : (3,) array_like
        φ that the headset renders with.
    outline_E_m : (N, 3) float64
        The live hand's outline.
    cursor_E_m : (M, 3) float64
    target_E_m : (4, 3) float64, optional
        Corners of the user test's target while it is shown.
    is_true, image
        As in `EyeView`.
    """
    drawn = eye_projection(display, drawn_shift_m)
    outline_m = _in_front(outline_E_m)
    seen = eye_projection(display, eye_shift_m)
    hand_px = project(seen, outline_m)
    return EyeView(
        eye=eye,
        width_px=display.width_px,
        height_px=display.height_px,
        hand_px=hand_px,
        drawn=_overlay(display, project(drawn, outline_m), hand_px),
        offline=_overlay(display, project(eye_projection(display), outline_m), hand_px),
        cursor_px=project(drawn, _in_front(cursor_E_m)),
        target_px=project(seen, target_E_m),
        drawn_target_px=project(drawn, target_E_m),
        is_true=is_true,
        image=image,
    )


def _in_front(points_E_m: Float64) -> Float64:
    return points_E_m[points_E_m[:, 2] > _NEAREST_M]


def _overlay(display: EyeDisplay, outline_px: Float64, hand_px: Float64) -> Overlay:
    if not len(outline_px):
        return Overlay(outline_px, None, None)
    error_px = float(np.linalg.norm(outline_px - hand_px, axis=1).mean())
    return Overlay(outline_px, error_px, float(arcmin_from_px(display, error_px)))
