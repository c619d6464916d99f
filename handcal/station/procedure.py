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
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from handcal.camera.clock import FrameClock
from handcal.display import as_shifts, projection_matrix, view_of_eye
from handcal.errors import HandcalError, HandError, PoseError, PosePendingError
from handcal.geometry import transform
from handcal.hand.settings import SegmentSettings
from handcal.hand.shipped import make_finder
from handcal.link.drawn import drawn_digest
from handcal.link.reliable import Delivery, Outgoing
from handcal.link.server import Confirmation, HeadsetServer
from handcal.register.guard import GuardSettings, RotationGuard, turn_advice
from handcal.register.results import Results, SolveSettings, results_json, solve_session
from handcal.register.shape import ShapeChange, change_text
from handcal.session.facts import AlignmentFacts, CameraUsed
from handcal.session.session import Session, SessionRecord
from handcal.session.state import MAX_ALIGNMENTS, NumberedItems
from handcal.station.delay import DelayMeter, DelaySettings
from handcal.station.evidence import Contradiction, Evidence
from handcal.station.hands import PlacedHand, RecentHands
from handcal.station.hold import merge_hold
from handcal.types import (
    EYES,
    LOOK_AROUND,
    Alignment,
    CameraIdentity,
    Eye,
    EyeDistance,
    Float64,
    Frame,
    HandCloud,
    Projection,
    Rig,
)

MAX_HAND_SET_SHIFT_M = 0.030
"""Limit of each component of a φ set by hand, beyond the eye box."""
_SHAPE_EVERY_NS = 250_000_000
"""A measurement of the shape takes half of a frame's time, and nobody reads faster."""


class State(StrEnum):
    """State of the procedure."""

    SHOW_HAND = "show_hand"
    ALIGN = "align"
    ALIGNED = "aligned"
    SOLVED = "solved"
    APPLYING = "applying"
    APPLIED = "applied"


class ProcedureError(HandcalError):
    """A call in the wrong state; the text says what must be done first."""


@dataclass(frozen=True, slots=True)
class CalibrationSettings:
    """Settings of a calibration."""

    segment: SegmentSettings = field(default_factory=SegmentSettings)
    guard: GuardSettings = field(default_factory=GuardSettings)
    solve: SolveSettings = field(default_factory=SolveSettings)
    camera_latency_s: float = 0.03
    """Shortest time from a frame's exposure to its arrival, until it is measured."""
    delay: DelaySettings = field(default_factory=DelaySettings)
    match_tolerance_s: float = 0.15
    """Largest time between t_b and the frame of an alignment."""
    steady_s: float = 0.4
    steady_m: float = 0.005
    """The hand is steady if it moved less than `steady_m` for `steady_s`."""
    apply_timeout_s: float = 5.0
    """Time for the headset to acknowledge projections (`Calibration.poll_applied`)."""


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """The result of one procedure step: state, hand, rotation, timings."""

    state: State
    """After the step."""
    hand: PlacedHand | None
    """The newest hand placed in this step, maybe of an earlier frame; None if none was."""
    problem: str
    """Reason why there is no hand; empty if there is one."""
    is_steady: bool
    """True if a cursor can be made now."""
    cloud: HandCloud | None = None
    """The hand in this step's own frame, placed or not."""
    rotation_rad: Float64 | None = None
    """(3,); rotation from the cursor to the live hand, about D's axes, while aligning."""
    shape_change_m: float | None = None
    """Change of the hand's shape since the cursor, rms, while aligning; measured a few times a
    second."""
    shape_text: str = ""
    """The part that changed most, in words."""
    has_changed: bool = False
    """True if that change exceeds the guard's limit."""
    is_over_limit: bool = False
    """True if the rotation or the change of shape exceeds the guard's limit."""
    segment_ms: float | None = None
    guard_ms: float | None = None
    """Durations of these stages."""
    contradiction: Contradiction | None = None
    """Evidence that forbids to use this frame."""
    needs_delay: bool = False
    """True if no cursor can be made before the wearer has looked around (`DelayMeter`)."""


