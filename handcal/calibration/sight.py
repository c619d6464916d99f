"""The hand in each frame, found and placed in the world, and the evidence against a frame."""

from __future__ import annotations

import time
from contextlib import suppress

from handcal.calibration.delay import ASSUMED_LATENCY_S, DelayMeter
from handcal.calibration.evidence import Contradiction, Evidence
from handcal.calibration.hands import PlacedHand, RecentHands
from handcal.calibration.states import CalibrationSettings, Observation, State
from handcal.camera.clock import FrameClock
from handcal.core.errors import HandError, PoseError
from handcal.core.types import CameraIdentity, Frame, HandCloud, Rig
from handcal.hand.edges import edges_of
from handcal.hand.outline import with_outline
from handcal.hand.shipped import make_finder
from handcal.link.server import HeadsetServer


class Sight:
    """Finds the hand in each frame and places it in the world.

    Parameters
    ----------
    rig : Rig
    link : HeadsetServer
        Knows where the head was.
    settings : CalibrationSettings
    evidence : Evidence
        Judges each frame.

    Attributes
    ----------
    hands : RecentHands
    delay : DelayMeter
    frame : Frame or None
        The newest one; None before the first.
    """

    def __init__(
        self, rig: Rig, link: HeadsetServer, settings: CalibrationSettings, evidence: Evidence
    ) -> None:
        self._rig = rig
        self._link = link
        self._evidence = evidence
        self._clock = FrameClock(ASSUMED_LATENCY_S)
        self._finder = make_finder(settings.segment)
        self.delay = DelayMeter(self._clock, link.pose_at_host_ns, rig.T_H_D)
        self.hands = RecentHands(link.pose_at_host_ns, rig.T_H_D)
        self.frame: Frame | None = None

    @property
    def newest_hand(self) -> PlacedHand | None:
        """The newest hand unless it is too old for a confirmation."""
        return self.hands.newest()

    def see(
        self,
        frame: Frame,
        camera: CameraIdentity,
        state: State,
        *,
        is_used: bool,
        is_drawing_lost: bool,
    ) -> Observation:
        """Return what a frame shows.

        Parameters
        ----------
        frame : Frame
        camera : CameraIdentity
            The camera that gave it.
        state : State
            Of the procedure, before this frame.
        is_used : bool
            True if an alignment was made from earlier frames.
        is_drawing_lost : bool
            True if a connected headset has not received its projections.
        """
        started_s = time.perf_counter()
        self.frame = frame
        t_host_ns = self._clock.exposure_ns(frame)
        if frame.T_W_D is None and self.delay.see(frame):
            self.hands.clear()  # they were placed by an assumed delay
        contradiction = (
            self._evidence.see(frame, camera, is_used=is_used)
            or self._evidence.see_delay(self.delay.delay_s, self.delay.largest_delay_s)
            or self._evidence.see_delivery(is_drawing_lost)
            or self._evidence.see_clock(self._link.clock_step_s)
            or self._see_world(frame, t_host_ns)
        )
        cloud, problem = self._find(frame, camera, contradiction)
        segment_ms = 1e3 * (time.perf_counter() - started_s)
        hand, not_placed = self.hands.add(cloud, t_host_ns, frame.T_W_D, problem)
        return Observation(
            state,
            hand,
            "" if hand else str(problem or not_placed),
            self.hands.steady() is not None and not self.delay.is_needed,
            cloud,
            segment_ms=segment_ms,
            contradiction=contradiction,
            needs_delay=self.delay.is_needed,
        )

    def _find(
        self, frame: Frame, camera: CameraIdentity, contradiction: Contradiction | None
    ) -> tuple[HandCloud | None, HandError | None]:
        """Return the hand in a frame, or None and the reason."""
        if contradiction is not None:
            self.hands.clear()
            return None, HandError(contradiction.what, contradiction.advice)
        try:
            cloud = self._finder.find(frame)
        except HandError as error:
            return None, type(error)(*error.args)  # without the traceback, which holds the station
        return with_outline(cloud, frame, edges_of(self._rig, camera.model)), None

    def _see_world(self, frame: Frame, t_host_ns: int) -> Contradiction | None:
        """Compare the pose that a frame carries with that of the headset's app."""
        if frame.T_W_D is None:
            return None
        with suppress(PoseError):
            by_app = self._link.pose_at_host_ns(t_host_ns) @ self._rig.T_H_D
            self._evidence.see_poses(frame.T_W_D, by_app)
        return self._evidence.other_world
