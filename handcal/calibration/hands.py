"""The hands seen recently, placed in the world by the headset's pose at their exposure."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np
from scipy.spatial import cKDTree

from handcal.core.errors import (
    HandError,
    NoFrameError,
    OutOfViewError,
    PoseError,
    PosePendingError,
)
from handcal.core.geometry import invert, rotation_vector, transform
from handcal.core.types import Float64, HandCloud
from handcal.register.rigid import RigidSettings, motion_covariance, register_rigid
from handcal.register.surface import Surface, describe_surface, mean_point

MATCH_NS = 150_000_000
"""Largest time between a confirmation and the frame that is taken for it."""
_STEADY_NS, _STEADY_M = 400_000_000, 0.005
"""A hand is steady if it moved less than this, for this time."""
_KEPT_NS = _STEADY_NS + 1_000_000_000
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
    """

    def __init__(self, pose_at_host_ns: Callable[[int], Float64], T_H_D: Float64) -> None:
        self._pose_at_host_ns = pose_at_host_ns
        self._T_H_D = T_H_D
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

    def newest(self) -> PlacedHand | None:
        """Return the newest placed hand unless it is too old for a confirmation."""
        if not self._placed or self._seen_ns - self._placed[-1].t_host_ns > MATCH_NS:
            return None
        return self._placed[-1]

    def steady(self) -> PlacedHand | None:
        """Return the newest hand if it is in view and has hardly moved for a while, else None."""
        if not self._placed or self._seen_ns - self._placed[-1].t_host_ns > _STEADY_NS:
            return None
        since_ns = self._seen_ns - _STEADY_NS
        before = [hand.middle_W_m for hand in self._placed if hand.t_host_ns <= since_ns]
        after = [hand.middle_W_m for hand in self._placed if hand.t_host_ns > since_ns]
        # Include the last hand before this period, so that a slow camera has enough of them.
        places = before[-1:] + after
        is_long_enough = bool(before and after)
        if is_long_enough and float(np.ptp(places, axis=0).max()) < _STEADY_M:
            return self._placed[-1]
        return None

    def held_at(self, hand: PlacedHand) -> list[PlacedHand]:
        """Return the hands just before and at a hand, back to where it was elsewhere."""
        held = [hand]
        # In the order of exposure: a frame's time is estimated again when one arrives sooner.
        for earlier in sorted(self._placed, key=lambda placed: placed.t_host_ns, reverse=True):
            if earlier is hand or earlier.t_host_ns > hand.t_host_ns:
                continue
            is_near = float(np.linalg.norm(earlier.middle_W_m - hand.middle_W_m)) < _HOLD_M
            if not is_near or hand.t_host_ns - earlier.t_host_ns > _STEADY_NS:
                break
            held.append(earlier)
        return held[::-1]

    def placed_until_ns(self) -> int:
        """Return the time up to which every hand seen has been placed."""
        if not self._unplaced:
            return self._seen_ns
        return self._placed[-1].t_host_ns if self._placed else 0

    def nearest(self, t_host_ns: int) -> PlacedHand:
        """Return the hand nearest in time; HandError if none is within `MATCH_NS`.

        NoFrameError if there is no frame of that time either, and OutOfViewError if the camera saw
        only a part of the hand then.
        """
        near = [hand for hand in self._placed if abs(hand.t_host_ns - t_host_ns) <= MATCH_NS]
        if not near:
            missed = min(self._missed, key=lambda miss: abs(miss[0] - t_host_ns), default=(0, None))
            if isinstance(missed[1], OutOfViewError):
                raise OutOfViewError(*missed[1].args)  # the stored one must hold no traceback
            if all(abs(frame_ns - t_host_ns) > MATCH_NS for frame_ns in self._frames_ns):
                raise NoFrameError("No camera image is of that moment: too few arrive")
            raise HandError("The camera did not see your hand")
        return min(near, key=lambda hand: abs(hand.t_host_ns - t_host_ns))

    def speed_m_s(self, hand: PlacedHand) -> float:
        """Return the hand's speed in the world at a placed hand; 0 if there is no other in time."""
        apart_s = [1e-9 * abs(placed.t_host_ns - hand.t_host_ns) for placed in self._placed]
        others = [
            (abs(s - _SPEED_S), s, placed)
            for s, placed in zip(apart_s, self._placed, strict=True)
            if 0.0 < s <= 3.0 * _SPEED_S
        ]
        if not others:
            return 0.0
        _, s, other = min(others, key=itemgetter(0))
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
        oldest_ns = self._seen_ns - _KEPT_NS
        while self._placed and self._placed[0].t_host_ns < oldest_ns:
            self._placed.popleft()
        while self._unplaced and self._unplaced[0][1] < oldest_ns:
            self._unplaced.popleft()
        while self._missed and self._missed[0][0] < oldest_ns:
            self._missed.popleft()
        while self._frames_ns and self._frames_ns[0] < oldest_ns:
            self._frames_ns.popleft()


