"""One alignment in progress: compares the live hand with the cursor, and judges confirmations."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handcal.calibration.hands import PlacedHand, RecentHands
from handcal.calibration.hold import merge_hold
from handcal.calibration.states import CalibrationSettings, Observation
from handcal.calibration.timing.delay import DelayMeter
from handcal.camera.clock import INFORM_NS
from handcal.core.display import view_of_eye
from handcal.core.errors import (
    HandError,
    NoFrameError,
    OutOfViewError,
    PoseError,
    PosePendingError,
)
from handcal.core.geometry import invert
from handcal.core.types import EYES, Alignment, Eye, Float64, Rig
from handcal.link.server import Confirmation, HeadsetServer
from handcal.register.guard import GuardSettings, RotationGuard, turn_advice
from handcal.register.shape import ShapeChange, change_text
from handcal.session.facts import AlignmentFacts

KEEP_PROMPT = "Keep your hand up."
"""Shown if the next cursor or verification follows at once."""
OUT_OF_VIEW = "out of view"
"""The journal's reason of a refusal after which the cursor is withdrawn."""
# The prompt says what to balance when the hand is turned.
_MOVE = "Move your hand under the cursor, both finger tips and wrist, then confirm."
ADVISE_EVERY_NS = 1_000_000_000
"""Least time between two pieces of advice, so that each can be read."""
# The advice does not come and go at its limit.
_STILL_TURNED = 0.7
_SHAPE_EVERY_NS = 250_000_000
"""A measurement of the shape takes half of a frame's time, and nobody reads faster."""


@dataclass(frozen=True, slots=True, eq=False)
class Accepted:
    """A confirmed alignment."""

    alignment: Alignment
    facts: AlignmentFacts


@dataclass(frozen=True, slots=True)
class Refused:
    """A confirmation that was refused."""

    prompt: str
    """The reason, and what the wearer should do."""
    reason: str
    """The reason as the journal names it."""
    angle_deg: float | None = None
    was: str = ""
    """The cause in the past tense, if the live hand shows whether it lasts; else empty."""


