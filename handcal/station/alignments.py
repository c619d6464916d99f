"""The part of the procedure that makes alignments: frames and confirmations in, alignments out."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from handcal.camera.clock import FrameClock
from handcal.errors import HandError, PoseError
from handcal.geometry import invert, rigid, transform
from handcal.hand.marks import outline_marks
from handcal.hand.shipped import make_finder
from handcal.link.reliable import Delivery, Outgoing
from handcal.link.server import Confirmation, HeadsetServer
from handcal.register.results import SolveSettings
from handcal.rig_types import Rig
from handcal.session.session import Session, SessionRecord
from handcal.session.state import MAX_ALIGNMENTS, NumberedItems
from handcal.station.aligning import KEEP_PROMPT, Accepted, Aligning, Refused, align_prompt
from handcal.station.delay import DelayMeter
from handcal.station.drawing import Drawing
from handcal.station.evidence import Contradiction, Evidence
from handcal.station.hands import PlacedHand, RecentHands
from handcal.station.hold import merge_hold
from handcal.station.states import CalibrationSettings, Observation, ProcedureError, State
from handcal.station.store import Store
from handcal.types import (
    EYES,
    LOOK_AROUND,
    Alignment,
    CameraIdentity,
    Eye,
    Float64,
    Frame,
    HandCloud,
)


class AlignmentSteps:
    """Finds the hand in each frame, shows the cursor, and judges confirmations.

    The base of `handcal.station.procedure.Calibration`, which documents the parameters.
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
        self.rig = rig
        self.state = State.SHOW_HAND
        self.eyes: tuple[Eye, ...] = EYES
        self.camera = CameraIdentity()
        self.evidence = Evidence(rig, _earlier_evidence(resume))
        self._link = link
        self._settings = settings
        self._clock = FrameClock(settings.camera_latency_s)
        self._delay = DelayMeter(self._clock, link.pose_at_host_ns, rig.T_H_D, settings.delay)
        self._looks_around = False
        self._finder = make_finder(settings.segment)
        self._hands = RecentHands(
            link.pose_at_host_ns, rig.T_H_D, settings.steady_s, settings.steady_m
        )
        self.raised: PlacedHand | None = None
        self._aligning: Aligning | None = None
        self._cursor_id = 0
        self._items = NumberedItems[Alignment]("alignment", MAX_ALIGNMENTS)
        self._store = Store(session, None if resume is None else resume.facts.camera)
        self._drawing = Drawing(rig, link, wearer)
        self._sent_cursor: Outgoing | None = None
        self._frame: Frame | None = None

    @property
    def alignments(self) -> Mapping[int, Alignment]:
        """The alignments that are not deleted, by their number in the session."""
        return MappingProxyType(dict(self._items.active))

    @property
    def cursor(self) -> PlacedHand | None:
        """The frozen hand while the headset shows it, else None."""
        return None if self._aligning is None else self._aligning.cursor

    @property
    def refusal(self) -> str:
        """Reason why the last confirmation of the present cursor was refused; else empty."""
        return "" if self._aligning is None else self._aligning.refusal

    @property
    def refused_for(self) -> str:
        """Its cause in the past tense, if the live hand shows whether it lasts; else empty."""
        return "" if self._aligning is None else self._aligning.refused_for

    @property
    def applied_shift_m(self) -> Mapping[Eye, Float64]:
        """φ that the headset renders each eye with, solved or set by hand."""
        return MappingProxyType(dict(self._drawing.shift_m))

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
        return self._hands.steady()

    @property
    def newest_hand(self) -> PlacedHand | None:
        """The newest hand unless it is too old for a confirmation."""
        return self._hands.newest(self._settings.match_tolerance_s)

    @property
    def solve_settings(self) -> SolveSettings:
        """Settings of the solver."""
        return self._settings.solve

    def T_W_H(self, hand: PlacedHand) -> Float64:
        """Return the headset's pose (4, 4) when a hand was seen."""
        return np.asarray(hand.T_W_D @ invert(self.rig.T_H_D))

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
        if frame.T_W_D is None and self._delay.see(frame):
            self._hands.clear()  # they were placed by an assumed delay
        contradiction = (
            self.evidence.see(frame, self.camera, is_used=bool(self.alignments))
            or self.evidence.see_delay(self._delay.delay_s, self._delay.largest_delay_s)
            or self.evidence.see_delivery(self._drawing.is_lost and self._link.connected)
            or self._see_world(frame, t_host_ns)
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
        hand, not_placed = self._hands.add(cloud, t_host_ns, frame.T_W_D)
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
        if self._aligning is not None and self.state is State.ALIGN:
            observation = self._guide(observation, self._aligning)
        return replace(observation, state=self.state)

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
        if self._delay.is_needed:
            raise ProcedureError(
                "the delay of the camera's pictures is not known yet; let the wearer look slowly "
                "to the left and to the right, in front of a background with texture"
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
        if hand is not self.raised:
            hand = merge_hold(self._hands.held_at(hand), hand)
        self.raised = None if displacement_W_m is None else hand
        hand = hand if displacement_W_m is None else _moved(hand, displacement_W_m)
        self._aligning = Aligning(hand, self._cursor_id + 1, tuple(eyes), self.rig, self._settings)
        self._cursor_id += 1
        self.eyes = tuple(eyes)
        self.state = State.ALIGN
        outline_m = hand.cloud.contour_m.astype(np.float64)
        marks_m = outline_marks(outline_m, hand.cloud.contour_is_cut)
        drawn_W_m = transform(hand.T_W_D, np.vstack([outline_m, marks_m]))
        self._sent_cursor = self._link.send_cursor(drawn_W_m, self._cursor_id)
        self._link.send_prompt(align_prompt(self.eyes), self.eyes)
        assert self._frame is not None
        self._store.camera(self.camera, self._frame)
        self._store.event("cursor_made", cursor_id=self._cursor_id, eyes=list(self.eyes))

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
        self._aligning.confirmation = Confirmation(hand.t_host_ns, hand.t_host_ns, self._cursor_id)

    def store_waiting(self) -> None:
        """Write data that could not be written before; FileError if they still cannot be."""
        self._store.write_waiting()

    def _see_world(self, frame: Frame, t_host_ns: int) -> Contradiction | None:
        """Compare the pose that a frame carries with that of the headset's app."""
        if frame.T_W_D is None:
            return None
        with suppress(PoseError):
            by_app = self._link.pose_at_host_ns(t_host_ns) @ self.rig.T_H_D
            self.evidence.see_poses(frame.T_W_D, by_app)
        return self.evidence.other_world

    def _ask_to_look_around(self) -> None:
        """Ask the wearer to move the head while a cursor still needs the camera's delay."""
        is_before_cursor = self.state in (State.SHOW_HAND, State.APPLIED)
        is_needed = self._delay.is_needed and is_before_cursor
        # Not before the hand is up; then until the delay is known, also while the hand moves.
        is_asked = is_needed and (self._looks_around or self._hands.steady() is not None)
        if is_asked != self._looks_around:
            self._looks_around = is_asked
            if is_before_cursor:
                self._link.send_prompt(LOOK_AROUND if is_asked else "", EYES)

    def _guide(self, observation: Observation, aligning: Aligning) -> Observation:
        """Show the live hand with its rotation, and handle a confirmation."""
        if observation.hand is not None:
            observation = aligning.follow(observation, observation.hand)
            if (prompt := aligning.advise(observation)) is not None:
                self._link.send_prompt(prompt, self.eyes)
        if observation.hand is not None and observation.guard_ms is not None:
            self._link.send_live_hand(observation.hand.points_W_m, observation.is_over_limit)
        for confirmation in self._link.confirmations():
            if confirmation.cursor_id == self._cursor_id:
                aligning.confirmation = confirmation
        waiting = aligning.confirmation
        if waiting is not None and self._hands.placed_until_ns() >= waiting.t_host_ns:
            self._judge(waiting, aligning)
        return observation

    def _judge(self, confirmation: Confirmation, aligning: Aligning) -> None:
        """Accept or refuse a confirmation."""
        drawn_m = self._drawing.shift_m
        judged = aligning.judge(confirmation, self._hands, self._link, self._delay, drawn_m)
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
        self._items.save(self._items.next_number(), accepted.alignment)
        self.state = State.ALIGNED
        aligning.refusal = aligning.refused_for = ""
        self._store.write(
            lambda session: session.save_alignment(accepted.alignment, accepted.facts)
        )

    def _refuse(self, refused: Refused, aligning: Aligning) -> None:
        aligning.refusal, aligning.refused_for = refused.prompt, refused.was
        self._link.send_prompt(refused.prompt, self.eyes)
        self._store.event(
            "refused",
            reason=refused.reason,
            angle_deg=refused.angle_deg,
            cursor_id=self._cursor_id,
        )

    def _clear_cursor(self, keeps_hand: bool = False) -> None:
        self._aligning = None
        if not keeps_hand:
            # The wearer lowers the hand now: only a hand seen from here on can become a cursor.
            self._hands.clear()
            self.raised = None
        self._link.send_cursor(np.empty((0, 3)), self._cursor_id)
        self._link.send_prompt(KEEP_PROMPT if keeps_hand else "", EYES)


def _moved(hand: PlacedHand, displacement_W_m: ArrayLike) -> PlacedHand:
    """Return a hand at another place of the world."""
    moved_m = np.asarray(displacement_W_m, dtype=np.float64)
    return replace(
        hand,
        T_W_D=rigid(translation_m=moved_m) @ hand.T_W_D,
        points_W_m=hand.points_W_m + moved_m,
        middle_W_m=hand.middle_W_m + moved_m,
    )


def _earlier_evidence(resume: SessionRecord | None) -> list[Contradiction]:
    if resume is None:
        return []
    pairs = zip(resume.facts.evidence, resume.facts.contradictions, strict=False)
    return [Contradiction(name, text) for name, text in pairs]