class Calibration:
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
    refused : int
        Number of confirmations refused by the guard.
    camera : CameraIdentity
        The camera that gives the frames; set it before `step`.
    evidence : Evidence
        Evidence from outside the solver against the result.
    refusal : str
        Reason why the last confirmation of the present cursor was refused; empty if none was.
    """

    def __init__(
        self,
        rig: Rig,
        link: HeadsetServer,
        session: Session | None = None,
        settings: CalibrationSettings | None = None,
        resume: SessionRecord | None = None,
        wearer: str = "",
    ) -> None:
        self.rig = rig
        self.state = State.SHOW_HAND
        self.eyes: tuple[Eye, ...] = EYES
        self.results: Results | None = None
        self.eye_distance = None if resume is None else resume.facts.eye_distance
        self.refused = 0
        self.refusal = ""
        self.camera = CameraIdentity()
        self.evidence = Evidence(rig, _earlier_evidence(resume))
        self._link = link
        self._session = session
        self._settings = settings or CalibrationSettings()
        self._clock = FrameClock(self._settings.camera_latency_s)
        self._delay = DelayMeter(self._clock, link.pose_at_host_ns, rig.T_H_D, self._settings.delay)
        self._looks_around = False
        self._finder = make_finder(self._settings.segment)
        self._hands = RecentHands(
            link.pose_at_host_ns, rig.T_H_D, self._settings.steady_s, self._settings.steady_m
        )
        self._cursor: PlacedHand | None = None
        self._cursor_id = 0
        self._guard: RotationGuard | None = None
        self._shape: ShapeChange | None = None
        self._shape_ns = 0
        self._confirmation: Confirmation | None = None
        self._items = NumberedItems[Alignment]("alignment", MAX_ALIGNMENTS)
        self._unstored: deque[Callable[[Session], object]] = deque()
        self._shift_m: dict[Eye, Float64] = {eye: np.zeros(3) for eye in EYES}
        self._sent: dict[Eye, Outgoing] = {}
        self._sent_cursor: Outgoing | None = None
        self._wearer = wearer
        self._rig_name = _rig_name(rig)
        self._frame: Frame | None = None
        self._camera_stored = resume.facts.camera if resume is not None else None
        self._apply_until_s = 0.0
        if resume is not None:
            self._resume(resume)
        self._send_projections(self._shift_m)

    @property
    def alignments(self) -> Mapping[int, Alignment]:
        """The alignments that are not deleted, by their number in the session."""
        return MappingProxyType(dict(self._items.active))

    @property
    def cursor(self) -> PlacedHand | None:
        """The frozen hand while the headset shows it, else None."""
        return self._cursor

    @property
    def applied_shift_m(self) -> Mapping[Eye, Float64]:
        """φ that the headset renders each eye with, solved or set by hand."""
        return MappingProxyType(dict(self._shift_m))

    @property
    def is_applied(self) -> bool:
        """True if the headset has acknowledged the newest projection of each eye."""
        return all(message.state is Delivery.ACKED for message in self._sent.values())

    @property
    def projection_acked(self) -> dict[Eye, bool]:
        """True for each eye whose newest projection the headset has acknowledged."""
        return {eye: message.state is Delivery.ACKED for eye, message in self._sent.items()}

    def step(self, frame: Frame) -> Observation:
        """Process a frame: find the hand, guide the alignment, handle a confirmation.

        Raises
        ------
        LinkError
            If the link is closed.
        FileError
            If the session cannot be written; the alignment is kept in memory.
        """
        started_s = time.perf_counter()
        t_host_ns = self._clock.exposure_ns(frame)
        self._frame = frame
        problem = ""
        cloud: HandCloud | None = None
        if self._delay.see(frame):
            self._hands.clear()  # they were placed by an assumed delay
        contradiction = (
            self.evidence.see(frame, self.camera)
            or self.evidence.see_delay(self._delay.delay_s, self._delay.largest_delay_s)
            or self.evidence.see_delivery(self._is_lost())
        )
        try:
            if contradiction is None:
                cloud = self._finder.find(frame)
            else:
                self._hands.clear()
                problem = contradiction.text
        except HandError as error:
            problem = str(error)
        segment_ms = 1e3 * (time.perf_counter() - started_s)
        hand, not_placed = self._hands.add(cloud, t_host_ns)
        problem = "" if hand else problem or not_placed
        is_steady = self._hands.steady() is not None and not self._delay.is_needed
        self._ask_to_look_around()
        observation = Observation(
            self.state,
            hand,
            problem,
            is_steady,
            cloud,
            segment_ms=segment_ms,
            contradiction=contradiction,
            needs_delay=self._delay.is_needed,
        )
        if self.state is State.ALIGN:
            observation = self._guide(observation)
        return replace(observation, state=self.state)

    def make_cursor(self, eyes: Sequence[Eye] = EYES) -> None:
        """Freeze the newest hand as cursor, to be aligned with the given eyes open.

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
        hand = self._hands.steady()
        if hand is None:
            raise ProcedureError("hold the hand still in view of the camera, then make the cursor")
        if self._delay.is_needed:
            raise ProcedureError(
                "the delay of the camera's pictures is not known yet; let the wearer look slowly "
                "to the left and to the right, before a background with texture"
            )
        if tuple(eyes) not in (("left",), ("right",), ("left", "right"), ("right", "left")):
            raise ValueError(f"one eye must be open, or both, not {tuple(eyes)}")
        try:
            self._items.next_number()
        except ValueError as error:
            raise ProcedureError(f"{error} in a session; start another") from error
        if not self.is_applied:
            # The cursor might be drawn with other projections than the solver assumes.
            self._link.send_again()
            raise ProcedureError(
                "the headset has not acknowledged its projections yet; wait a moment, "
                "or restart its app"
            )
        hand = merge_hold(self._hands.held_at(hand), hand)
        self._guard = RotationGuard(hand.points_W_m, hand.cloud.is_cut)
        self._shape = None
        self._cursor = hand
        self._cursor_id += 1
        self._confirmation = None
        self.refusal = ""
        self.eyes = tuple(eyes)
        self.state = State.ALIGN
        outline_W_m = transform(hand.T_W_D, hand.cloud.contour_m)
        self._sent_cursor = self._link.send_cursor(outline_W_m, self._cursor_id)
        self._link.send_prompt(_align_prompt(self.eyes), self.eyes)
        self._store_camera()
        made = {"cursor_id": self._cursor_id, "eyes": list(self.eyes)}
        self._store(lambda session: session.record("cursor_made", **made))

    def confirm(self) -> None:
        """Confirm the alignment from the PC at the newest frame; the next step handles it.

        Raises
        ------
        ProcedureError
            If there is no cursor, or no hand in view, or the headset does not draw it yet, or drew
            something else at the last confirmation.
        """
        if self.state is not State.ALIGN:
            raise ProcedureError(f"there is no cursor to confirm ({self.state})")
        hand = self._hands.newest(self._settings.match_tolerance_s)
        if hand is None:
            raise ProcedureError("hold the hand under the cursor, in view of the camera")
        cursor = self._sent_cursor
        if not self.is_applied or cursor is None or cursor.state is not Delivery.ACKED:
            raise ProcedureError("the headset has not received the cursor and projections; wait")
        if self.evidence.is_drawn_otherwise:
            # Only the headset's own confirmation says what it draws.
            raise ProcedureError(
                "the headset drew something else; let the wearer confirm, or restart its app"
            )
        self._confirmation = Confirmation(hand.t_host_ns, hand.t_host_ns, self._cursor_id)

    def redo(self) -> None:
        """Discard the present cursor, or else delete the last alignment and the results.

        Raises
        ------
        ProcedureError
            If there is nothing to discard.
        FileError
            If the session cannot be written; the alignment is deleted anyway.
        """
        if self.state in (State.ALIGNED, State.SOLVED):
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
        self._store(lambda session: session.delete("alignment", number))

    def restore_alignment(self, number: int) -> None:
        """Restore a deleted alignment; the results are discarded.

        Raises as `delete_alignment`.
        """
        self._require_settled("alignments")
        self._items.restore(number)
        self._forget_results()
        self._store(lambda session: session.restore("alignment", number))

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
        self._store(lambda session: session.save_facts(eye_distance=eye_distance))

    def solve(self) -> Results:
        """Solve all alignments so far.

        The eye distance that the headset measures is used if none was typed.

        Raises
        ------
        ProcedureError
            If there is no alignment, or the headset has not yet acknowledged the projections.
        FileError
            If the session cannot be written; the results are kept in memory.
        """
        if self.state is State.APPLYING:
            raise ProcedureError("wait until the projections are applied")
        if not self.alignments or self.state is State.ALIGN:
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

        self._store(write)
        return results

    def apply(self) -> None:
        """Send the solved projections to the headset and hide the cursor.

        An eye with the verdict *keep* gets its offline projection.

        Raises
        ------
        ProcedureError
            If nothing is solved.
        """
        if self.results is None or self.state is not State.SOLVED:
            raise ProcedureError("solve first")
        self._clear_cursor()
        self._send_projections(self.results.rendered_shift_m)
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
        is_pending = any(message.state is Delivery.PENDING for message in self._sent.values())
        if self.state is State.APPLYING and is_pending and time.monotonic() < self._apply_until_s:
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
        deadline_s = time.monotonic() + timeout_s
        try:
            for message in self._sent.values():
                self._link.wait_acked(message, max(0.0, deadline_s - time.monotonic()))
        except HandcalError:
            self.state = State.SOLVED
            raise
        assert self.results is not None
        applied_m = self.results.rendered_shift_m
        self._shift_m |= applied_m
        self.state = State.APPLIED
        self._store(lambda session: session.save_applied(applied_m))

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
        self._shift_m |= shifts
        return self._send_projections(shifts)

    def record_shift(self) -> None:
        """Record the φ set by hand in the session; FileError if it cannot be written."""
        settled_m = self.applied_shift_m
        self._store(lambda session: session.save_fine_tuned(settled_m))

    def store_waiting(self) -> None:
        """Write data that could not be written before; FileError if they still cannot be."""
        while self._session is not None and self._unstored:
            self._unstored[0](self._session)
            self._unstored.popleft()

    def _resume(self, record: SessionRecord) -> None:
        """Restore the state of a session; a cursor or projections pending then are lost."""
        self._items.active = dict(record.alignments)
        self._items.deleted = dict(record.deleted_alignments)
        self._items.taken = record.last_alignment
        self._shift_m |= record.applied_shift_m
        if record.is_solved:
            try:
                self._solve()
            except ValueError as error:
                raise ProcedureError(f"{record.path} cannot be resumed: {error}") from error
            self.state = State.APPLIED if record.is_applied else State.SOLVED
        elif record.alignments:
            self.state = State.ALIGNED

    def _solve(self) -> Results:
        self.results = solve_session(
            self.alignments,
            self.rig,
            self._settings.solve,
            eye_distance=self.eye_distance,
            contradictions=[one.text for one in self.evidence.contradictions],
        )
        return self.results

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
                self._unstored.append(lambda session: session.save_facts(eye_distance=told))

    def _require_settled(self, what: str) -> None:
        if self.state in (State.ALIGN, State.APPLYING):
            raise ProcedureError(f"{what} cannot be changed now ({self.state})")

    def _forget_results(self) -> None:
        self.results = None
        if self.state is not State.APPLIED:
            self._show_hand_again()

    def _show_hand_again(self) -> None:
        self._clear_cursor()
        self._send_projections(self._shift_m)  # `apply` may have failed for one eye only
        self.state = State.SHOW_HAND

    def _send_projections(self, shifts_m: Mapping[Eye, Float64]) -> list[Outgoing]:
        for eye, shift_m in shifts_m.items():
            display = self.rig.eyes[eye]
            projection = Projection(
                eye,
                projection_matrix(display, shift_m),
                display.width_px,
                display.height_px,
                display.T_V_H,
                projection_matrix(display),
                self._wearer,
                self._rig_name,
            )
            self._sent[eye] = self._link.send_projection(projection)
        return [self._sent[eye] for eye in shifts_m]

    def _guide(self, observation: Observation) -> Observation:
        """Show the live hand with its rotation, and handle a confirmation."""
        if observation.hand is not None:
            observation = self._show_live(observation, observation.hand)
        for confirmation in self._link.confirmations():
            if confirmation.cursor_id == self._cursor_id:
                self._confirmation = confirmation
        waiting = self._confirmation
        if waiting is not None and self._hands.placed_until_ns() >= waiting.t_host_ns:
            self._confirmation = None
            self._judge(waiting)
        return observation

    def _show_live(self, observation: Observation, hand: PlacedHand) -> Observation:
        started_s = time.perf_counter()
        assert self._guard is not None
        try:
            rotation_W = self._guard.follow(hand.points_W_m, hand.cloud.is_cut)
            if hand.t_host_ns - self._shape_ns > _SHAPE_EVERY_NS:
                self._shape = self._guard.shape_change(
                    hand.points_W_m, hand.cloud.is_cut, is_live=True
                )
                self._shape_ns = hand.t_host_ns
        except HandError as error:
            return replace(observation, hand=None, problem=str(error))
        shape = self._shape
        is_over_limit = self._is_over_limit(rotation_W) or self._has_changed(shape)
        self._link.send_live_hand(hand.points_W_m, is_over_limit)
        R_D_W = hand.T_W_D[:3, :3].T
        return replace(
            observation,
            rotation_rad=R_D_W @ rotation_W,
            shape_change_m=None if shape is None else shape.rms_m,
            shape_text="" if shape is None else change_text(shape, R_D_W),
            has_changed=self._has_changed(shape),
            is_over_limit=is_over_limit,
            guard_ms=1e3 * (time.perf_counter() - started_s),
        )

    def _is_lost(self) -> bool:
        """Return True if the headset is connected and has not acknowledged its projections."""
        is_failed = any(message.state is Delivery.FAILED for message in self._sent.values())
        return is_failed and self._link.connected

    def _ask_to_look_around(self) -> None:
        """Have the wearer move the head as long as the camera's delay is needed for a cursor."""
        is_needed = (
            self._delay.is_needed
            and self.state is not State.ALIGN
            and self._hands.steady() is not None
        )
        is_over = not self._delay.is_needed or self.state is State.ALIGN
        if is_needed if not self._looks_around else is_over:
            self._looks_around = is_needed
            if self.state is not State.ALIGN:
                self._link.send_prompt(LOOK_AROUND if is_needed else "", EYES)

    def _has_changed(self, shape: ShapeChange | None) -> bool:
        return shape is not None and shape.rms_m > self._settings.guard.shape_limit_m

    def _judge(self, confirmation: Confirmation) -> None:
        """Accept or refuse a confirmation."""
        assert self._cursor is not None
        assert self._guard is not None
        if confirmation.problem:
            self.evidence.drawn_otherwise(confirmation.problem)
            self._link.send_again()
            self._refuse(
                "The headset does not show what it should. Confirm again; if this is repeated, "
                "restart the headset's app.",
                "drawn otherwise",
            )
            return
        try:
            hand = self._hands.nearest(confirmation.t_host_ns, self._settings.match_tolerance_s)
            hand = merge_hold(self._hands.held_at(hand), hand)
            rotation_W = self._guard.rotation(hand.points_W_m, hand.cloud.is_cut)
            T_W_H = self._link.pose_at_host_ns(confirmation.t_host_ns)
            shape = self._guard.shape_change(hand.points_W_m, hand.cloud.is_cut)
        except PosePendingError:
            self._confirmation = confirmation
            return
        except (HandError, PoseError) as error:
            self._refuse(f"{error}. Align and confirm again.", "no hand")
            return
        angle_deg = float(np.degrees(np.linalg.norm(rotation_W)))
        if self._is_over_limit(rotation_W):
            self.refused += 1
            limit_deg = np.degrees(self._settings.guard.limit_rad)
            advice = turn_advice(hand.T_W_D[:3, :3].T @ rotation_W)
            self._refuse(
                f"Your hand is turned by {angle_deg:.1f}°, more than {limit_deg:g}°. "
                f"{advice.text} and confirm again.",
                "turned",
                angle_deg,
            )
            return
        if self._has_changed(shape):
            self.refused += 1
            text = change_text(shape, hand.T_W_D[:3, :3].T)
            self._refuse(
                f"Your hand has changed its shape since the cursor was made: {text}. "
                "Hold it as it was and confirm again, or make the cursor again.",
                "shape changed",
            )
            return
        time_sigma_m = self._delay.time_sigma_m(
            (self._cursor, hand), confirmation.t_host_ns, self._hands.speed_m_s(hand)
        )
        if time_sigma_m > self._settings.delay.moved_limit_m:
            self._refuse(
                "Your hand or your head moved too fast. Hold both still and confirm again.", "moved"
            )
            return
        alignment = Alignment(
            cursor_m=self._cursor.points_W_m,
            hand_m=hand.points_W_m,
            cursor_is_cut=self._cursor.cloud.is_cut,
            hand_is_cut=hand.cloud.is_cut,
            T_E_W={eye: view_of_eye(self.rig.eyes[eye], T_W_H) for eye in EYES},
            eyes=self.eyes,
            rotation_rad=hand.T_W_D[:3, :3].T @ rotation_W,
            t_a_ns=self._cursor.cloud.t_camera_ns,
            t_b_ns=hand.cloud.t_camera_ns,
            drawn_shift_m=dict(self._shift_m),
            time_sigma_m=time_sigma_m,
        )
        self.evidence.drawn_as_sent()
        facts = AlignmentFacts(
            match_age_s=1e-9 * abs(hand.t_host_ns - confirmation.t_host_ns),
            cursor_moved_m=self._cursor.movement_m,
            hand_moved_m=hand.movement_m,
            shape_change_m=shape.rms_m,
        )
        self._items.save(self._items.next_number(), alignment)
        self.state = State.ALIGNED
        self.refusal = ""
        self._store(lambda session: session.save_alignment(alignment, facts))

    def _refuse(self, prompt: str, reason: str, angle_deg: float | None = None) -> None:
        self.refusal = prompt
        self._link.send_prompt(prompt, self.eyes)
        refused = {"reason": reason, "angle_deg": angle_deg, "cursor_id": self._cursor_id}
        self._store(lambda session: session.record("refused", **refused))

    def _is_over_limit(self, rotation: Float64) -> bool:
        return float(np.linalg.norm(rotation)) > self._settings.guard.limit_rad

    def _clear_cursor(self) -> None:
        self._cursor = self._guard = self._confirmation = self._shape = None
        self.refusal = ""
        # The wearer lowers the hand now: only a hand seen from here on can become a cursor.
        self._hands.clear()
        self._link.send_cursor(np.empty((0, 3)), self._cursor_id)
        self._link.send_prompt("", EYES)

    def _store_camera(self) -> None:
        """Record the camera if it is not the one recorded."""
        assert self._frame is not None
        camera = CameraUsed(self.camera, self._frame.depth_intrinsics, self._frame.depth_scale_m)
        if camera != self._camera_stored:
            self._camera_stored = camera
            self._store(lambda session: session.save_facts(camera=camera))

    def _store(self, write: Callable[[Session], object]) -> None:
        """Write to the session, after data that could not be written before."""
        if self._session is not None:
            self._unstored.append(write)
            self.store_waiting()


def _rig_name(rig: Rig) -> str:
    """Return the rig's name in one line, with eight digits that change with its displays."""
    offline = {
        eye: Projection(eye, projection_matrix(one), one.width_px, one.height_px, one.T_V_H)
        for eye, one in rig.eyes.items()
    }
    name = "".join(character for character in rig.name if character >= " ")
    return f"{name[:80]} {drawn_digest(offline, None).hex()[:8]}"


def _earlier_evidence(resume: SessionRecord | None) -> list[Contradiction]:
    if resume is None:
        return []
    pairs = zip(resume.facts.evidence, resume.facts.contradictions, strict=False)
    return [Contradiction(name, text) for name, text in pairs]


def _align_prompt(eyes: Sequence[Eye]) -> str:
    if len(eyes) == 1:
        other = "right" if eyes[0] == "left" else "left"
        return f"Close your {other} eye. Move your hand under the cursor, then confirm."
    return "Keep both eyes open. Move your hand under the cursor, then confirm."
