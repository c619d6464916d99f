"""The user test in a calibration: targets, trials, and the offline calibration to compare with."""

from __future__ import annotations

import numpy as np

from handcal.calibration.procedure import Calibration
from handcal.calibration.states import ProcedureError, State
from handcal.calibration.verifying import draw_offset
from handcal.core.display import target_corners_m
from handcal.core.types import Eye, Float64, Rig
from handcal.link.server import HeadsetServer
from handcal.link.shapes import Target
from handcal.register.nudge import nudged_shift_m
from handcal.session.session import Session
from handcal.session.trial import make_trial
from handcal.station.user_test.comparing import Comparing
from handcal.station.weak import weakly


class Trials:
    """Shows targets and other drawings in the headset, and saves trials.

    A trial measures and does not change the calibration: while a target is shown, φ moved by hand
    is not stored, and after each trial the headset draws with the calibrated φ again.

    Parameters
    ----------
    calibration : Calibration
    rig : Rig
    link : HeadsetServer
    session : Session

    Attributes
    ----------
    comparing : Comparing
    target_E_m : dict of eye to (4, 3) float64
        Corners of the target, for the eye to which it is shown; empty while it is hidden.
    is_offline : bool
        True while the headset draws with the offline calibration.
    """

    def __init__(
        self, calibration: Calibration, rig: Rig, link: HeadsetServer, session: Session
    ) -> None:
        self._calibration = calibration
        self._rig = rig
        self._link = link
        self._session = session
        self.comparing = Comparing(session, weakly(self.show_offline))
        self.target_E_m: dict[Eye, Float64] = {}
        self.is_offline = False
        self._starts_aside = False
        self._returns: set[Eye] = set()  # eyes drawn with the φ of a trial
        self._rng = np.random.default_rng()

    def save(self, eye: Eye, depth_m: float) -> int:
        """Save a trial: the calibrated φ against the one set by hand, for a target at a distance.

        Then the eye is drawn with the calibrated φ again, or moved aside for the next trial.

        Raises
        ------
        ProcedureError
            Unless the calibrated φ is applied, or if the eye is not solved.
        FileError
            If the session cannot be written.
        """
        self._require_applied()
        results = self._calibration.results
        if results is None or eye not in results.eyes:
            raise ProcedureError(f"solve the {eye} eye first")
        calibrated_m = results.rendered_shift_m[eye]
        trial = make_trial(
            self._rig.eyes[eye],
            eye,
            depth_m,
            calibrated_m,
            self._calibration.applied_shift_m[eye],
        )
        number = self._session.save_trial(trial)
        if eye in self.target_E_m:
            self._begin(eye, depth_m)
        else:
            self._calibration.set_shift({eye: calibrated_m})
            self._calibration.record_shift()
        return number

    def show_target(self, eye: Eye, depth_m: float, *, starts_aside: bool = False) -> None:
        """Show the target of a trial to one eye in the headset, while the calibrated φ is applied.

        Each trial begins with the calibrated φ; with `starts_aside`, it begins with a drawing that
        is moved aside at random, as the method of adjustment asks for.

        Raises
        ------
        ProcedureError
            Unless the calibrated φ is applied.
        LinkError
            If the link is closed.
        """
        self._require_applied()
        self._return_to_final()
        corners_E_m = target_corners_m(depth_m)
        self._link.send_target(Target(eye, corners_E_m - self._rig.eyes[eye].t_C0_V_m))
        self.target_E_m, self._starts_aside = {eye: corners_E_m}, starts_aside
        self._begin(eye, depth_m)

    def hide_target(self) -> None:
        """Hide the target if it is shown; φ returns to the final one."""
        if self.target_E_m:
            self._link.send_target(None)
            self.target_E_m = {}
        self._return_to_final()

    def record_shift(self) -> None:
        """Record φ set by hand as final, unless it was moved for a trial.

        Raises
        ------
        FileError
            If the session cannot be written.
        """
        if not self.target_E_m:
            self._calibration.record_shift()

    def compare(self) -> None:
        """Begin a blinded comparison of the offline calibration and the applied φ.

        Raises
        ------
        ProcedureError
            Unless the calibrated φ is applied, or if it is the offline one.
        LinkError
            If the link is closed.
        """
        self._require_applied()
        self.hide_target()
        self.comparing.begin(self._calibration.applied_shift_m)

    def show_offline(self, is_shown: bool) -> None:
        """Have the headset draw with the offline calibration, or with the applied one again.

        Raises
        ------
        ProcedureError
            Unless the calibrated φ is applied.
        LinkError
            If the link is closed.
        """
        if is_shown:
            self._require_applied()
        if is_shown != self.is_offline:
            self._link.send_show(is_shown)
            self.is_offline = is_shown

    def follow_procedure(self) -> None:
        """End what is shown once the calibrated φ is no longer applied, or is another one."""
        if self._calibration.state is not State.APPLIED:
            self.hide_target()
            self.comparing.end()
            self.show_offline(False)
        elif not self.target_E_m:
            self._return_to_final()  # which waited for a cursor to go
        self.comparing.check(self._calibration.applied_shift_m)

    def _begin(self, eye: Eye, depth_m: float) -> None:
        """Draw one eye with the φ with which a trial begins."""
        results = self._calibration.results
        shift_m = self._calibration.applied_shift_m[eye]
        if results is not None and eye in results.eyes:
            shift_m = results.rendered_shift_m[eye]
        if self._starts_aside:
            aside, centre_E_m = draw_offset(self._rng), np.array([0.0, 0.0, depth_m])
            shift_m = nudged_shift_m(
                self._rig.eyes[eye],
                shift_m,
                centre_E_m,
                aside.right_arcmin,
                aside.down_arcmin,
            )
        self._returns.add(eye)
        self._calibration.set_shift({eye: shift_m})

    def _return_to_final(self) -> None:
        """Draw the eyes of trials with their final φ, as soon as φ can be set."""
        if self._returns and self._calibration.state in (State.SHOW_HAND, State.APPLIED):
            final_m = self._session.contents.applied_shift_m
            self._calibration.set_shift(
                {eye: final_m.get(eye, np.zeros(3)) for eye in self._returns}
            )
            self._returns = set()

    def _require_applied(self) -> None:
        if self._calibration.state is not State.APPLIED:
            raise ProcedureError("solve and apply first")
