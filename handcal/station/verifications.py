"""The part of the procedure that makes verifications: the wearer's nudges in, φ out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace

from handcal.errors import HandError
from handcal.geometry import transform
from handcal.link.nudges import VerifyRequest
from handcal.link.server import HeadsetServer, Nudge
from handcal.rig_types import Rig
from handcal.session.session import Session, SessionRecord
from handcal.session.state import VERIFYING
from handcal.station.alignments import AlignmentSteps
from handcal.station.hands import PlacedHand
from handcal.station.hold import merge_hold
from handcal.station.states import CalibrationSettings, Observation, ProcedureError, State
from handcal.station.verifying import (
    SKIPPED,
    Verifying,
    hand_centre_E_m,
    new_id,
    resumed,
    verify_prompt,
)
from handcal.types import EYES, Eye, Float64, Frame, Verification


class VerificationSteps(AlignmentSteps, ABC):
    """Draws the hand's outline for one eye, and moves it by the wearer's nudges.

    The middle part of `handcal.station.procedure.Calibration`, which documents the parameters.
    """

    def __init__(
        self,
        rig: Rig,
        link: HeadsetServer,
        session: Session | None,
        settings: CalibrationSettings,
        resume: SessionRecord | None,
        wearer: str,
    ) -> None:
        super().__init__(rig, link, session, settings, resume, wearer)
        self.verifications: dict[Eye, Verification] = {}
        self.verifying: Verifying | None = None
        self._before_verifying = State.SHOW_HAND

    @abstractmethod
    def _use_verification(self) -> None:
        """Solve and apply with a new verification."""

    @property
    def refusal(self) -> str:
        """Reason why the wearer's last confirmation was refused; else empty."""
        return super().refusal if self.verifying is None else self.verifying.refusal

    def step(self, frame: Frame) -> Observation:
        """Process a frame as `AlignmentSteps.step`, and follow the nudges of a verification."""
        observation = super().step(frame)
        if self.verifying is not None:
            self._follow_nudges(observation, self.verifying)
        return replace(observation, state=self.state)

    def verify(self, eye: Eye) -> None:
        """Have the wearer verify one eye: move what it draws until it covers the resting hand.

        Raises
        ------
        ProcedureError
            While a cursor is shown, or what is drawn is not acknowledged, or without a hand.
        FileError
            If the session cannot be written; the verification begins anyway.
        """
        if self.state not in (State.SHOW_HAND, State.APPLIED, State.VERIFY):
            raise ProcedureError(f"an eye cannot be verified now ({self.state}): solve and apply")
        hand = self._hands.newest(self._settings.match_tolerance_s)
        if hand is None:
            raise ProcedureError("hold the hand up in view of the camera, then verify")
        if not self.is_applied:
            self._link.send_again()
            raise ProcedureError("the headset has not acknowledged its projections yet; wait")
        if self.verifying is not None:
            self._end_verifying(self.verifying.before_m)
        self._before_verifying = self.state
        self.verifying = Verifying(
            VerifyRequest(new_id(), eye),
            self.rig.eyes[eye],
            self._drawing.shift_m[eye],
            hand_centre_E_m(self.rig, eye, hand),
            hand.t_host_ns,
        )
        self._ask_to_verify(self.verifying)
        self._store.event(VERIFYING, **self.verifying.event())

    def nudge(self, eye: Eye, right_arcmin: float, down_arcmin: float, size: float = 0.0) -> None:
        """Move what the verified eye draws, by the wearer's nudge; the projection is sent.

        Raises
        ------
        ProcedureError
            Unless this eye is being verified, or if the drawing would be moved too far.
        FileError
            If the session cannot be written; the drawing is moved anyway.
        """
        verifying = self._require_verifying(eye)
        self._nudge(lambda: verifying.nudge(right_arcmin, down_arcmin, size))

    def undo_nudge(self) -> None:
        """Undo the last nudge; raises as `nudge`."""
        self._nudge(self._require_verifying().undo)

    def redo_nudge(self) -> None:
        """Redo the last nudge that was undone; raises as `nudge`."""
        self._nudge(self._require_verifying().redo)

    def verified(self) -> None:
        """Confirm for the wearer, who has told the technician, that the drawing covers the hand.

        Raises
        ------
        ProcedureError
            Unless an eye is being verified, the headset draws it as nudged, and the hand is still.
        FileError
            If the session cannot be written; the verification counts anyway.
        """
        verifying = self._require_verifying()
        hand = self._hands.steady()
        if hand is None:
            raise ProcedureError("the hand must be still and in view of the camera")
        if not self.is_applied:
            raise ProcedureError("the headset has not received the projection yet; wait")
        self._accept_verification(verifying, hand)

    def skip_verification(self) -> None:
        """End the verification without a result; the eye is drawn with the φ before it.

        Raises
        ------
        ProcedureError
            Unless an eye is being verified.
        FileError
            If the session cannot be written; the verification ends anyway.
        """
        verifying = self._require_verifying()
        self._end_verifying(verifying.before_m)
        self._store.event(SKIPPED, eye=verifying.eye)

    def _resume_verifying(self, record: SessionRecord) -> None:
        """Restore the verification that a session was in."""
        verifying = resumed(record.events, self.rig.eyes)
        if verifying is not None:
            self._before_verifying = self.state
            self.verifying = verifying
            self._drawing.shift_m[verifying.eye] = verifying.shift_m
            self._ask_to_verify(verifying)

    def _require_verifying(self, eye: Eye | None = None) -> Verifying:
        if self.verifying is None or eye not in (None, self.verifying.eye):
            raise ProcedureError(f"the {eye or ''} eye is not being verified ({self.state})")
        return self.verifying

    def _ask_to_verify(self, verifying: Verifying) -> None:
        self.state = State.VERIFY
        self.eyes = (verifying.eye,)
        self._link.send_prompt(verify_prompt(verifying.eye), self.eyes)
        self._link.send_verify(verifying.request)

    def _nudge(self, move: Callable[[], None]) -> None:
        """Move the drawing of the verified eye, and send and store it."""
        verifying = self._require_verifying()
        try:
            move()
        except ValueError as error:
            raise ProcedureError(str(error)) from error
        self._drawing.shift_m[verifying.eye] = verifying.shift_m
        self._drawing.send({verifying.eye: verifying.shift_m})
        self._store.event(VERIFYING, **verifying.event())

    def _follow_nudges(self, observation: Observation, verifying: Verifying) -> None:
        """Draw the hand's outline for the verified eye, and take the wearer's nudges."""
        if observation.hand is not None:
            outline_W_m = transform(observation.hand.T_W_D, observation.hand.cloud.contour_m)
            self._link.send_live_hand(outline_W_m, False, (verifying.eye,), is_outline=True)
        verify_id = verifying.request.verify_id
        if heard := [one for one in self._link.nudges() if one.verify_id == verify_id]:
            self._hear(heard[-1], verifying)  # it has the sums of all
        fits = verifying.fits
        if fits is None or self._hands.placed_until_ns() < fits.t_host_ns:
            return
        verifying.fits = None
        if fits.problem:
            if self.is_applied:
                self.evidence.drawn_otherwise(fits.problem)
            self._link.send_again()
            self._refuse_verification(verifying, "The drawing has changed. Look and confirm again.")
            return
        try:
            hand = self._hands.nearest(fits.t_host_ns, self._settings.match_tolerance_s)
        except HandError as error:
            self._refuse_verification(verifying, f"{error}. Hold it up and confirm again.")
            return
        if self._hands.steady() is None:
            self._refuse_verification(verifying, "Hold your hand still, and confirm again.")
            return
        self.evidence.drawn_as_sent()
        self._accept_verification(verifying, hand)

    def _hear(self, nudge: Nudge, verifying: Verifying) -> None:
        step = verifying.hear(nudge)
        if step is not None:
            try:
                self._nudge(lambda: verifying.nudge(*step))
            except ProcedureError as error:
                self._refuse_verification(verifying, f"{error}.")

    def _refuse_verification(self, verifying: Verifying, prompt: str) -> None:
        verifying.refusal = prompt
        self._link.send_prompt(prompt, self.eyes)
        self._store.event("verification_refused", eye=verifying.eye, reason=prompt)

    def _accept_verification(self, verifying: Verifying, hand: PlacedHand) -> None:
        """Store and fuse a verification, and send what it leads to."""
        hand = merge_hold(self._hands.held_at(hand), hand)
        found = verifying.result(hand_centre_E_m(self.rig, verifying.eye, hand))
        found = found.after(self.verifications.get(verifying.eye))
        self.verifications[verifying.eye] = found
        self._end_verifying(verifying.shift_m)
        self._store.write_later(lambda session: session.save_facts(verified={verifying.eye: found}))
        self._use_verification()

    def _end_verifying(self, shift_m: Float64) -> None:
        """Draw the verified eye with φ, and return to the state before."""
        verifying = self._require_verifying()
        self.verifying = None
        self.state = self._before_verifying
        self._drawing.shift_m[verifying.eye] = shift_m
        self._drawing.send({verifying.eye: shift_m})
        self._link.send_verify(None)
        self._link.send_prompt("", EYES)
