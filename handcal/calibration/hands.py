"""The hands seen recently, placed in the world by the headset's pose at their exposure."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from handcal.core.errors import (
    HandError,
    NoFrameError,
    OutOfViewError,
    PoseError,
    PosePendingError,
)
from handcal.core.geometry import transform
from handcal.core.types import Float64, HandCloud

_KEEP_S = 1.0
"""Placed hands are kept this long, so that a retransmitted confirmation still finds its frame."""
_HOLD_M = 0.0015
"""Frames in which the hand is this near belong to one hold: not one that still moves, nor one that
is cut elsewhere."""
_SPEED_S = 0.1
"""Time over which a speed is measured: it must exceed the noise of the hand's place."""
_MEDIAN_STRIDE = 8
"""Every eighth point is enough for the median; all of them take half a millisecond."""


@dataclass(frozen=True, slots=True, eq=False)
class PlacedHand:
    """A hand cloud with its place in the world."""

    cloud: HandCloud
    t_host_ns: int
    """Time of its exposure on the host's monotonic clock."""
    T_W_D: Float64
    """(4, 4)."""
    points_W_m: Float64
    """(N, 3); the cloud's surface."""
    middle_W_m: Float64
    """(3,); its median, to a millimetre."""
    frames: int = 1
    """Number of frames from which the surface was made."""
    movement_m: float = 0.0
    """Movement of the hand during those frames."""
    is_posed_by_camera: bool = False
    """True if its frame carried the camera's pose, so that no clock was involved."""


