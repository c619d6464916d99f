"""The wearer's views of a running station: each eye's in turn, as often as the frames allow."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

from handcal.display import view_of_eye
from handcal.geometry import invert, transform
from handcal.rig_types import Rig
from handcal.sim.eyes import TrueEyes
from handcal.sim.simulation import Simulation
from handcal.sim.wearer_settings import WearerSettings
from handcal.station.hands import PlacedHand
from handcal.station.procedure import Calibration
from handcal.station.settings import StationSettings
from handcal.station.wearer_view import EyeView, render_eye_view
from handcal.types import Eye, Float64

_PERIOD_S = 0.1


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
    shown : dict of Eye to EyeView
        The newest view of each eye.
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
        self.shown: dict[Eye, EyeView] = {}
        self._viewed: Eye = "right"
        self._next_s = 0.0

    def render_next(
        self, hand: PlacedHand, targets_E_m: Mapping[Eye, Float64], is_offline: bool
    ) -> None:
        """Render the next eye's view if it is time.

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
        if started_s < self._next_s:
            return
        eye: Eye = "left" if self._viewed == "right" else "right"
        self.shown[eye] = self._see(eye, hand, targets_E_m.get(eye), is_offline)
        self._viewed = eye
        ended_s = time.monotonic()
        # On a busy computer frames have priority.
        self._next_s = ended_s + max(_PERIOD_S, 3.0 * (ended_s - started_s))

    def _see(
        self, eye: Eye, hand: PlacedHand, target_E_m: Float64 | None, is_offline: bool
    ) -> EyeView:
        calibration, display = self._calibration, self._rig.eyes[eye]
        drawn_shift_m = np.zeros(3) if is_offline else calibration.applied_shift_m[eye]
        cursor = calibration.cursor
        T_W_H = hand.T_W_D @ invert(self._rig.T_H_D)
        image = None
        if self._simulation is not None and self._true_eyes is not None:
            eye_shift_m = self._true_eyes.shift_m[eye]
            scene = self._simulation.scene_at(hand.t_host_ns)
            if scene is not None:
                T_W_H = scene.T_W_D @ invert(self._worn_rig.T_H_D)
                image = self._true_eyes.look(eye, T_W_H, scene.T_W_hand)
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
            np.empty((0, 3)) if target_E_m is None else target_E_m,
            is_true=image is not None,
            image=image,
        )


def _outline_E(T_E_W: Float64, hand: PlacedHand) -> Float64:
    return transform(T_E_W @ hand.T_W_D, hand.cloud.contour_m)