class Aligning:
    """The cursor shown now, and the hand that follows it.

    Parameters
    ----------
    cursor : PlacedHand
        The frozen hand.
    cursor_id : int
    eyes : tuple of eye
        The eyes to keep open.
    rig : Rig
    settings : CalibrationSettings

    Attributes
    ----------
    confirmation : Confirmation or None
        One that waits for the frame of its time.
    refusal : str
        Reason why the last confirmation was refused; empty if none was.
    refused_for : str
        `Refused.was` of that confirmation.

    Raises
    ------
    HandError
        If almost all points lie at cut edges.
    """

    def __init__(
        self,
        cursor: PlacedHand,
        cursor_id: int,
        eyes: tuple[Eye, ...],
        rig: Rig,
        settings: CalibrationSettings,
    ) -> None:
        self.cursor = cursor
        self.cursor_id = cursor_id
        self.eyes = eyes
        self.confirmation: Confirmation | None = None
        self.refusal = self.refused_for = ""
        self._rig = rig
        self._settings = settings
        self._limits: GuardSettings = settings.guard
        self._guard = RotationGuard(cursor.points_W_m, cursor.cloud.is_cut)
        self._shape: ShapeChange | None = None
        self._shape_ns = 0
        self._followed: Observation | None = None
        self._followed_ns = 0
        self._advice = ""
        self._advised_ns = 0

    def follow(self, observation: Observation, hand: PlacedHand) -> Observation:
        """Return the observation with rotation and change of shape of the live hand.

        Frames closer than `INFORM_NS` to the last hand followed show that hand's, without a
        `guard_ms`: it informs the wearer, and a confirmation is judged by a measurement of its own.
        """
        last = self._followed
        if last is not None and 0 <= hand.t_host_ns - self._followed_ns < INFORM_NS:
            return replace(
                observation,
                rotation_rad=last.rotation_rad,
                shape_change_m=last.shape_change_m,
                shape_text=last.shape_text,
                has_changed=last.has_changed,
                is_over_limit=last.is_over_limit,
            )
        started_s = time.perf_counter()
        try:
            rotation_W = self._guard.follow(hand.points_W_m, hand.cloud.is_cut)
            if hand.t_host_ns - self._shape_ns > _SHAPE_EVERY_NS:
                self._shape = self._guard.shape_change(
                    hand.points_W_m, hand.cloud.is_cut, is_live=True
                )
                self._shape_ns = hand.t_host_ns
        except HandError as error:
            self._followed = None
            return replace(observation, hand=None, problem=str(error))
        shape = self._shape
        R_D_W = hand.T_W_D[:3, :3].T
        self._followed_ns = hand.t_host_ns
        self._followed = replace(
            observation,
            rotation_rad=R_D_W @ rotation_W,
            shape_change_m=None if shape is None else shape.rms_m,
            shape_text="" if shape is None else change_text(shape, R_D_W),
            has_changed=self._has_changed(shape),
            is_over_limit=self._is_over_limit(rotation_W) or self._has_changed(shape),
            guard_ms=1e3 * (time.perf_counter() - started_s),
        )
        return self._followed

    def advise(self, observation: Observation) -> str | None:
        """Return a new prompt for the wearer, to turn the hand back or to stop; else None."""
        hand, rotation_rad = observation.hand, observation.rotation_rad
        if hand is None or rotation_rad is None:
            return None
        least_rad = self._limits.advice_rad * (_STILL_TURNED if self._advice else 1.0)
        is_turned = float(np.linalg.norm(rotation_rad)) > least_rad
        advice = turn_advice(rotation_rad).text if is_turned else ""
        if advice == self._advice or hand.t_host_ns - self._advised_ns < ADVISE_EVERY_NS:
            return None
        self._advice, self._advised_ns = advice, hand.t_host_ns
        return f"{advice}, then confirm." if advice else align_prompt(self.eyes)

    def judge(
        self,
        confirmation: Confirmation,
        hands: RecentHands,
        link: HeadsetServer,
        delay: DelayMeter,
        drawn_shift_m: Mapping[Eye, Float64],
    ) -> Accepted | Refused | None:
        """Accept or refuse a confirmation; None while the pose of its time is not yet known."""
        if not confirmation.is_timed:
            return Refused("The headset's clock was set. Confirm again.", "clock set")
        if confirmation.problem:
            return Refused(
                "The headset does not show what it should. Confirm again; if this keeps "
                "happening, restart the headset's app.",
                "drawn otherwise",
            )
        try:
            hand = hands.nearest(confirmation.t_host_ns, self._settings.match_tolerance_s)
            hand = merge_hold(hands.held_at(hand), hand)
            rotation_W = self._guard.rotation(hand.points_W_m, hand.cloud.is_cut)
            if hand.is_posed_by_camera:
                T_W_H = hand.T_W_D @ invert(self._rig.T_H_D)
            else:
                T_W_H = link.pose_at_host_ns(confirmation.t_host_ns)
            shape = self._guard.shape_change(hand.points_W_m, hand.cloud.is_cut)
        except PosePendingError:
            return None
        except OutOfViewError as error:
            # The hand covers the cursor only there, so another cursor is needed.
            return Refused(
                f"The camera saw only a part of your hand: {error}. Lower it, and raise it again "
                "there.",
                OUT_OF_VIEW,
            )
        except NoFrameError as error:
            return Refused(f"{error}. Confirm again.", "no image")
        except (HandError, PoseError) as error:
            was = error.what if isinstance(error, HandError) else ""
            return Refused(f"{error}. Align and confirm again.", "no hand", was=was)
        if refused := self._refuse(hand, rotation_W, shape):
            return refused
        hands_used = self.cursor, hand
        speed_m_s = hands.speed_m_s(hand)
        time_sigma_m = delay.time_sigma_m(hands_used, confirmation.t_host_ns, speed_m_s)
        if time_sigma_m > self._settings.delay.moved_limit_m:
            return Refused(
                "Your hand or your head moved too fast. Hold both still and confirm again.", "moved"
            )
        alignment = Alignment(
            cursor_m=self.cursor.points_W_m,
            hand_m=hand.points_W_m,
            cursor_is_cut=self.cursor.cloud.is_cut,
            hand_is_cut=hand.cloud.is_cut,
            T_E_W={eye: view_of_eye(self._rig.eyes[eye], T_W_H) for eye in EYES},
            eyes=self.eyes,
            rotation_rad=hand.T_W_D[:3, :3].T @ rotation_W,
            t_a_ns=self.cursor.cloud.t_camera_ns,
            t_b_ns=hand.cloud.t_camera_ns,
            drawn_shift_m=dict(drawn_shift_m),
            time_sigma_m=time_sigma_m,
            outline_sigma_px=self.cursor.cloud.outline_sigma_px,
        )
        facts = AlignmentFacts(
            match_age_s=1e-9 * abs(hand.t_host_ns - confirmation.t_host_ns),
            cursor_moved_m=self.cursor.movement_m,
            hand_moved_m=hand.movement_m,
            shape_change_m=shape.rms_m,
        )
        return Accepted(alignment, facts)

    def _refuse(self, hand: PlacedHand, rotation_W: Float64, shape: ShapeChange) -> Refused | None:
        R_D_W = hand.T_W_D[:3, :3].T
        if self._is_over_limit(rotation_W):
            angle_deg = float(np.degrees(np.linalg.norm(rotation_W)))
            limit_deg = np.degrees(self._limits.limit_rad)
            return Refused(
                f"Your hand is turned by {angle_deg:.1f}°, more than {limit_deg:g}°. "
                f"{turn_advice(R_D_W @ rotation_W).text} and confirm again.",
                "turned",
                angle_deg,
                f"your hand was turned by {angle_deg:.1f}°, more than {limit_deg:g}°",
            )
        if self._has_changed(shape):
            return Refused(
                "The shape of your hand has changed since the cursor was made: "
                f"{change_text(shape, R_D_W)}. "
                "Hold it as it was and confirm again, or make the cursor again.",
                "shape changed",
                was="the shape of your hand had changed",
            )
        return None

    def _has_changed(self, shape: ShapeChange | None) -> bool:
        return shape is not None and shape.rms_m > self._limits.shape_limit_m

    def _is_over_limit(self, rotation: Float64) -> bool:
        return float(np.linalg.norm(rotation)) > self._limits.limit_rad


def align_prompt(eyes: Sequence[Eye]) -> str:
    """Return what the wearer is asked to do with a cursor."""
    if len(eyes) == 1:
        other = "right" if eyes[0] == "left" else "left"
        return f"Close your {other} eye. {_MOVE}"
    return f"Keep both eyes open. {_MOVE}"
