"""The user test in a calibration: targets, trials, and the offline calibration to compare with."""

from __future__ import annotations

from handcal.calibration.procedure import Calibration
from handcal.calibration.states import ProcedureError, State
from handcal.core.display import target_corners_m
from handcal.core.types import Eye, Float64, Rig
from handcal.link.server import HeadsetServer
from handcal.link.shapes import Target
from handcal.session.session import Session
from handcal.session.trial import make_trial
from handcal.station.user_test.comparing import Comparing
from handcal.station.weak import weakly


class Trials:
    """Shows targets and other drawings in the headset, and saves trials.

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

    def save(self, eye: Eye, depth_m: float) -> int:
        """Save a trial: the calibrated φ against the one set by hand, for a target at a distance.

        Raises
        ------
        ProcedureError
            If the eye is not solved.
        FileError
            If the session cannot be written.
        """
        results = self._calibration.results
        if results is None or eye not in results.eyes:
            raise ProcedureError(f"solve the {eye} eye first")
        trial = make_trial(
            self._rig.eyes[eye],
            eye,
            depth_m,
            results.rendered_shift_m[eye],
            self._calibration.applied_shift_m[eye],
        )
        return self._session.save_trial(trial)

    def show_target(self, eye: Eye, depth_m: float) -> None:
        """Show the target of a trial to one eye in the headset, while the calibrated φ is applied.

        Raises
        ------
        ProcedureError
            Unless the calibrated φ is applied.
        LinkError
            If the link is closed.
        """
        self._require_applied()
        corners_E_m = target_corners_m(depth_m)
        self._link.send_target(Target(eye, corners_E_m - self._rig.eyes[eye].t_C0_V_m))
        self.target_E_m = {eye: corners_E_m}

    def hide_target(self) -> None:
        """Hide the target if it is shown."""
        if self.target_E_m:
            self._link.send_target(None)
            self.target_E_m = {}

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
        self.comparing.check(self._calibration.applied_shift_m)

    def _require_applied(self) -> None:
        if self._calibration.state is not State.APPLIED:
            raise ProcedureError("solve and apply first")