# More frames take longer than the time between two frames, and lower the noise little.
_MOST_FRAMES = 7
# Another frame sees the surface at a point if it has one within this many point spacings.
_REACH = 1.5
# The surface is where at least this share of the frames sees it.
_SEEN = 0.5
# A hand is where it was unless noise explains the movement found with less than 0.1 %: the quantile
# of χ² with six degrees of freedom.
_MOVED = 22.5
_SETTINGS = RigidSettings(max_points=700, tolerance_m=5e-5)


def merge_hold(hands: Sequence[PlacedHand], reference: PlacedHand) -> PlacedHand:
    """Return the median surface of the frames with the hand in one place, and the movement of all.

    Each point of the reference stays on its ray, at the median of the depths that the frames
    measure there, unless fewer than half of them see anything: then it is a flying pixel.

    Parameters
    ----------
    hands : sequence of PlacedHand
    reference : PlacedHand
        One of them; time, pose, contour and mask are its own.
    """
    middles = np.array([hand.middle_W_m for hand in hands])
    movement_m = float(np.linalg.norm(np.ptp(middles, axis=0)))
    others = [hand for hand in hands if hand is not reference]
    others = others[:: max(1, -(-len(others) // (_MOST_FRAMES - 1)))]
    others = _in_one_place(others, reference)
    if not others:
        return replace(reference, movement_m=movement_m)
    T_D_W = invert(reference.T_W_D)
    points_m = transform(T_D_W, reference.points_W_m)
    rays = points_m[:, :2] / points_m[:, 2:]
    apart, _ = cKDTree(rays).query(rays, k=2)
    reach = _REACH * float(np.median(np.asarray(apart)[:, 1]))
    depths_m = np.full((1 + len(others), len(points_m)), np.nan)
    is_cut = np.zeros_like(depths_m, dtype=np.bool_)
    depths_m[0], is_cut[0] = points_m[:, 2], reference.cloud.is_cut
    for row, hand in enumerate(others, start=1):
        surface_m = transform(T_D_W, hand.points_W_m)
        nearest = cKDTree(surface_m[:, :2] / surface_m[:, 2:]).query(
            rays, distance_upper_bound=reach
        )
        is_seen, index = np.isfinite(nearest[0]), np.asarray(nearest[1])
        depths_m[row, is_seen] = surface_m[index[is_seen], 2]
        is_cut[row, is_seen] = hand.cloud.is_cut[index[is_seen]]
    measured = np.isfinite(depths_m)
    kept = measured.mean(axis=0) >= _SEEN
    median_m = np.nanmedian(depths_m[:, kept], axis=0)
    merged_m = points_m[kept] * (median_m / points_m[kept, 2])[:, None]
    colors = reference.cloud.colors
    cloud = replace(
        reference.cloud,
        points_m=merged_m.astype(np.float32),
        is_cut=(is_cut.sum(axis=0) >= _SEEN * measured.sum(axis=0))[kept],
        colors=None if colors is None else colors[kept],
    )
    return replace(
        reference,
        cloud=cloud,
        points_W_m=transform(reference.T_W_D, merged_m),
        frames=1 + len(others),
        movement_m=movement_m,
    )


def _in_one_place(hands: Sequence[PlacedHand], reference: PlacedHand) -> list[PlacedHand]:
    """Return the hands that are where the reference is, except for noise.

    None if almost all points of one lie at cut edges.
    """
    try:
        place, *surfaces = [
            describe_surface(hand.points_W_m, hand.cloud.is_cut, _SETTINGS.max_points)
            for hand in (reference, *hands)
        ]
    except HandError:
        return []
    return [hand for hand, surface in zip(hands, surfaces, strict=True) if _is_at(surface, place)]


def _is_at(surface: Surface, place: Surface) -> bool:
    """Return True if noise explains the movement from one surface to the other."""
    fit = register_rigid(surface, place, _SETTINGS, np.eye(4))
    T = fit.T_target_source
    middle_m = mean_point(surface.points_m)
    moved_m = transform(T, middle_m[None])[0] - middle_m
    moved = np.concatenate([rotation_vector(T[:3, :3]), moved_m])
    noise = motion_covariance(fit.rows, surface, T)
    return float(moved @ np.linalg.solve(noise, moved)) < _MOVED
