"""The wearer's views of a running station: both eyes of one moment, one rendered at a time."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handcal.calibration.hands import PlacedHand
from handcal.calibration.procedure import Calibration
from handcal.core.display import view_of_eye
from handcal.core.geometry import invert, transform
from handcal.core.types import EYES, Eye, Float64, Rig
from handcal.sim.scene import SceneState
from handcal.sim.simulation import Simulation, TrueEyes
from handcal.sim.wearer_settings import WearerSettings
from handcal.station.settings import StationSettings
from handcal.station.wearer_view import EyeView, render_eye_view

_PERIOD_S = 0.2
_STALE_NS = 2_000_000_000
"""Age of a moment whose second eye is no longer rendered: the hand has been out of sight."""


@dataclass(frozen=True, slots=True, eq=False)
class _Moment:
    """The hand, drawings and scene that the views of both eyes show."""

    hand: PlacedHand
    cursor: PlacedHand | None
    targets_E_m: Mapping[Eye, Float64]
    drawn_shift_m: Mapping[Eye, Float64]
    scene: SceneState | None


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
        self._moment: _Moment | None = None
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
        moment = self._moment
        if moment is None or hand.t_host_ns - moment.hand.t_host_ns > _STALE_NS:
            if started_s < self._next_s:
                return
            moment = self._moment = self._begin(hand, targets_E_m, is_offline)
            self._next_s, self._spent_s, self._seen = started_s + _PERIOD_S, 0.0, {}
        eye = EYES[len(self._seen)]
        self._seen[eye] = self._see(eye, moment)
        ended_s = time.monotonic()
        self._spent_s += ended_s - started_s
        if len(self._seen) == len(EYES):
            self.shown, self._moment = self._seen, None
            # On a busy computer frames have priority.
            self._next_s = max(self._next_s, ended_s + 3.0 * self._spent_s)

    def _begin(
        self, hand: PlacedHand, targets_E_m: Mapping[Eye, Float64], is_offline: bool
    ) -> _Moment:
        applied_m = self._calibration.applied_shift_m
        return _Moment(
            hand,
            self._calibration.cursor,
            dict(targets_E_m),
            {eye: np.zeros(3) if is_offline else applied_m[eye] for eye in EYES},
            self._simulation.scene_at(hand.t_host_ns) if self._simulation is not None else None,
        )

    def _see(self, eye: Eye, moment: _Moment) -> EyeView:
        calibration, display = self._calibration, self._rig.eyes[eye]
        hand, cursor, drawn_shift_m = moment.hand, moment.cursor, moment.drawn_shift_m[eye]
        T_W_H = hand.T_W_D @ invert(self._rig.T_H_D)
        image = None
        if self._true_eyes is not None:
            eye_shift_m = self._true_eyes.shift_m[eye]
            if moment.scene is not None:
                T_W_H = moment.scene.T_W_D @ invert(self._worn_rig.T_H_D)
                image = self._true_eyes.look(eye, T_W_H, moment.scene.T_W_hand)
        elif calibration.results is not None and eye in calibration.results.eyes:
            eye_shift_m = calibration.results.eyes[eye].shift_m
        else:
            eye_shift_m = drawn_shift_m
        T_E_W = view_of_eye(display, T_W_H)
        return render_eye_view(
            eye,
            display,
            eye_shift_m,
            drawn_shift_m,
            _outline_E(T_E_W, hand),
            np.empty((0, 3)) if cursor is None else _outline_E(T_E_W, cursor),
            moment.targets_E_m.get(eye, np.empty((0, 3))),
            is_true=image is not None,
            image=image,
        )


def _outline_E(T_E_W: Float64, hand: PlacedHand) -> Float64:
    return transform(T_E_W @ hand.T_W_D, hand.cloud.outline_m)
