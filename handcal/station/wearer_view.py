"""The view of each eye through the display: the hand, and the overlay drawn by the headset.

The simulator knows the true eye and renders its view. For a real headset the view is predicted with
the calibrated eye position.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from handcal.calibration.hands import PlacedHand
from handcal.calibration.procedure import Calibration
from handcal.core.display import arcmin_from_px, eye_projection, view_of_eye
from handcal.core.frozen import freeze
from handcal.core.geometry import invert, project, transform
from handcal.core.types import EYES, Eye, EyeDisplay, Float64, Rig, UInt8
from handcal.sim.simulation import Simulation, TrueEyes
from handcal.sim.wearer_settings import WearerSettings
from handcal.station.settings import StationSettings

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


_PERIOD_S = 0.2
_STALE_NS = 2_000_000_000
"""Age of a moment whose second eye is no longer rendered: the hand has been out of sight."""


class EyeViews:
    """Renders the wearer's views, through the true eyes where camera and wearer are simulated.

    Parameters
    ----------
    calibration : Calibration
    rig : Rig
    settings : StationSettings
    simulation : Simulation or None
    worn_rig : Rig
        Rig of the headset actually worn.

    Attributes
    ----------
    shown : Mapping of Eye to EyeView
        The newest views, of both eyes at one moment; empty before.
    """

    def __init__(
        self,
        calibration: Calibration,
        rig: Rig,
        settings: StationSettings,
        simulation: Simulation | None,
        worn_rig: Rig,
    ) -> None:
        self._calibration = calibration
        self._rig = rig
        self._simulation = simulation
        self._worn_rig = worn_rig
        self._true_eyes: TrueEyes | None = None
        if simulation is not None and settings.source == "simulator":
            wearer = WearerSettings(slip_m=settings.slip_m)
            self._true_eyes = TrueEyes(simulation.world, worn_rig, settings.seed, wearer)
        self.shown: Mapping[Eye, EyeView] = {}
        self._seen_ns = 0
        self._see: Callable[[Eye], EyeView] | None = None
        self._seen: dict[Eye, EyeView] = {}
        self._next_s = self._spent_s = 0.0

    def render_next(
        self, hand: PlacedHand, targets_E_m: Mapping[Eye, Float64], is_offline: bool
    ) -> None:
        """Render the next eye's view if it is time; both eyes' are then shown together.

        Each call renders one, as two would delay the frame too much.

        Parameters
        ----------
        hand : PlacedHand
            The live hand.
        targets_E_m : Mapping of Eye to (4, 3) float64
            Corners of the user test's target, for the eye to which it is shown.
        is_offline : bool
            True while the headset draws with the offline calibration.
        """
        started_s = time.monotonic()
        if self._see is None or hand.t_host_ns - self._seen_ns > _STALE_NS:
            if started_s < self._next_s:
                return
            self._see = self._at_moment(hand, dict(targets_E_m), is_offline)
            self._seen_ns, self._seen = hand.t_host_ns, {}
            self._next_s, self._spent_s = started_s + _PERIOD_S, 0.0
        eye = EYES[len(self._seen)]
        self._seen[eye] = self._see(eye)
        ended_s = time.monotonic()
        self._spent_s += ended_s - started_s
        if len(self._seen) == len(EYES):
            self.shown, self._see = self._seen, None
            # On a busy computer frames have priority.
            self._next_s = max(self._next_s, ended_s + 3.0 * self._spent_s)

    def _at_moment(
        self, hand: PlacedHand, targets_E_m: Mapping[Eye, Float64], is_offline: bool
    ) -> Callable[[Eye], EyeView]:
        """Return what renders an eye's view of hand, drawings and scene as they are now."""
        calibration, true_eyes = self._calibration, self._true_eyes
        results, cursor = calibration.results, calibration.cursor
        applied_m = calibration.applied_shift_m
        T_W_H, scene = hand.T_W_D @ invert(self._rig.T_H_D), None
        if self._simulation is not None:
            scene = self._simulation.scene_at(hand.t_host_ns)
        if true_eyes is not None and scene is not None:
            T_W_H = scene.T_W_D @ invert(self._worn_rig.T_H_D)

        def see(eye: Eye) -> EyeView:
            display, image = self._rig.eyes[eye], None
            drawn_shift_m = np.zeros(3) if is_offline else applied_m[eye]
            eye_shift_m = drawn_shift_m
            if true_eyes is not None:
                eye_shift_m = true_eyes.shift_m[eye]
                if scene is not None:
                    image = true_eyes.look(eye, T_W_H, scene.T_W_hand)
            elif results is not None and eye in results.eyes:
                eye_shift_m = results.eyes[eye].shift_m
            T_E_W = view_of_eye(display, T_W_H)
            return render_eye_view(
                eye,
                display,
                eye_shift_m,
                drawn_shift_m,
                _outline_E(T_E_W, hand),
                np.empty((0, 3)) if cursor is None else _outline_E(T_E_W, cursor),
                targets_E_m.get(eye, np.empty((0, 3))),
                is_true=image is not None,
                image=image,
            )

        return see


def _outline_E(T_E_W: Float64, hand: PlacedHand) -> Float64:
    return transform(T_E_W @ hand.T_W_D, hand.cloud.outline_m)
