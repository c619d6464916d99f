"""The delay of the camera's pictures, measured while the head moves.

The background stands still, so its movement in the picture must be the one that the headset's poses
predict for the time of the exposure: `measure_offset` finds the time at which both agree best, on
the clock on which the poses are known. A head that turns at a constant rate shows nothing, changes
of the rate do. With other cameras and an inertial sensor, see Rehder, Siegwart and Furgale, "A
general approach to spatiotemporal calibration in multisensor systems", IEEE T-RO 2016.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handcal.calibration.hands import PlacedHand
from handcal.camera.clock import INFORM_NS, FrameClock
from handcal.core.errors import PoseError, PosePendingError
from handcal.core.geometry import invert, transform
from handcal.core.types import Float32, Float64, Frame, UInt8

_WIDTH_PX = 320
"""Width of the pictures in which points are followed."""
_FAR_M = 0.9
"""Farther than a hand."""
_STRIDE_PX = 16
"""Between the depth pixels from which points are chosen."""
_CELLS = 8, 5
"""The point with most texture is followed in each cell of this grid."""
_FEWEST = 8
_TEXTURE = 1e-4
"""Smallest eigenvalue of the gradients' matrix, as OpenCV scales it."""
_WINDOW_PX, _BORDER_PX = 15, 8


@dataclass(slots=True, eq=False)
class Background:
    """Points of the background in a key frame, and their movement since."""

    gray: UInt8
    points_C_m: Float64
    """(N, 3); in the colour camera's frame."""
    start_px: Float32
    newest_px: Float32
    """(N, 2); in the small picture of the key frame, and of the newest frame that showed them."""
    focal_px: Float64
    """(2,); of the small picture."""
    T_C_D: Float64
    times_ns: list[int]
    """Camera times of the key frame and of those that followed."""
    moved: list[Float32]
    """each (N, 2); movement in units of the focal length, of those that followed; NaN where a
    point is lost."""


def make_background(frame: Frame) -> Background | None:
    """Return the background of a frame with colour; None if too little is far or has texture.

    Points whose depth is unknown are not used. Lens distortion is ignored: points move little.
    """
    assert frame.color is not None
    assert frame.color_intrinsics is not None
    gray = _small(frame.color)
    depth, color = frame.depth_intrinsics, frame.color_intrinsics
    z_m = frame.depth[::_STRIDE_PX, ::_STRIDE_PX] * np.float64(frame.depth_scale_m)
    rows, columns = np.nonzero(z_m > _FAR_M)
    z_m = z_m[rows, columns]
    x = (_STRIDE_PX * columns - depth.cx) / depth.fx
    y = (_STRIDE_PX * rows - depth.cy) / depth.fy
    points_C_m = transform(frame.T_C_D, np.column_stack([x * z_m, y * z_m, z_m]))
    scale = _WIDTH_PX / color.width
    focal_px = scale * np.array([color.fx, color.fy])
    center_px = scale * (np.array([color.cx, color.cy]) + 0.5) - 0.5
    pixels = points_C_m[:, :2] / points_C_m[:, 2:] * focal_px + center_px
    height, width = gray.shape
    limit_px = np.array([width, height]) - _BORDER_PX
    inside = ((pixels > _BORDER_PX) & (pixels < limit_px)).all(axis=1)
    points_C_m, pixels = points_C_m[inside], pixels[inside]
    u, v = np.rint(pixels).astype(int).T
    texture = cv2.cornerMinEigenVal(gray, 7)[v, u]
    cell = u * _CELLS[0] // width * _CELLS[1] + v * _CELLS[1] // height
    order = np.lexsort((texture, cell))
    is_last = np.append(np.diff(cell[order]) > 0, True)[: len(order)]
    best = order[is_last]
    best = best[texture[best] > _TEXTURE]
    if len(best) < _FEWEST:
        return None
    start_px = pixels[best].astype(np.float32)
    return Background(
        gray, points_C_m[best], start_px, start_px, focal_px, frame.T_C_D, [frame.t_camera_ns], []
    )


