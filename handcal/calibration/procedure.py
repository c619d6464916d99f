"""The calibration procedure as a state machine: show hand, align, solve, apply, verify, repeat.

::

    SHOW_HAND --make_cursor--> ALIGN --confirmation, guard passed--> ALIGNED
        ^                        |  ^________________ refused            |
        |_________redo___________|                                     solve
        |_________redo______________________________________________    |
        |                                                           |   v
        '--make_cursor-- APPLIED <--acknowledged-- APPLYING <--apply-- SOLVED
                          |  ^                                         ^
                        verify skip_verification                       |
                          v  |                                       solve
                         VERIFY --the drawing fits-----------------------'

A cursor that is discarded after a result was applied returns to APPLIED.

Between these steps alignments can be deleted and restored, the wearer's eye distance can be set,
and all can be solved again; φ can be set by hand while no cursor is shown. The procedure only
combines the other parts: `Sight` finds the hand, `Aligning` and `Verifying` judge what the wearer
does, `Drawing` sends the projections, and the session holds what was made. One thread drives it:
`step` for every frame, all other calls in between.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from handcal.calibration.aligning import (
    KEEP_PROMPT,
    OUT_OF_VIEW,
    Accepted,
    Aligning,
    Refused,
    align_prompt,
)
from handcal.calibration.drawing import Drawing
from handcal.calibration.evidence import Contradiction, Evidence
from handcal.calibration.hands import PlacedHand
from handcal.calibration.hold import merge_hold
from handcal.calibration.sight import Sight
from handcal.calibration.solve_again import solve_again, solve_contents
from handcal.calibration.states import (
    MAX_HAND_SET_SHIFT_M,
    CalibrationSettings,
    Observation,
    ProcedureError,
    State,
)
from handcal.calibration.verifying import (
    CHANGED,
    SET_ASIDE_PROMPT,
    SKIPPED,
    UNMOVED_PROMPT,
    Verifying,
    VerifyingView,
    draw_offset,
    hand_centre_E_m,
    new_id,
    resumed,
    verify_prompt,
)
from handcal.core.display import as_shifts
from handcal.core.errors import FileError, HandcalError
from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import (
    EYES,
    LOOK_AROUND,
    Alignment,
    CameraIdentity,
    Eye,
    EyeDistance,
    EyePlan,
    Float64,
    Frame,
    HeadsetIdentity,
    Verification,
)
from handcal.hand.marks import outline_marks
from handcal.link.nudges import VerifyRequest
from handcal.link.reliable import Delivery, Outgoing
from handcal.link.server import Confirmation, HeadsetServer, Nudge
from handcal.register.results import Results, results_json
from handcal.session.facts import CameraUsed, facts_json
from handcal.session.session import Session, SessionRecord
from handcal.session.state import VERIFYING, WENT_BACK


@dataclass(frozen=True, slots=True, eq=False)
class Procedure:
    """The state of a calibration at one moment; what was made is in the session."""

    state: State
    eyes: tuple[Eye, ...]
    """Eyes that the present cursor is for."""
    cursor: PlacedHand | None
    """The frozen hand while it is shown, else None."""
    refusal: str
    """Reason why the wearer's last confirmation was refused; empty if none was."""
    results: Results | None
    """Results of all alignments; None if there are none or the alignments have changed since."""
    applied_shift_m: Mapping[Eye, Float64]
    """each (3,); φ that the headset renders with."""
    is_applied: bool
    """True if the headset has acknowledged it."""
    verifying: VerifyingView | None = None
    """The verification in progress, in the state `verify`."""
    former_shift_m: Mapping[Eye, Float64] = field(default_factory=dict)
    """each (3,); φ to which `Calibration.go_back` returns."""
    refused_for: str = ""
    """`refusal` in the past tense, if the live hand shows whether its cause lasts; else empty."""


_UNSETTLED = (State.ALIGN, State.VERIFY, State.APPLYING)
_NO_SHIFT: Mapping[Eye, ArrayLike] = MappingProxyType({})


