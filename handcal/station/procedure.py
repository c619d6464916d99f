"""The calibration procedure as a state machine: show hand, align, solve, apply, repeat.

::

    SHOW_HAND --make_cursor--> ALIGN --confirmation, guard passed--> ALIGNED
        ^                        |  ^________________ refused            |
        |_________redo___________|                                     solve
        |_________redo______________________________________________    |
        |                                                           |   v
        '--make_cursor-- APPLIED <--acknowledged-- APPLYING <--apply-- SOLVED

Between these steps alignments can be deleted and restored, the wearer's eye distance can be set,
and all can be solved again; φ can be set by hand while no cursor is shown. The procedure only
combines the other packages. One thread drives it: `step` for every frame, all other calls in
between.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import suppress
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from handcal.display import as_shifts
from handcal.errors import HandcalError
from handcal.link.reliable import Outgoing
from handcal.link.server import HeadsetServer
from handcal.register.results import Results, results_json, solve_session
from handcal.rig_types import Rig
from handcal.session.session import Session, SessionRecord
from handcal.session.state import WENT_BACK
from handcal.station.states import MAX_HAND_SET_SHIFT_M, CalibrationSettings, ProcedureError, State
from handcal.station.verifications import VerificationSteps
from handcal.types import EYES, Eye, EyeDistance, Float64, PlanName

_UNSETTLED = (State.ALIGN, State.VERIFY, State.APPLYING)


class Calibration(VerificationSteps):
    """One wearer's calibration.

    It first sends the offline projections, or those of the session it resumes, so that the headset
    does not continue to render with those of another calibration.

    Parameters
    ----------
    rig : Rig
    link : HeadsetServer
    session : Session or None
        Records everything at once. Data that could not be written are kept and written before the
        next data, or by `store_waiting`.
    settings : CalibrationSettings
    resume : SessionRecord or None
        The contents of `session`, to resume it.
    wearer : str
        Name or code, by which the headset keeps the projections.
    plan : {"paper", "recommended"}, optional
        The advice counts its next alignments.
    usable_eyes : tuple of eye
        Only one for a wearer who sees with one eye.
    former_m : mapping of eye to (3,) array_like
        φ of a stored session to start from, in place of the offline calibration.

    Raises
    ------
    ProcedureError
        If the session to resume was solved, but can no longer be solved.

    Attributes
    ----------
    state : State
    eyes : tuple of eye
        Eyes open in the present alignment.
    results : Results or None
        Of all alignments; None before `solve`, after an alignment was deleted or restored, and
        after the eye distance was changed.
    eye_distance : EyeDistance or None
        The wearer's, if it was measured.
    verifications : dict of eye to Verification
        The newest of each eye; fused with the alignments.
    verifying : Verifying or None
        The verification in progress, in the state `verify`.
    camera : CameraIdentity
        The camera that gives the frames; set it before `step`.
    evidence : Evidence
        Evidence from outside the solver against the result.
    """

    def __init__(
        self,
        rig: Rig,
        link: HeadsetServer,
        session: Session | None = None,
        settings: CalibrationSettings | None = None,
        resume: SessionRecord | None = None,
        wearer: str = "",
        plan: PlanName | None = None,
        usable_eyes: tuple[Eye, ...] = EYES,
        former_m: Mapping[Eye, ArrayLike] = MappingProxyType({}),
    ) -> None:
        super().__init__(rig, link, session, settings or CalibrationSettings(), resume, wearer)
        self.results: Results | None = None
        self._plan = plan
        self._usable_eyes = usable_eyes
        self._former_m = {eye: np.zeros(3) for eye in EYES} | as_shifts(former_m)
        self._drawing.shift_m |= self._former_m
        self.eye_distance = None if resume is None else resume.facts.eye_distance
        self._apply_until_s = 0.0
        if resume is not None:
            self._resume(resume)
        self._drawing.send(self._drawing.shift_m)

    @property
    def former_shift_m(self) -> Mapping[Eye, Float64]:
        """φ to which `go_back` returns: those before the newest ones."""
        return MappingProxyType(dict(self._former_m))

    def redo(self) -> None:
        """Discard the present cursor, or else delete the last alignment and the results.

        Raises
        ------
        ProcedureError
            If there is nothing to discard.
        FileError
            If the session cannot be written; the alignment is deleted anyway.
        """
        if self.state in (State.ALIGNED, State.SOLVED) and self._items.active:
            self.delete_alignment(max(self._items.active))
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
        self._items.delete(number)
        self._forget_results()
        self._store.write(lambda session: session.delete("alignment", number))

    def restore_alignment(self, number: int) -> None:
        """Restore a deleted alignment; the results are discarded.

        Raises as `delete_alignment`.
        """
        self._require_settled("alignments")
        self._items.restore(number)
        self._forget_results()
        self._store.write(lambda session: session.restore("alignment", number))

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
        self.eye_distance = eye_distance
        if self.alignments:
            self._forget_results()
        self._store.write(lambda session: session.save_facts(eye_distance=eye_distance))

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
        if not (self.alignments or self.verifications) or self.state in _UNSETTLED:
            raise ProcedureError("align the hand with the cursor first")
        self._take_headsets_eye_distance()
        results = self._solve()
        self.state = State.SOLVED
        found = self.evidence.contradictions
        names, texts = tuple(one.name for one in found), tuple(one.text for one in found)

        def write(session: Session) -> None:
            if found:
                session.save_facts(evidence=names, contradictions=texts)
            session.save_results(results_json(results))

        self._store.write(write)
        return results

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
        self._store.write(lambda session: session.save_applied(applied_m))

    def release_hand(self) -> None:
        """Tell the wearer that the hand may be lowered; the next cursor needs another raise."""
        self.raised = None
        self._link.send_prompt("", EYES)

    def go_back(self, to: Literal["offline", "former"]) -> None:
        """Have the headset draw with the offline calibration, or with φ before the newest one.

        A cursor, a verification and projections not yet acknowledged are dropped; the alignments
        stay.

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
        self.state = State.APPLIED if self.state is State.APPLIED else State.SHOW_HAND
        self._store.event(WENT_BACK, to=to)
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
        settled_m = self.applied_shift_m
        self._store.write(lambda session: session.save_fine_tuned(settled_m))

    def _resume(self, record: SessionRecord) -> None:
        """Restore the state of a session; a cursor or projections pending then are lost."""
        self._items.active = dict(record.alignments)
        self._items.deleted = dict(record.deleted_alignments)
        self._items.taken = record.last_alignment
        self._drawing.shift_m |= record.applied_shift_m
        self.verifications = dict(record.facts.verified)
        if record.is_solved:
            try:
                self._solve()
            except ValueError as error:
                raise ProcedureError(f"{record.path} cannot be resumed: {error}") from error
            self.state = State.APPLIED if record.is_applied else State.SOLVED
        elif record.alignments or record.facts.verified:
            self.state = State.ALIGNED
        self._resume_verifying(record)

    def _solve(self) -> Results:
        self.results = solve_session(
            self.alignments,
            self.rig,
            self._settings.solve,
            eye_distance=self.eye_distance,
            contradictions=[one.text for one in self.evidence.contradictions],
            verified=self.verifications,
            plan=self._plan,
            usable_eyes=self._usable_eyes,
        )
        return self.results

    def _use_verification(self) -> None:
        self.solve()
        # The other eye follows at once.
        self.apply(keeps_hand=any(eye not in self.verifications for eye in self._usable_eyes))

    def _take_headsets_eye_distance(self) -> None:
        """Use the headset's newest eye distance unless one was typed."""
        device = self._link.device
        is_typed = self.eye_distance is not None and self.eye_distance.source == "typed"
        if is_typed or device is None or device.eye_distance_m is None:
            return
        with suppress(ValueError):  # no person's
            told = EyeDistance(device.eye_distance_m, source="headset")
            if told != self.eye_distance:
                self.eye_distance = told
                # Written with the results, which it must not prevent.
                self._store.write_later(lambda session: session.save_facts(eye_distance=told))

    def _require_settled(self, what: str) -> None:
        if self.state in _UNSETTLED:
            raise ProcedureError(f"{what} cannot be changed now ({self.state})")

    def _forget_results(self) -> None:
        self.results = None
        if self.state is not State.APPLIED:
            self._show_hand_again()

    def _show_hand_again(self) -> None:
        self._clear_cursor()
        self._drawing.send(self._drawing.shift_m)  # `apply` may have failed for one eye only
        self.state = State.SHOW_HAND