def follow(background: Background, frame: Frame) -> bool:
    """Add the points' movement in a frame with colour; return False if half of them are lost."""
    assert frame.color is not None
    pixels, found, _ = cv2.calcOpticalFlowPyrLK(
        background.gray,
        _small(frame.color),
        background.start_px[:, None],
        background.newest_px[:, None].copy(),
        winSize=(_WINDOW_PX, _WINDOW_PX),
        maxLevel=2,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    is_found = found[:, :1] > 0
    if is_found.sum() < max(_FEWEST, len(is_found) / 2):
        return False
    moved = np.where(is_found, pixels[:, 0] - background.start_px, np.nan)
    background.newest_px = np.where(is_found, pixels[:, 0], background.newest_px)
    background.times_ns.append(frame.t_camera_ns)
    background.moved.append((moved / background.focal_px).astype(np.float32))
    return True


def _small(color: UInt8) -> UInt8:
    every = max(1, color.shape[1] // (2 * _WIDTH_PX))
    green = np.ascontiguousarray(color[::every, ::every, 1])
    height = round(_WIDTH_PX * green.shape[0] / green.shape[1])
    return np.asarray(cv2.resize(green, (_WIDTH_PX, height), interpolation=cv2.INTER_AREA))


_USED_FRAMES = 60
"""Most frames of one key frame that are used for a measurement, evenly spread."""
FEWEST_FRAMES = 8
STEP_NS = 10_000_000
"""Step of the table of poses."""
_HALF = 8
_SMOOTH = np.convolve(np.ones(_HALF), np.ones(_HALF)) / _HALF**2
"""Weights of a mean over ± 80 ms, which lowers the noise of the poses. It is symmetric, so it moves
no time."""
REACH_NS = _HALF * STEP_NS
LARGEST_S = 0.3
_COARSE_S, _FINE_S = 0.02, 0.01
_FINE = 4
"""The cost is a parabola in the time, as far as this many fine steps."""
_LEAST_RATE_RAD_S = 0.012
"""Least change of the head's rate, rms. The noise of smoothed poses looks like 0.002 rad/s; where
it is not small beside the movement, σ would be too small."""
_STILL_RAD, _STILL_M = 0.0002, 0.0002
"""A head whose place varies less, rms, is in the same place at all times."""

_Int64 = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class MeasuredOffset:
    """The time of the exposures, as measured once."""

    offset_ns: int
    """Time on the host's clock minus time on the camera's."""
    sigma_s: float


def _movement(poses: Float64) -> Float64:
    """Return (N, 6): rotation vector from the first pose and position, smoothed."""
    turned = Rotation.from_matrix(poses[0, :3, :3].T @ poses[:, :3, :3]).as_rotvec()
    numbers = np.column_stack([turned, poses[:, :3, 3]])
    padded = np.pad(numbers, ((_HALF - 1, _HALF - 1), (0, 0)), mode="edge")
    return np.column_stack([np.convolve(column, _SMOOTH, mode="valid") for column in padded.T])


def is_still(poses: Float64) -> bool:
    """Return True for a head that is in the same place at all times; poses (N, 4, 4) are T_W_H."""
    if len(poses) < 4 * _HALF:
        return False
    spread = _movement(poses)[_HALF:-_HALF].std(axis=0)
    return bool((spread[:3] < _STILL_RAD).all() and (spread[3:] < _STILL_M).all())


def measure_offset(
    backgrounds: Iterable[Background],
    times_ns: _Int64,
    poses: Float64,
    T_H_D: Float64,
    earliest_ns: int,
) -> MeasuredOffset | None:
    """Return the time of the exposures at which movement and poses agree best.

    Parameters
    ----------
    backgrounds : iterable of Background
    times_ns : (N,) int64
        Times of the poses on the host's clock, evenly spaced except for gaps.
    poses : (N, 4, 4) float64
        T_W_H.
    T_H_D : (4, 4) float64
        From the depth camera to the headset.
    earliest_ns : int
        Largest possible offset, at which a frame would arrive with its exposure.

    Returns
    -------
    MeasuredOffset or None
        None if too little was seen. σ is from the residuals, with regard to their correlation.
    """
    if len(times_ns) < 2 * _HALF:
        return None
    table = _Table(times_ns, poses)
    used = [background for background in backgrounds if len(background.times_ns) > FEWEST_FRAMES]
    offsets_s = -np.arange(0.0, LARGEST_S + _COARSE_S, _COARSE_S)
    residuals = _residuals(used, table, T_H_D, earliest_ns, offsets_s)
    if residuals is None:
        return None
    nearest_s = offsets_s[np.square(residuals).sum(axis=(1, 2)).argmin()]
    steps_s = _FINE_S * np.arange(-_FINE, _FINE + 1.0)
    residuals = _residuals(used, table, T_H_D, earliest_ns, nearest_s + steps_s)
    if residuals is None:
        return None
    cost = np.square(residuals).sum(axis=(1, 2))
    a, b, c = np.polyfit(steps_s, cost, 2)
    freedom = residuals[0].size - 2 * len(used) - 1
    is_moved = a > residuals.shape[1] * _LEAST_RATE_RAD_S**2
    if not is_moved or abs(b / (2.0 * a)) > _FINE * _FINE_S or freedom < FEWEST_FRAMES:
        return None
    variance = max(float(c - b * b / (4.0 * a)), 1e-12) / freedom
    best = residuals[cost.argmin()]
    alike = np.clip((best[1:] * best[:-1]).sum() / np.square(best).sum(), 0.0, 0.9)
    sigma_s = float(np.sqrt(variance / a * (1.0 + alike) / (1.0 - alike)))
    return MeasuredOffset(earliest_ns + round(1e9 * (nearest_s - b / (2.0 * a))), sigma_s)


class _Table:
    """The head's smoothed movement, interpolated linearly: rotations as vectors from the first."""

    def __init__(self, times_ns: _Int64, poses: Float64) -> None:
        self.first_ns = int(times_ns[0])
        self._times_s = 1e-9 * (times_ns - times_ns[0])
        self._R_W_0 = poses[0, :3, :3]
        self._numbers = _movement(poses)

    def covers(self, times_s: Float64) -> NDArray[np.bool_]:
        """Return which times have poses on both sides."""
        reach_s = 1e-9 * REACH_NS
        return np.asarray(
            (times_s > self._times_s[0] + reach_s) & (times_s < self._times_s[-1] - reach_s)
        )

    def at(self, times_s: Float64) -> tuple[Float64, Float64]:
        """Return R_W_H (N, 3, 3) and the positions (N, 3)."""
        numbers = np.column_stack([np.interp(times_s, self._times_s, n) for n in self._numbers.T])
        R_W_H = self._R_W_0 @ Rotation.from_rotvec(numbers[:, :3]).as_matrix()
        return R_W_H, numbers[:, 3:]


def _residuals(
    backgrounds: list[Background],
    table: _Table,
    T_H_D: Float64,
    earliest_ns: int,
    offsets_s: Float64,
) -> Float64 | None:
    """Return (offsets, frames, 2): movement seen minus predicted, in units of the focal length.

    Each background's mean is removed: its key frame's pose has noise, too.
    """
    parts = []
    for background in backgrounds:
        every = -(-(len(background.times_ns) - 1) // _USED_FRAMES)
        index = np.arange(1, len(background.times_ns), every)
        times_s = 1e-9 * (np.array(background.times_ns)[[0, *index]] + earliest_ns - table.first_ns)
        moved = np.array([background.moved[i - 1] for i in index], dtype=np.float64)
        # At all offsets alike, so that their costs can be compared.
        is_known = table.covers(times_s) & table.covers(times_s + offsets_s.min())
        if not is_known[0] or is_known.sum() < FEWEST_FRAMES // 2:
            continue
        moved, times_s = moved[is_known[1:]], times_s[is_known]
        part = np.array(
            [_apart(background, table, T_H_D, times_s + offset, moved) for offset in offsets_s]
        )
        parts.append(part - part.mean(axis=1, keepdims=True))
    return np.concatenate(parts, axis=1) if parts else None


def _apart(
    background: Background, table: _Table, T_H_D: Float64, times_s: Float64, moved: Float64
) -> Float64:
    """Return (frames, 2): the points' mean movement, measured minus predicted."""
    R_W_H, t_W_m = table.at(times_s)
    T_H_C = T_H_D @ invert(background.T_C_D)
    R_W_C = R_W_H @ T_H_C[:3, :3]
    t_W_m = t_W_m + R_W_H @ T_H_C[:3, 3]
    points_W_m = background.points_C_m @ R_W_C[0].T + t_W_m[0]
    points_C_m = (points_W_m - t_W_m[1:, None]) @ R_W_C[1:]
    start = background.points_C_m[:, :2] / background.points_C_m[:, 2:]
    apart = moved - (points_C_m[..., :2] / points_C_m[..., 2:] - start)
    # A point that is hidden by the hand moves with it.
    off = np.linalg.norm(apart - _median(apart), axis=2)
    apart[~(off <= 2.5 * _median(off))] = np.nan
    return np.asarray(np.nanmean(apart, axis=1))


def _median(values: Float64) -> Float64:
    """Return the median along the second axis, which is kept; NaN are left out.

    Several times faster than `numpy.nanmedian`, which makes masked arrays.
    """
    ordered = np.sort(values, axis=1)  # NaN come last
    count = np.count_nonzero(~np.isnan(ordered), axis=1, keepdims=True)
    low = np.take_along_axis(ordered, (count - 1) // 2, axis=1)
    return np.asarray(0.5 * (low + np.take_along_axis(ordered, count // 2, axis=1)))


_KEY_NS = 5_000_000_000
"""A key frame serves for this time, or longer on a busy computer, until it has enough frames."""
_KEPT_FRAMES = 450
_EVERY_NS, _EVERY_KNOWN_NS = 400_000_000, 5_000_000_000
"""Time between two measurements."""
_EVERY_FRAME_KNOWN = 3
_LONGEST_NS = 2_000_000_000
"""A frame that arrives later than this, or before its exposure, is of another clock."""
_CARRY_NS = 50_000_000
_PLAIN_NS = 10_000_000_000
"""A background that could not be followed for this time is taken to have too little texture."""


ASSUMED_LATENCY_S, ASSUMED_SIGMA_S = 0.03, 0.03
"""Shortest time from a frame's exposure to its arrival, until it is measured, and its standard
deviation."""
_KNOWN_SIGMA_S = 0.008
"""The delay is known if its standard deviation is at most this."""
_LIMIT_S, _LIMIT_FRAMES, _SLOW_S = 0.12, 0.15, 0.3
"""Largest time from the exposure to the earliest arrival: the first, and a share of the time
between two frames, of which at most the last counts. A busy computer, with few frames per second,
is late by such a share."""
MOVED_LIMIT_M = 0.0015
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
    """

    def __init__(
        self,
        clock: FrameClock,
        pose_at_host_ns: Callable[[int], Float64],
        T_H_D: Float64,
    ) -> None:
        self._clock = clock
        self._pose_at_host_ns = pose_at_host_ns
        self._T_H_D = T_H_D
        self._backgrounds: deque[Background] = deque()
        self._poses: deque[tuple[int, Float64]] = deque()
        self._next_pose_ns = self._next_ns = self._newest_ns = self._frames = 0
        self._looked_ns = -INFORM_NS
        self._followed_ns: int | None = None
        self._is_still = False
        self._sigma_s = ASSUMED_SIGMA_S

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
        return _LIMIT_S + _LIMIT_FRAMES * period_s

    def see(self, frame: Frame) -> bool:
        """Look at a frame that the clock knows; return True if the delay has just become known."""
        if frame.color is None:
            return False
        if self._is_of_another_clock(frame):
            self._forget()
        self._newest_ns = frame.t_camera_ns
        if frame.t_camera_ns - self._looked_ns < INFORM_NS:
            return False
        was_known = self._clock.measured_ns is not None
        self._look(frame)
        if frame.t_host_ns >= self._next_ns:
            self._measure(frame.t_host_ns)
        return not was_known and self._clock.measured_ns is not None

    def _is_of_another_clock(self, frame: Frame) -> bool:
        """Return whether a frame comes before the last, or not soon after its exposure."""
        measured_ns = self._clock.measured_ns
        late_ns = 0 if measured_ns is None else frame.t_host_ns - frame.t_camera_ns - measured_ns
        return not 0 <= late_ns < _LONGEST_NS or frame.t_camera_ns < self._newest_ns

    def _forget(self) -> None:
        """Measure from the start: the camera was replaced, or opened again."""
        self._backgrounds.clear()
        self._clock.measured_ns = None
        self._sigma_s = ASSUMED_SIGMA_S
        self._next_ns, self._is_still, self._followed_ns = 0, False, None
        self._looked_ns = -INFORM_NS

    def _look(self, frame: Frame) -> None:
        """Follow the background, and keep the poses of the time."""
        self._looked_ns = frame.t_camera_ns
        if self._followed_ns is None:
            self._followed_ns = frame.t_camera_ns
        self._frames += 1
        if self._clock.measured_ns is None or self._frames % _EVERY_FRAME_KNOWN == 0:
            self._follow(frame)
        self._read_poses()  # those of 5 s at once would take longer than the time between frames

    def _measure(self, now_ns: int) -> None:
        """Measure the delay from what was followed; plan the next measurement."""
        is_known = self._clock.measured_ns is not None
        self._next_ns = now_ns + (_EVERY_KNOWN_NS if is_known else _EVERY_NS)
        times_ns = np.array([t_ns for t_ns, _ in self._poses], dtype=np.int64)
        poses = np.array([T for _, T in self._poses]).reshape(-1, 4, 4)
        self._is_still = is_still(poses)
        if self._is_still:  # its movement would show nothing, after 30 ms of searching
            return
        offset = measure_offset(
            self._backgrounds, times_ns, poses, self._T_H_D, self._clock.earliest_ns
        )
        if offset is not None and offset.sigma_s <= _KNOWN_SIGMA_S:
            self._clock.measured_ns = offset.offset_ns
            self._sigma_s = offset.sigma_s
            self._next_ns = now_ns + _EVERY_KNOWN_NS

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
