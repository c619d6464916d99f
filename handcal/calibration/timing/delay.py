"""Delay of the camera's pictures, measured while the head moves.

The background stands still, so its movement in the picture must be the one that the headset's poses
predict for the time of the exposure. `handcal.calibration.timing.offset` finds the time at which
both agree best, on the clock on which the poses are known.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from handcal.calibration.hands import PlacedHand
from handcal.calibration.timing.background import Background, follow, make_background
from handcal.calibration.timing.offset import (
    FEWEST_FRAMES,
    LARGEST_S,
    REACH_NS,
    STEP_NS,
    is_still,
    measure_offset,
)
from handcal.camera.clock import INFORM_NS, FrameClock
from handcal.core.errors import PoseError, PosePendingError
from handcal.core.geometry import invert
from handcal.core.types import Float64, Frame

_KEY_NS = 5_000_000_000
"""A key frame serves for this time, or longer on a busy computer, until it has enough frames."""
_KEPT_FRAMES = 450
_EVERY_NS, _EVERY_KNOWN_NS = 400_000_000, 5_000_000_000
"""Time between two measurements."""
_EVERY_FRAME_KNOWN = 3
_SLOW_S = 0.3
_LONGEST_NS = 2_000_000_000
"""A frame that arrives later than this, or before its exposure, is of another clock."""
_CARRY_NS = 50_000_000
_PLAIN_NS = 10_000_000_000
"""A background that could not be followed for this time is taken to have too little texture."""


@dataclass(frozen=True, slots=True)
class DelaySettings:
    """Limits of the delay of the camera's pictures."""

    sigma_s: float = 0.008
    """The delay is known if its standard deviation is at most this."""
    limit_s: float = 0.12
    limit_frames: float = 0.15
    """Largest time from the exposure to the earliest arrival: the sum of both. A busy computer,
    with few frames per second, is late by a share of the time between two frames, at most 0.3 s of
    which counts."""
    assumed_sigma_s: float = 0.03
    """Standard deviation of a delay that is not measured."""
    moved_limit_m: float = 0.0015
    """Largest standard deviation of a hand's place because of the times."""