class RecentHands:
    """The hands of the last second or so, in the order of their exposure.

    A hand is placed once the headset's pose at its exposure is known, which may be some frames
    after its own.

    Parameters
    ----------
    pose_at_host_ns : callable
        Returns T_W_H (4, 4) at a host time, or raises PosePendingError or PoseError.
    T_H_D : (4, 4) float64
        From the depth camera to the headset.
    steady_s, steady_m : float
        A hand is steady if it moved less than `steady_m` for `steady_s`.
    """

    def __init__(
        self,
        pose_at_host_ns: Callable[[int], Float64],
        T_H_D: Float64,
        steady_s: float,
        steady_m: float,
    ) -> None:
        self._pose_at_host_ns = pose_at_host_ns
        self._T_H_D = T_H_D
        self._steady_ns = round(1e9 * steady_s)
        self._steady_m = steady_m
        self._keep_ns = round(1e9 * (steady_s + _KEEP_S))
        self._placed: deque[PlacedHand] = deque()
        self._unplaced: deque[tuple[HandCloud, int, Float64 | None]] = deque()
        self._missed: deque[tuple[int, HandError]] = deque()
        self._seen_ns = 0
        self._frames_ns: deque[int] = deque()

    def add(
        self,
        cloud: HandCloud | None,
        t_host_ns: int,
        T_W_D: Float64 | None = None,
        missed_for: HandError | None = None,
    ) -> tuple[PlacedHand | None, str]:
        """Add the cloud of a new frame, None if it shows no hand, and place the clouds that can be.

        If the frame carries its camera's pose T_W_D (4, 4), no other is needed. `missed_for` says
        why it shows no hand.

        Returns
        -------
        tuple of (PlacedHand or None, str)
            The newest hand placed now, and the reason if none was.
        """
        self._seen_ns = t_host_ns
        self._frames_ns.append(t_host_ns)
        if cloud is not None:
            self._unplaced.append((cloud, t_host_ns, T_W_D))
        elif missed_for is not None:
            self._missed.append((t_host_ns, missed_for))
        self._forget_old()
        hand, problem = None, ""
        while self._unplaced:
            try:
                hand = self._place(*self._unplaced[0])
            except PosePendingError as error:
                problem = str(error)
                break
            except PoseError as error:
                problem = str(error)
            else:
                self._placed.append(hand)
            self._unplaced.popleft()
        return hand, problem

    def newest(self, max_age_s: float) -> PlacedHand | None:
        """Return the newest placed hand unless it is older than this at the newest frame."""
        if not self._placed or self._seen_ns - self._placed[-1].t_host_ns > 1e9 * max_age_s:
            return None
        return self._placed[-1]

    def steady(self) -> PlacedHand | None:
        """Return the newest hand if it is in view and has hardly moved for a while, else None."""
        if not self._placed or self._seen_ns - self._placed[-1].t_host_ns > self._steady_ns:
            return None
        since_ns = self._seen_ns - self._steady_ns
        before = [hand.middle_W_m for hand in self._placed if hand.t_host_ns <= since_ns]
        after = [hand.middle_W_m for hand in self._placed if hand.t_host_ns > since_ns]
        # Include the last hand before this period, so that a slow camera has enough of them.
        places = before[-1:] + after
        is_long_enough = bool(before and after)
        if is_long_enough and float(np.ptp(places, axis=0).max()) < self._steady_m:
            return self._placed[-1]
        return None

    def held_at(self, hand: PlacedHand) -> list[PlacedHand]:
        """Return the hands just before and at a hand, back to where it was elsewhere."""
        held = [hand]
        # In the order of exposure: a frame's time is estimated again when one arrives sooner.
        for one in sorted(self._placed, key=lambda placed: placed.t_host_ns, reverse=True):
            if one is hand or one.t_host_ns > hand.t_host_ns:
                continue
            is_near = float(np.linalg.norm(one.middle_W_m - hand.middle_W_m)) < _HOLD_M
            if not is_near or hand.t_host_ns - one.t_host_ns > self._steady_ns:
                break
            held.append(one)
        return held[::-1]

    def placed_until_ns(self) -> int:
        """Return the time up to which every hand seen has been placed."""
        if not self._unplaced:
            return self._seen_ns
        return self._placed[-1].t_host_ns if self._placed else 0

    def nearest(self, t_host_ns: int, tolerance_s: float) -> PlacedHand:
        """Return the hand nearest in time; HandError if none is within the tolerance.

        NoFrameError if there is no frame of that time either, and OutOfViewError if the camera saw
        only a part of the hand then.
        """
        near = [
            hand for hand in self._placed if abs(hand.t_host_ns - t_host_ns) <= 1e9 * tolerance_s
        ]
        if not near:
            missed = min(self._missed, key=lambda one: abs(one[0] - t_host_ns), default=(0, None))
            if isinstance(missed[1], OutOfViewError):
                raise OutOfViewError(str(missed[1]))  # the stored one must hold no traceback
            if all(abs(one_ns - t_host_ns) > 1e9 * tolerance_s for one_ns in self._frames_ns):
                raise NoFrameError("No camera image is of that moment: too few arrive")
            raise HandError("The camera did not see your hand")
        return min(near, key=lambda hand: abs(hand.t_host_ns - t_host_ns))

    def speed_m_s(self, hand: PlacedHand) -> float:
        """Return the hand's speed in the world at a placed hand; 0 if there is no other in time."""
        apart_s = [1e-9 * abs(one.t_host_ns - hand.t_host_ns) for one in self._placed]
        others = [
            (abs(s - _SPEED_S), s, one)
            for s, one in zip(apart_s, self._placed, strict=True)
            if 0.0 < s <= 3.0 * _SPEED_S
        ]
        if not others:
            return 0.0
        _, s, other = min(others, key=lambda one: one[0])
        return float(np.linalg.norm(other.middle_W_m - hand.middle_W_m)) / s

    def clear(self) -> None:
        """Forget all hands."""
        self._placed.clear()
        self._unplaced.clear()
        self._missed.clear()

    def _place(self, cloud: HandCloud, t_host_ns: int, told: Float64 | None) -> PlacedHand:
        T_W_D = self._pose_at_host_ns(t_host_ns) @ self._T_H_D if told is None else told
        points_W_m = transform(T_W_D, cloud.points_m)
        middle_W_m = np.median(points_W_m[::_MEDIAN_STRIDE], axis=0)
        return PlacedHand(
            cloud, t_host_ns, T_W_D, points_W_m, middle_W_m, is_posed_by_camera=told is not None
        )

    def _forget_old(self) -> None:
        """Forget hands that are too old both for a confirmation and for the steadiness check."""
        oldest_ns = self._seen_ns - self._keep_ns
        while self._placed and self._placed[0].t_host_ns < oldest_ns:
            self._placed.popleft()
        while self._unplaced and self._unplaced[0][1] < oldest_ns:
            self._unplaced.popleft()
        while self._missed and self._missed[0][0] < oldest_ns:
            self._missed.popleft()
        while self._frames_ns and self._frames_ns[0] < oldest_ns:
            self._frames_ns.popleft()