class Calibration:
    """One wearer's calibration.

    It continues where its session is. It first sends the projections that the session had last, or
    the offline ones, so that the headset does not continue to render with those of another
    calibration.

    Parameters
    ----------
    session : Session
        Holds rig, wearer, plan and everything that is made. Data that cannot be written are kept
        and written before the next data, or by `Session.write_waiting`; a call whose data were not
        written has its effect all the same and raises FileError.
    link : HeadsetServer
    settings : CalibrationSettings
    former_m : mapping of eye to (3,) array_like
        φ of a stored session to start from, in place of the offline calibration.

    Raises
    ------
    ProcedureError
        If the session was solved, but can no longer be solved.

    Attributes
    ----------
    rig : Rig
    state : State
    eyes : tuple of eye
        Eyes open in the present alignment.
    results : Results or None
        Of all alignments; None before `solve`, after an alignment was deleted or restored, and
        after the eye distance was changed.
    raised : PlacedHand or None
        The hand that was frozen first since it was raised, while the wearer keeps it up.
    verifying : Verifying or None
        The verification in progress, in the state `verify`.
    camera : CameraIdentity
        The camera that gives the frames; set it before `step`.
    evidence : Evidence
        Evidence from outside the solver against the result.
    unmoved : set of eye
        Eyes whose verification ended without evidence: nobody moved the drawing.
    """

    def __init__(
        self,
        session: Session,
        link: HeadsetServer,
        settings: CalibrationSettings | None = None,
        former_m: Mapping[Eye, ArrayLike] = _NO_SHIFT,
    ) -> None:
        record = session.contents
        self.rig = record.rig
        self.state = State.SHOW_HAND
        self.eyes: tuple[Eye, ...] = EYES
        self.results: Results | None = None
        self.raised: PlacedHand | None = None
        self.verifying: Verifying | None = None
        self.camera = CameraIdentity()
        used = record.facts.camera if record.is_solvable else None
        self.evidence = Evidence(self.rig, _earlier_evidence(record), used)
        self._session = session
        self._link = link
        self._settings = settings or CalibrationSettings()
        self._sight = Sight(self.rig, link, self._settings, self.evidence)
        self._drawing = Drawing(self.rig, link, record.wearer)
        self._aligning: Aligning | None = None
        self._withdrawn_for = ""
        self._cursor_id = 0
        self._sent_cursor: Outgoing | None = None
        self._headset: HeadsetIdentity | None = None
        self._looks_around = False
        self._before_verifying = State.SHOW_HAND
        self._apply_until_s = 0.0
        self._rng = np.random.default_rng()
        self.unmoved: set[Eye] = set()
        self._former_m = {eye: np.zeros(3) for eye in EYES} | as_shifts(former_m)
        self._drawing.shift_m |= self._former_m | dict(record.applied_shift_m)
        self._resume(record)
        self._drawing.send(self._drawing.shift_m)

    @property
    def settings(self) -> CalibrationSettings:
        """The settings of this calibration."""
        return self._settings

    @property
    def alignments(self) -> Mapping[int, Alignment]:
        """The alignments that are not deleted, by their number in the session."""
        return self._session.contents.alignments

    @property
    def verifications(self) -> Mapping[Eye, Verification]:
        """The newest verification of each eye; fused with the alignments."""
        return self._session.contents.facts.verified

    @property
    def eye_distance(self) -> EyeDistance | None:
        """The wearer's eye distance, if it was measured."""
        return self._session.contents.facts.eye_distance

    @property
    def cursor(self) -> PlacedHand | None:
        """The frozen hand while the headset shows it, else None."""
        return None if self._aligning is None else self._aligning.cursor

    @property
    def refusal(self) -> str:
        """Reason why the wearer's last confirmation was refused; else empty."""
        present = self.verifying or self._aligning
        return self._withdrawn_for if present is None else present.refusal

    @property
    def refused_for(self) -> str:
        """Its cause in the past tense, if the live hand shows whether it lasts; else empty."""
        return "" if self._aligning is None else self._aligning.refused_for

    @property
    def applied_shift_m(self) -> Mapping[Eye, Float64]:
        """φ that the headset renders each eye with, solved or set by hand."""
        return MappingProxyType(dict(self._drawing.shift_m))

    @property
    def former_shift_m(self) -> Mapping[Eye, Float64]:
        """φ to which `go_back` returns: those before the newest ones."""
        return MappingProxyType(dict(self._former_m))

    @property
    def is_applied(self) -> bool:
        """True if the headset has acknowledged the newest projection of each eye."""
        return self._drawing.is_acked

    @property
    def projection_acked(self) -> dict[Eye, bool]:
        """True for each eye whose newest projection the headset has acknowledged."""
        return self._drawing.acked

    @property
    def steady_hand(self) -> PlacedHand | None:
        """The newest hand if it is in view and has hardly moved for a while, else None."""
        return self._sight.hands.steady()

    @property
    def newest_hand(self) -> PlacedHand | None:
        """The newest hand unless it is too old for a confirmation."""
        return self._sight.newest_hand

    def now(self) -> Procedure:
        """Return the present state."""
        return Procedure(
            state=self.state,
            eyes=self.eyes,
            cursor=self.cursor,
            refusal=self.refusal,
            results=self.results,
            applied_shift_m=self.applied_shift_m,
            is_applied=self.is_applied,
            verifying=None if self.verifying is None else self.verifying.view(),
            former_shift_m=self.former_shift_m,
            refused_for=self.refused_for,
        )

    def T_W_H(self, hand: PlacedHand) -> Float64:
        """Return the headset's pose (4, 4) when a hand was seen."""
        return np.asarray(hand.T_W_D @ invert(self.rig.T_H_D))

    def step(self, frame: Frame) -> Observation:
        """Process a frame: find the hand, guide the wearer, and take what the wearer confirms.

        What the session cannot write is kept in memory; `Session.write_waiting` says so.

        Raises
        ------
        LinkError
            If the link is closed.
        """
        self._record_headset()
        observation = self._sight.see(
            frame,
            self.camera,
            self.state,
            is_used=bool(self.alignments),
            is_drawing_lost=self._drawing.is_lost and self._link.connected,
        )
        self._ask_to_look_around()
        contradiction = observation.contradiction
        if self.state is State.ALIGN and contradiction and contradiction.name == "clock-step":
            # The cursor may have been placed by a pose of another time.
            self._withdraw_cursor("The headset's clock was set. Raise your hand again.")
        if self._aligning is not None and self.state is State.ALIGN:
            observation = self._guide(observation, self._aligning)
            with suppress(FileError):
                self._take_confirmation(self._aligning)
        elif self.verifying is not None:
            with suppress(FileError):
                self._follow_nudges(observation, self.verifying)
        return replace(observation, state=self.state)

    # Alignments: a cursor, the wearer's confirmation, and what can be undone.

    def make_cursor(
        self, eyes: Sequence[Eye] = EYES, displacement_W_m: ArrayLike | None = None
    ) -> None:
        """Freeze the newest hand as cursor, to be aligned with the given eyes open.

        With a displacement (3,), the cursor is the raised hand moved by it: the hand that was
        frozen first since it was raised. The wearer keeps it up from one cursor to the next.

        Raises
        ------
        ProcedureError
            If there is no steady hand, an alignment has not been applied yet, or the session is
            full.
        ValueError
            Unless one eye is given, or both once each.
        HandError
            If almost all points lie at cut edges.
        FileError
            If the session cannot be written; the cursor is shown anyway.
        """
        if self.state not in (State.SHOW_HAND, State.APPLIED, State.ALIGN):
            raise ProcedureError(f"a cursor cannot be made now ({self.state}): solve and apply")
        hand = self.raised if displacement_W_m is not None and self.raised else self.steady_hand
        if hand is None:
            raise ProcedureError("hold the hand still in view of the camera, then try again")
        if self._sight.delay.is_needed:
            raise ProcedureError(
                "the delay of the camera's pictures is not known yet",
                "let the wearer look slowly "
                "to the left and to the right, in front of a background with texture",
            )
        if tuple(eyes) not in (("left",), ("right",), ("left", "right"), ("right", "left")):
            raise ValueError(f"one eye must be open, or both, not {tuple(eyes)}")
        if full := self._session.full("alignment"):
            raise ProcedureError(full)
        if not self.is_applied:
            # The cursor might be drawn with other projections than the solver assumes.
            self._link.send_again()
            raise ProcedureError(
                "the headset has not acknowledged its projections yet",
                "wait a moment, or restart its app",
            )
        if hand is not self.raised:
            hand = merge_hold(self._sight.hands.held_at(hand), hand)
        self.raised = None if displacement_W_m is None else hand
        hand = hand if displacement_W_m is None else _moved(hand, displacement_W_m)
        self._aligning = Aligning(hand, self._cursor_id + 1, tuple(eyes), self.rig, self._settings)
        self._withdrawn_for = ""
        self._cursor_id += 1
        self.eyes = tuple(eyes)
        self.state = State.ALIGN
        self._send_cursor(hand)
        self._link.send_prompt(align_prompt(self.eyes), self.eyes)
        self._record_camera()
        self._session.record("cursor_made", cursor_id=self._cursor_id, eyes=list(self.eyes))

    def confirm(self) -> None:
        """Confirm the alignment from the PC at the newest frame; the next step handles it.

        Raises
        ------
        ProcedureError
            If there is no cursor, or no hand in view, or the headset does not draw it yet, or drew
            something else at the last confirmation.
        """
        if self.state is not State.ALIGN or self._aligning is None:
            raise ProcedureError(f"there is no cursor to confirm ({self.state})")
        hand = self.newest_hand
        if hand is None:
            raise ProcedureError("hold the hand under the cursor, in view of the camera")
        cursor = self._sent_cursor
        if not self.is_applied or cursor is None or cursor.state is not Delivery.ACKED:
            raise ProcedureError("the headset has not received the cursor and projections", "wait")
        if self.evidence.is_drawn_otherwise:
            # Only the headset's own confirmation says what it draws.
            raise ProcedureError(
                "the headset drew something else",
                "let the wearer confirm, or restart its app",
            )
        self._aligning.confirmation = Confirmation(hand.t_host_ns, hand.t_host_ns, self._cursor_id)

    def redo(self) -> None:
        """Discard the present cursor, or else delete the last alignment and the results.

        Raises
        ------
        ProcedureError
            If there is nothing to discard.
        FileError
            If the session cannot be written; the alignment is deleted anyway.
        """
        if self.state in (State.ALIGNED, State.SOLVED) and self.alignments:
            self.delete_alignment(max(self.alignments))
        elif self.state is State.ALIGN:
            self._show_hand_again()
        else:
            raise ProcedureError(f"there is nothing to redo ({self.state})")

    def delete_alignment(self, number: int) -> None:
        """Delete an alignment, and the results with it.

        Raises
        ------
        ProcedureError
            While a cursor is being aligned or projections are being applied.
        ValueError
            If there is no alignment of this number.
        FileError
            If the session cannot be written; the alignment is deleted anyway.
        """
        self._require_settled("alignments")
        self._change(lambda: self._session.delete("alignment", number))

    def restore_alignment(self, number: int) -> None:
        """Restore a deleted alignment; the results are discarded.

        Raises as `delete_alignment`.
        """
        self._require_settled("alignments")
        self._change(lambda: self._session.restore("alignment", number))

    def set_eye_distance(self, eye_distance: EyeDistance | None) -> None:
        """Set the wearer's eye distance, None if it is not measured; the results are discarded.

        Raises
        ------
        ProcedureError
            While a cursor is being aligned or projections are being applied.
        FileError
            If the session cannot be written; the eye distance is used anyway.
        """
        if eye_distance == self.eye_distance:
            return
        self._require_settled("the eye distance")
        if self._session.contents.is_solvable:
            self._change(lambda: self._session.save_facts(eye_distance=eye_distance))
        else:
            self._session.save_facts(eye_distance=eye_distance)

    def choose_eyes(self, plan: EyePlan, usable_eyes: tuple[Eye, ...]) -> None:
        """Record which eyes are aligned in which order; the results of other eyes are discarded.

        Raises as `set_eye_distance`.
        """
        self._require_settled("the eyes")
        record = self._session.contents
        facts = {"plan": plan, "usable_eyes": usable_eyes}
        if usable_eyes != record.facts.usable_eyes and record.is_solvable:
            self._change(lambda: self._session.save_facts(**facts))
        else:
            self._session.save_facts(**facts)

    # Solving, and sending what was solved.

    def solve(self) -> Results:
        """Solve all alignments and verifications so far.

        The eye distance that the headset measures is used if none was typed.

        Raises
        ------
        ProcedureError
            If there is nothing to solve, or the headset has not yet acknowledged the projections.
        FileError
            If the session cannot be written; the results are kept in memory.
        """
        if self.state is State.APPLYING:
            raise ProcedureError("wait until the projections are applied")
        if not self._session.contents.is_solvable or self.state in _UNSETTLED:
            raise ProcedureError("align the hand with the cursor first")
        self._take_headsets_eye_distance()
        self._record_evidence()
        self.results = solve_contents(self._session.contents, self._settings.solve)
        self.state = State.SOLVED
        self._session.save_results(results_json(self.results))
        return self.results

    def apply(self, keeps_hand: bool = False) -> None:
        """Send the solved projections to the headset and hide the cursor.

        An eye whose result is not to be used gets its offline projection. `keeps_hand`: the wearer
        keeps the hand up, so that it can become a cursor or be verified at once.

        Raises
        ------
        ProcedureError
            If nothing is solved.
        """
        if self.results is None or self.state is not State.SOLVED:
            raise ProcedureError("solve first")
        self._clear_cursor(keeps_hand)
        self._drawing.send(self.results.rendered_shift_m)
        self._apply_until_s = time.monotonic() + self._settings.apply_timeout_s
        self.state = State.APPLYING

    def poll_applied(self) -> bool:
        """Return, without waiting, whether the headset has acknowledged every projection.

        Raises
        ------
        ProcedureError
            If nothing was sent.
        LinkError
            If one could not be delivered or the timeout is over; call `apply` again.
        FileError
            If the session cannot be written; the projections are applied anyway.
        """
        is_pending = self._drawing.is_pending and time.monotonic() < self._apply_until_s
        if self.state is State.APPLYING and is_pending:
            return False
        self.wait_applied(0.0)
        return True

    def wait_applied(self, timeout_s: float = 5.0) -> None:
        """Wait until the headset has acknowledged every projection.

        Raises
        ------
        ProcedureError
            If nothing was sent.
        LinkError
            If it does not in time; call `apply` again.
        FileError
            If the session cannot be written; the projections are applied anyway.
        """
        if self.state is not State.APPLYING:
            raise ProcedureError("apply first")
        try:
            self._drawing.wait_acked(timeout_s)
        except HandcalError:
            self.state = State.SOLVED
            raise
        assert self.results is not None
        applied_m = self.results.rendered_shift_m
        self._former_m = dict(self._drawing.shift_m)
        self._drawing.shift_m |= applied_m
        self.state = State.APPLIED
        self._session.save_applied(applied_m)

    def release_hand(self) -> None:
        """Tell the wearer that the hand may be lowered; the next cursor needs another raise."""
        self.raised = None
        self._link.send_prompt("", EYES)

    # Verification: one eye's drawing, moved by the wearer until it covers the hand.

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
        hand = self.newest_hand
        if hand is None:
            raise ProcedureError("hold the hand up in view of the camera, then verify")
        if not self.is_applied:
            self._link.send_again()
            raise ProcedureError("the headset has not acknowledged its projections yet", "wait")
        if self.verifying is not None:
            self._end_verifying(self.verifying.before_m)
        self.unmoved.discard(eye)
        self._begin_verifying(
            Verifying(
                VerifyRequest(new_id(), eye),
                self.rig.eyes[eye],
                self._drawing.shift_m[eye],
                hand_centre_E_m(self.rig, eye, hand),
                hand.t_host_ns,
            )
        )

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

        A drawing that nobody has moved is set aside first, and must be brought back.

        Raises
        ------
        ProcedureError
            Unless an eye is being verified, the headset draws it as nudged, and the hand is still.
        FileError
            If the session cannot be written; the verification counts anyway.
        """
        verifying = self._require_verifying()
        hand = self.steady_hand
        if hand is None:
            raise ProcedureError("the hand must be still and in view of the camera")
        if not self.is_applied:
            raise ProcedureError("the headset has not received the projection yet", "wait")
        if verifying.needs_proof:
            self._set_aside(verifying)
        else:
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
        self.record_skipped(verifying.eye)

    def record_skipped(self, eye: Eye) -> None:
        """Record that an eye is not verified; FileError if it cannot be written."""
        self._session.record(SKIPPED, eye=eye)

    # φ set without a result: by hand, or by going back.

    def go_back(self, to: Literal["offline", "former"]) -> None:
        """Have the headset draw with the offline calibration, or with φ before the newest one.

        A cursor and a verification are dropped, and projections that are not acknowledged yet must
        be applied again; alignments and results stay.

        Raises
        ------
        FileError
            If the session cannot be written; the headset draws with it anyway.
        LinkError
            If the link is closed.
        """
        back_m = {eye: np.zeros(3) for eye in EYES} if to == "offline" else dict(self._former_m)
        if self.verifying is not None:
            self._end_verifying(self.verifying.before_m)
        former_m = dict(self._drawing.shift_m)
        self._clear_cursor()
        self._drawing.shift_m |= back_m
        self._drawing.send(back_m)
        self._former_m = former_m
        if self.state is State.APPLYING:
            self.state = State.SOLVED
        elif self.state is State.ALIGN:
            self.state = self._without_cursor()
        with suppress(FileError):  # the φ, recorded next, raises it again
            self._session.record(WENT_BACK, to=to)
        self.record_shift()

    def set_shift(self, shifts_m: Mapping[Eye, ArrayLike]) -> list[Outgoing]:
        """Have the headset render with φ set by hand; an eye not given keeps its own.

        Returns
        -------
        list of Outgoing
            The projections sent.

        Raises
        ------
        ProcedureError
            While there is a cursor, or an alignment that has not been applied.
        ValueError
            If a φ is not three finite numbers up to 30 mm.
        LinkError
            If the link is closed.
        """
        if self.state not in (State.SHOW_HAND, State.APPLIED):
            raise ProcedureError(f"φ cannot be set by hand now ({self.state}): solve and apply")
        shifts = as_shifts(shifts_m)
        for eye, shift_m in shifts.items():
            if np.abs(shift_m).max() > MAX_HAND_SET_SHIFT_M:
                limit_mm = 1e3 * MAX_HAND_SET_SHIFT_M
                raise ValueError(f"φ of the {eye} eye must stay within ±{limit_mm:g} mm")
        self._drawing.shift_m |= shifts
        return self._drawing.send(shifts)

    def record_shift(self) -> None:
        """Record the φ set by hand in the session; FileError if it cannot be written."""
        self._session.save_fine_tuned(self.applied_shift_m)

    # The parts of the above.

    def _resume(self, record: SessionRecord) -> None:
        """Continue where the session is; a cursor or projections pending then are lost."""
        if record.is_solved:
            try:
                self.results = solve_again(record, self._settings.solve)
            except FileError as error:
                raise ProcedureError(f"{record.path} cannot be resumed: {error}") from error
            self.state = State.APPLIED if record.is_applied else State.SOLVED
        elif record.is_solvable:
            self.state = State.ALIGNED
        if (verifying := resumed(record.events, self.rig.eyes)) is not None:
            self._drawing.shift_m[verifying.eye] = verifying.shift_m
            self._ask_to_verify(verifying)

    def _record_evidence(self) -> None:
        """Record what contradicts the result, with which it is judged."""
        found, facts = self.evidence.contradictions, self._session.contents.facts
        names, texts = tuple(one.name for one in found), tuple(one.text for one in found)
        if (names, texts) != (facts.evidence, facts.contradictions):
            with suppress(FileError):  # the results, recorded next, raise it again
                self._session.save_facts(evidence=names, contradictions=texts)

    def _take_headsets_eye_distance(self) -> None:
        """Use the headset's newest eye distance unless one was typed."""
        device, used = self._link.device, self.eye_distance
        is_typed = used is not None and used.source == "typed"
        if is_typed or device is None or device.eye_distance_m is None:
            return
        with suppress(ValueError):  # no person's
            told = EyeDistance(device.eye_distance_m, source="headset")
            if told != used:
                with suppress(FileError):  # the results, recorded next, raise it again
                    self._session.save_facts(eye_distance=told)

    def _ask_to_look_around(self) -> None:
        """Ask the wearer to move the head while a cursor still needs the camera's delay."""
        is_before_cursor = self.state in (State.SHOW_HAND, State.APPLIED)
        is_needed = self._sight.delay.is_needed and is_before_cursor
        # Not before the hand is up; then until the delay is known, also while the hand moves.
        is_asked = is_needed and (self._looks_around or self.steady_hand is not None)
        if is_asked != self._looks_around:
            self._looks_around = is_asked
            if is_before_cursor:
                self._link.send_prompt(LOOK_AROUND if is_asked else "", EYES)

    def _guide(self, observation: Observation, aligning: Aligning) -> Observation:
        """Show the wearer the live hand with its rotation; return the observation with it."""
        if observation.hand is not None:
            observation = aligning.follow(observation, observation.hand)
            if (prompt := aligning.advise(observation)) is not None:
                self._link.send_prompt(prompt, self.eyes)
        if observation.hand is not None and observation.guard_ms is not None:
            self._link.send_live_hand(observation.hand.points_W_m, observation.is_over_limit)
        return observation

    def _take_confirmation(self, aligning: Aligning) -> None:
        """Judge the wearer's confirmation once the hand of its time is placed."""
        for confirmation in self._link.confirmations():
            if confirmation.cursor_id == self._cursor_id:
                aligning.confirmation = confirmation
        waiting = aligning.confirmation
        if waiting is not None and self._sight.hands.placed_until_ns() >= waiting.t_host_ns:
            self._judge(waiting, aligning)

    def _judge(self, confirmation: Confirmation, aligning: Aligning) -> None:
        """Accept or refuse a confirmation."""
        sight, drawn_m = self._sight, self._drawing.shift_m
        judged = aligning.judge(confirmation, sight.hands, self._link, sight.delay, drawn_m)
        if judged is None:
            return
        aligning.confirmation = None
        if confirmation.problem:
            self.evidence.drawn_otherwise(confirmation.problem)
            self._link.send_again()
        if isinstance(judged, Refused):
            self._refuse(judged, aligning)
        else:
            self._accept(judged, aligning)

    def _accept(self, accepted: Accepted, aligning: Aligning) -> None:
        self.evidence.drawn_as_sent()
        self.state = State.ALIGNED
        aligning.refusal = aligning.refused_for = ""
        try:
            self._session.save_alignment(accepted.alignment, accepted.facts)
        except ValueError as error:
            self.state = State.ALIGN
            prompt = f"The alignment cannot be saved: {error}."
            self._refuse(Refused(prompt, "not saved"), aligning)

    def _refuse(self, refused: Refused, aligning: Aligning) -> None:
        aligning.refusal, aligning.refused_for = refused.prompt, refused.was
        if refused.reason == OUT_OF_VIEW:
            self._withdraw_cursor(refused.prompt)
        else:
            self._link.send_prompt(refused.prompt, self.eyes)
        self._session.record(
            "refused",
            reason=refused.reason,
            angle_deg=refused.angle_deg,
            cursor_id=self._cursor_id,
        )

    def _send_cursor(self, hand: PlacedHand) -> None:
        """Have the headset show the outline of a hand, with its marks."""
        outline_m = hand.cloud.outline_m.astype(np.float64)
        marks_m = outline_marks(outline_m, hand.cloud.outline_is_cut)
        drawn_W_m = transform(hand.T_W_D, np.vstack([outline_m, marks_m]))
        self._sent_cursor = self._link.send_cursor(drawn_W_m, self._cursor_id, self.eyes)

    def _clear_cursor(self, keeps_hand: bool = False) -> None:
        self._aligning = None
        if not keeps_hand:
            # The wearer lowers the hand now: only a hand seen from here on can become a cursor.
            self._sight.hands.clear()
            self.raised = None
        self._link.send_cursor(np.empty((0, 3)), self._cursor_id)
        self._link.send_prompt(KEEP_PROMPT if keeps_hand else "", EYES)

    def _record_camera(self) -> None:
        """Record the camera of the newest frame unless the session knows it."""
        frame = self._sight.frame
        assert frame is not None
        used = CameraUsed(self.camera, frame.depth_intrinsics, frame.depth_scale_m)
        if used != self._session.contents.facts.camera:
            with suppress(FileError):  # the cursor, recorded next, raises it again
                self._session.save_facts(camera=used)

    def _record_headset(self) -> None:
        """Record a headset that has introduced itself, if it is new.

        It is new with another device, name, runtime, app or protocol, or once it tells its views or
        an eye distance. What eye tracking changes many times a minute, where the views are and how
        far apart the eyes, is not recorded again. A finished session stays as it is: the wearer
        takes the headset off now.
        """
        device, record = self._link.device, self._session.contents
        if device is None or device is self._headset or record.is_finished:
            return
        self._headset = device
        if record.facts.headset is None or _is_new(device, record.facts.headset):
            with suppress(FileError):
                self._session.save_facts(headset=device)

    def _require_settled(self, what: str) -> None:
        if self.state in _UNSETTLED:
            raise ProcedureError(f"{what} cannot be changed now ({self.state})")

    def _change(self, write: Callable[[], object]) -> None:
        """Change what the results are made from; they are discarded even if the disk is full."""
        try:
            write()
        except FileError:
            self._forget_results()
            raise
        self._forget_results()

    def _forget_results(self) -> None:
        self.results = None
        if self.state is not State.APPLIED:
            self._show_hand_again()

    def _withdraw_cursor(self, prompt: str) -> None:
        """Discard a cursor that cannot be aligned, and say why another is needed."""
        self._show_hand_again()
        self._withdrawn_for = prompt
        self._link.send_prompt(prompt, self.eyes)

    def _show_hand_again(self) -> None:
        self._clear_cursor()
        self._drawing.send(self._drawing.shift_m)  # `apply` may have failed for one eye only
        self.state = self._without_cursor()

    def _without_cursor(self) -> State:
        """Return the state of a calibration whose cursor was discarded."""
        is_applied = self.results is not None and self._session.contents.is_applied
        return State.APPLIED if is_applied else State.SHOW_HAND

    def _begin_verifying(self, verifying: Verifying) -> None:
        self._ask_to_verify(verifying)
        self._session.record(VERIFYING, **verifying.event())

    def _ask_to_verify(self, verifying: Verifying) -> None:
        """Show the wearer one eye's outline, to be moved."""
        self._before_verifying, self.state = self.state, State.VERIFY
        self.verifying = verifying
        self.eyes = (verifying.eye,)
        is_aside = verifying.view().is_set_aside
        self._link.send_prompt(
            SET_ASIDE_PROMPT if is_aside else verify_prompt(verifying.eye), self.eyes
        )
        self._link.send_verify(verifying.request)

    def _require_verifying(self, eye: Eye | None = None) -> Verifying:
        if self.verifying is None or eye not in (None, self.verifying.eye):
            raise ProcedureError(f"the {eye or ''} eye is not being verified ({self.state})")
        return self.verifying

    def _nudge(self, move: Callable[[], None]) -> None:
        """Move the drawing of the verified eye, and send and store it."""
        verifying = self._require_verifying()
        try:
            move()
        except ValueError as error:
            raise ProcedureError(str(error)) from error
        self._drawing.shift_m[verifying.eye] = verifying.shift_m
        self._drawing.send({verifying.eye: verifying.shift_m})
        self._session.record(VERIFYING, **verifying.event())

    def _follow_nudges(self, observation: Observation, verifying: Verifying) -> None:
        """Draw the hand's outline for the verified eye, and take the wearer's nudges."""
        if observation.hand is not None:
            outline_W_m = transform(observation.hand.T_W_D, observation.hand.cloud.outline_m)
            self._link.send_live_hand(outline_W_m, False, (verifying.eye,), is_outline=True)
        verify_id = verifying.request.verify_id
        if heard := [one for one in self._link.nudges() if one.verify_id == verify_id]:
            self._hear(heard[-1], verifying)  # it has the sums of all
        fits, hands = verifying.fits, self._sight.hands
        if fits is None or hands.placed_until_ns() < fits.t_host_ns:
            return
        verifying.fits = None
        if fits.problem:
            if self.is_applied:
                self.evidence.drawn_otherwise(fits.problem)
            self._link.send_again()
        judged = verifying.judge(fits, hands, self._settings.match_tolerance_s)
        if isinstance(judged, str):
            self._refuse_verification(verifying, judged)
        elif verifying.needs_proof:
            self._set_aside(verifying)
        else:
            self.evidence.drawn_as_sent()
            self._accept_verification(verifying, judged)

    def _set_aside(self, verifying: Verifying) -> None:
        """Move a drawing that nobody has moved, and ask the wearer to bring it back."""
        offset = draw_offset(self._rng)
        try:
            self._nudge(lambda: verifying.set_aside(offset))
        finally:  # also if the session cannot be written
            self._link.send_prompt(SET_ASIDE_PROMPT, self.eyes)

    def _hear(self, nudge: Nudge, verifying: Verifying) -> None:
        step = verifying.hear(nudge)
        if step is not None:
            try:
                self._nudge(lambda: verifying.nudge(*step))
            except ProcedureError as error:
                self._refuse_verification(verifying, f"{error}.")
                return
            if nudge.fits:  # the wearer has not seen what this press moves
                self._refuse_verification(verifying, CHANGED)

    def _refuse_verification(self, verifying: Verifying, prompt: str) -> None:
        verifying.refusal = prompt
        self._link.send_prompt(prompt, self.eyes)
        self._session.record("verification_refused", eye=verifying.eye, reason=prompt)

    def _accept_verification(self, verifying: Verifying, hand: PlacedHand) -> None:
        """Store and fuse a verification, and send what it leads to."""
        hand = merge_hold(self._sight.hands.held_at(hand), hand)
        hand_E_m = hand_centre_E_m(self.rig, verifying.eye, hand)
        if not verifying.is_moved:
            self._end_unmoved(verifying)
            return
        found = verifying.result(hand_E_m, hand.cloud.outline_sigma_px)
        found = found.after(self.verifications.get(verifying.eye))
        self._end_verifying(verifying.shift_m)
        with suppress(FileError):  # the results, recorded next, raise it again
            self._session.save_facts(verified={verifying.eye: found})
        try:
            self.solve()
        finally:
            if self.state is State.SOLVED:  # also if the results could not be written
                usable_eyes = self._session.contents.facts.usable_eyes
                # The other eye follows at once.
                self.apply(keeps_hand=any(eye not in self.verifications for eye in usable_eyes))

    def _end_unmoved(self, verifying: Verifying) -> None:
        """End a verification in which nobody moved even the drawing that was set aside."""
        self.unmoved.add(verifying.eye)
        self._end_verifying(verifying.before_m)
        self._link.send_prompt(UNMOVED_PROMPT, EYES)
        self.record_skipped(verifying.eye)

    def _end_verifying(self, shift_m: Float64) -> None:
        """Draw the verified eye with φ, and return to the state before."""
        verifying = self._require_verifying()
        self.verifying = None
        self.state = self._before_verifying
        self._drawing.shift_m[verifying.eye] = shift_m
        self._drawing.send({verifying.eye: shift_m})
        self._link.send_verify(None)
        self._link.send_prompt("", EYES)


def _moved(hand: PlacedHand, displacement_W_m: ArrayLike) -> PlacedHand:
    """Return a hand at another place of the world."""
    moved_m = np.asarray(displacement_W_m, dtype=np.float64)
    return replace(
        hand,
        T_W_D=rigid(translation_m=moved_m) @ hand.T_W_D,
        points_W_m=hand.points_W_m + moved_m,
        middle_W_m=hand.middle_W_m + moved_m,
    )


def _is_new(device: HeadsetIdentity, known: HeadsetIdentity) -> bool:
    """Return whether a headset is another one, or tells something that it has not told before."""
    named, known_name = (
        facts_json(replace(one, views={}, eye_distance_m=None)) for one in (device, known)
    )
    tells_distance = device.eye_distance_m is not None and known.eye_distance_m is None
    return named != known_name or not device.views.keys() <= known.views.keys() or tells_distance


def _earlier_evidence(record: SessionRecord) -> list[Contradiction]:
    pairs = zip(record.facts.evidence, record.facts.contradictions, strict=False)
    return [Contradiction(name, text) for name, text in pairs]