class DelayMeter:
    """Measures the time of the exposures, and sets the camera's clock by it.

    Parameters
    ----------
    clock : FrameClock
    pose_at_host_ns : callable
        Returns T_W_H (4, 4) at a host time, or raises PosePendingError or PoseError.
    T_H_D : (4, 4) float64
        From the depth camera to the headset.
    settings : DelaySettings
    """

    def __init__(
        self,
        clock: FrameClock,
        pose_at_host_ns: Callable[[int], Float64],
        T_H_D: Float64,
        settings: DelaySettings,
    ) -> None:
        self._clock = clock
        self._pose_at_host_ns = pose_at_host_ns
        self._T_H_D = T_H_D
        self._settings = settings
        self._backgrounds: deque[Background] = deque()
        self._poses: deque[tuple[int, Float64]] = deque()
        self._next_pose_ns = self._next_ns = self._newest_ns = self._frames = 0
        self._looked_ns = -INFORM_NS
        self._followed_ns: int | None = None
        self._is_still = False
        self._sigma_s = settings.assumed_sigma_s

    @property
    def is_needed(self) -> bool:
        """True if the delay has an effect and is not known.

        A head that hardly moves is in the same place at all times. Without colour, in which the
        background is followed, or with a background without texture, the delay stays an assumption.
        """
        can_measure = (
            self._followed_ns is not None and self._newest_ns - self._followed_ns < _PLAIN_NS
        )
        return can_measure and self._clock.measured_ns is None and not self._is_still

    @property
    def delay_s(self) -> float | None:
        """Time from the exposure to the earliest arrival; None if it is not known."""
        measured_ns = self._clock.measured_ns
        return None if measured_ns is None else 1e-9 * (self._clock.earliest_ns - measured_ns)

    @property
    def largest_delay_s(self) -> float:
        """Largest delay of a camera that is not late."""
        period_s = min(self._clock.period_s, _SLOW_S)
        return self._settings.limit_s + self._settings.limit_frames * period_s

    def see(self, frame: Frame) -> bool:
        """Look at a frame that the clock knows; return True if the delay has just become known."""
        if frame.color is None:
            return False
        measured_ns = self._clock.measured_ns
        late_ns = frame.t_host_ns - frame.t_camera_ns - (measured_ns or 0)
        is_same_clock = measured_ns is None or 0 <= late_ns < _LONGEST_NS
        if not is_same_clock or frame.t_camera_ns < self._newest_ns:
            self._backgrounds.clear()
            self._clock.measured_ns = None
            self._sigma_s = self._settings.assumed_sigma_s
            self._next_ns, self._is_still, self._followed_ns = 0, False, None
            self._looked_ns = -INFORM_NS
        if frame.t_camera_ns == self._newest_ns:
            return False
        self._newest_ns = frame.t_camera_ns
        if frame.t_camera_ns - self._looked_ns < INFORM_NS:
            return False
        self._looked_ns = frame.t_camera_ns
        if self._followed_ns is None:
            self._followed_ns = frame.t_camera_ns
        is_known = self._clock.measured_ns is not None
        self._frames += 1
        if not is_known or self._frames % _EVERY_FRAME_KNOWN == 0:
            self._follow(frame)
        self._read_poses()  # those of 5 s at once would take longer than the time between frames
        if frame.t_host_ns < self._next_ns:
            return False
        self._next_ns = frame.t_host_ns + (_EVERY_KNOWN_NS if is_known else _EVERY_NS)
        times_ns = np.array([t_ns for t_ns, _ in self._poses], dtype=np.int64)
        poses = np.array([T for _, T in self._poses]).reshape(-1, 4, 4)
        self._is_still = is_still(poses)
        if self._is_still:  # its movement would show nothing, after 30 ms of searching
            return False
        found = measure_offset(
            self._backgrounds, times_ns, poses, self._T_H_D, self._clock.earliest_ns
        )
        if found is not None and found.sigma_s <= self._settings.sigma_s:
            self._clock.measured_ns = found.offset_ns
            self._sigma_s = found.sigma_s
            self._next_ns = frame.t_host_ns + _EVERY_KNOWN_NS
        return not is_known and self._clock.measured_ns is not None

    def time_sigma_m(
        self, hands: Sequence[PlacedHand], confirmed_ns: int, speed_m_s: float
    ) -> float:
        """Return the standard deviation of the last hand's place relative to the first.

        The head moves by its speed times the uncertainty of the delay, at each of them; the hand by
        its speed times the age of the match.

        Parameters
        ----------
        hands : sequence of PlacedHand
            The cursor, and the hand taken for the confirmation.
        confirmed_ns : int
            Host time of the confirmation.
        speed_m_s : float
            Of that hand in the world.
        """
        age_s = 1e-9 * abs(hands[-1].t_host_ns - confirmed_ns)
        moved_m = [self._sigma_s * self._carried_m_s(hand) for hand in hands]
        return float(np.linalg.norm([*moved_m, age_s * speed_m_s]))

    def _carried_m_s(self, hand: PlacedHand) -> float:
        """Return the speed at which the head carries what is at the hand's place; 0 if unknown.

        If the frame carries the pose, no delay matters, and it is 0.
        """
        if hand.is_posed_by_camera:
            return 0.0
        around_ns = (hand.t_host_ns - _CARRY_NS, hand.t_host_ns + _CARRY_NS)
        try:
            before, after = (self._pose_at_host_ns(t_ns) for t_ns in around_ns)
        except PoseError:
            return 0.0
        at_H = invert(before)[:3] @ [*hand.middle_W_m, 1.0]
        moved_m = (after - before)[:3] @ [*at_H, 1.0]
        return float(np.linalg.norm(moved_m)) / (2e-9 * _CARRY_NS)

    def _follow(self, frame: Frame) -> None:
        backgrounds = self._backgrounds
        is_old = (
            bool(backgrounds)
            and frame.t_camera_ns - backgrounds[-1].times_ns[0] > _KEY_NS
            and len(backgrounds[-1].times_ns) > 2 * FEWEST_FRAMES
        )
        if not backgrounds or is_old or not follow(backgrounds[-1], frame):
            has_poses = self._has_poses(frame)
            made = make_background(frame) if has_poses else None
            if made is not None:
                backgrounds.append(made)
            elif has_poses:
                return
        self._followed_ns = frame.t_camera_ns
        while len(backgrounds) > 1 and sum(len(b.times_ns) for b in backgrounds) > _KEPT_FRAMES:
            backgrounds.popleft()

    def _has_poses(self, frame: Frame) -> bool:
        """Return True unless the poses begin after the earliest possible time of a frame."""
        earliest_ns = frame.t_camera_ns + self._clock.earliest_ns - round(1e9 * LARGEST_S)
        try:
            self._pose_at_host_ns(earliest_ns - 2 * REACH_NS)
        except (PosePendingError, PoseError):
            return False
        return True

    def _read_poses(self) -> None:
        """Keep the poses since the first frame kept, and those since the last call."""
        first_ns = self._backgrounds[0].times_ns[0] if self._backgrounds else self._newest_ns
        earliest_ns = self._clock.earliest_ns
        begin_ns = first_ns + earliest_ns - round(1e9 * LARGEST_S) - 2 * REACH_NS
        while self._poses and self._poses[0][0] < begin_ns:
            self._poses.popleft()
        self._next_pose_ns = max(self._next_pose_ns, begin_ns)
        while self._next_pose_ns < self._newest_ns + earliest_ns + REACH_NS:
            try:
                pose = self._next_pose_ns, self._pose_at_host_ns(self._next_pose_ns)
                self._poses.append(pose)
            except PosePendingError:
                break
            except PoseError:
                pass
            self._next_pose_ns += STEP_NS
