"""The place of a headset's camera and the times of its poses, measured while the head turns.

Poses of a headset's own camera and of its app are in the same world, so the camera's place on the
rig is the same however the head moves. A hand at rest stays where it is in the world. Both hold
only at the right offset between the times, which is looked for.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.camera.camera import Camera
from handcal.core.errors import (
    CameraError,
    CameraTimeoutError,
    HandcalError,
    HandError,
    PoseError,
)
from handcal.core.frozen import freeze
from handcal.core.geometry import invert, rigid, transform
from handcal.core.progress import Progress
from handcal.core.types import LOOK_AROUND, Float64, Frame
from handcal.hand.settings import SegmentSettings
from handcal.hand.shipped import make_finder
from handcal.link.server import HeadsetServer

CAMERA_UNCERTAINTY_S = 0.015
"""Error of the camera's assumed latency, from exposure to arrival."""
STAMP_ADVICE = (
    "stamp each pose with the time that it is for: of a predicted pose, that of display; if the "
    "stamps are right, the camera's latency is not the assumed one"
)
_CAMERA_OFFSETS_S = np.asarray(0.01 * np.arange(-30, 31), np.float64)
_STAMP_STEP_S = 0.004
_STAMP_OFFSETS_S = np.asarray(_STAMP_STEP_S * np.arange(-30, 31), np.float64)
_LEAST_SEEN = 30
_LEAST_TURN_RAD = np.radians(10.0)
_REACH_M = 0.5
"""Distance of a hand, at which a turn of the head is measured."""
_MOST_SPREAD_M = 0.015
_MOST_SIGMA_S = 0.006
_POLL_S = 0.05
_ENDED_S = 1.0
"""Poses of the last frames arrive after them."""

Seen = TypeVar("Seen")
PoseAt = Callable[[int], Float64]
"""Returns T_W_H (4, 4) at a host time (ns), or raises PosePendingError or PoseError."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraPose:
    """The pose of a headset's camera on its rig."""

    T_H_D: Float64
    """(4, 4)."""
    spread_m: float
    """RMS difference of single frames at the distance of a hand."""
    offset_s: float
    """Time added to that of the camera's frames, at which both agree best."""

    def __post_init__(self) -> None:
        freeze(self, "T_H_D", np.float64, 4, 4)


@dataclass(frozen=True, slots=True)
class PoseDelay:
    """Time by which poses are for a later moment than their stamps say."""

    delay_s: float
    """Positive: the poses are for later. An error of the camera's assumed latency enters too."""
    sigma_s: float

    @property
    def is_wrong(self) -> bool:
        """True if the stamps are certainly off by more than the camera's latency is uncertain."""
        return abs(self.delay_s) - 2.0 * self.sigma_s > CAMERA_UNCERTAINTY_S

    def __str__(self) -> str:
        way = "later" if self.delay_s > 0 else "earlier"
        ms, sigma_ms = 1e3 * abs(self.delay_s), 1e3 * self.sigma_s
        return f"poses are for {ms:.0f} ± {sigma_ms:.0f} ms {way} than their stamps say"


def find_camera_pose(seen: Sequence[tuple[int, Float64]], pose_at_host_ns: PoseAt) -> CameraPose:
    """Return the pose of a camera on the rig.

    Parameters
    ----------
    seen : sequence of (t_host_ns, (4, 4) float64)
        Time of exposure and T_W_D, as the camera reports it.
    pose_at_host_ns : callable

    Raises
    ------
    HandcalError
        If the head was not turned enough, or both poses are not in the same world.
    """
    placed = [
        [invert(T_W_H) @ T_W_D for T_W_H in poses]
        for T_W_D, poses in _posed(seen, pose_at_host_ns, _CAMERA_OFFSETS_S)
    ]
    turned = Rotation.from_matrix([T_W_D[:3, :3] for _, T_W_D in seen] or [np.eye(3)])
    turn_rad = float((turned[0].inv() * turned).magnitude().max())
    if len(placed) < _LEAST_SEEN or turn_rad < _LEAST_TURN_RAD:
        raise HandcalError(
            f"the camera's pose was not found ({len(placed)} frames, head turned by "
            f"{np.degrees(turn_rad):.0f}°)",
            "turn the head slowly left and right, about 20° each way",
        )
    means = [_mean_pose(np.array(column)) for column in zip(*placed, strict=True)]
    best = int(np.argmin([spread_m for _, spread_m in means]))
    T_H_D, spread_m = means[best]
    if spread_m > _MOST_SPREAD_M:
        raise HandcalError(
            f"by the app's poses, the camera moves by {1e3 * spread_m:.0f} mm on the rig",
            "let the app use the world of hl2ss",
        )
    return CameraPose(T_H_D, spread_m, float(_CAMERA_OFFSETS_S[best]))


def find_pose_delay(
    seen: Sequence[tuple[int, Float64]], pose_at_host_ns: PoseAt, T_H_D: Float64
) -> PoseDelay | None:
    """Return the error of the poses' stamps, from a hand at rest that a turning head sees.

    With the right stamps the hand stays where it is in the world. The delay is that with which it
    moves least, and its σ follows from the curvature there.

    Parameters
    ----------
    seen : sequence of (t_host_ns, (3,) float64)
        Time of exposure and the hand's place in D, m.
    pose_at_host_ns : callable
    T_H_D : (4, 4) float64

    Returns
    -------
    PoseDelay or None
        None if the head has not turned enough, or the hand has not been seen often enough.
    """
    places_m = np.array(
        [
            [transform(T_W_H @ T_H_D, place_D_m[None])[0] for T_W_H in poses]
            for place_D_m, poses in _posed(seen, pose_at_host_ns, _STAMP_OFFSETS_S)
        ]
    )
    if len(places_m) < _LEAST_SEEN:
        return None
    spread_m2 = ((places_m - places_m.mean(axis=0)) ** 2).sum(axis=(0, 2))
    best = int(np.argmin(spread_m2[1:-1])) + 1
    below, least, above = spread_m2[best - 1 : best + 2]
    curvature = (below - 2.0 * least + above) / _STAMP_STEP_S**2
    if curvature <= 0.0 or best in (1, len(_STAMP_OFFSETS_S) - 2):
        return None
    offset_s = float(_STAMP_OFFSETS_S[best] - (above - below) / (2.0 * _STAMP_STEP_S * curvature))
    variance_m2 = float(least) / (3.0 * (len(places_m) - 1))
    sigma_s = float(np.sqrt(2.0 * variance_m2 / curvature))
    return PoseDelay(-offset_s, sigma_s) if sigma_s < _MOST_SIGMA_S else None


def run_camera_pose(
    server: HeadsetServer, camera: Camera, duration_s: float = 8.0, progress: Progress = Progress()
) -> CameraPose:
    """Measure the pose of a headset's own camera; the wearer looks around.

    Parameters
    ----------
    server : HeadsetServer
        With a connected headset.
    camera : Camera
        Its frames carry its pose.
    duration_s : float
    progress : Progress

    Raises
    ------
    CameraError
        If the camera fails, or does not report its pose.
    HandcalError
        As `find_camera_pose`.
    CancelledError
        If it was cancelled.
    """

    def told(frame: Frame) -> Float64:
        if frame.T_W_D is None:
            raise CameraError(f"{camera.name} does not report its pose")
        return frame.T_W_D

    server.send_prompt(LOOK_AROUND)
    try:
        says = "Look slowly left and right"
        frames = _watch(camera, duration_s, _ENDED_S, told, progress, says)
    finally:
        server.send_prompt("")
    return find_camera_pose(_at_exposure(frames, 0), server.pose_at_host_ns)


def run_pose_delay(
    server: HeadsetServer,
    camera: Camera,
    T_H_D: Float64,
    latency_s: float,
    duration_s: float = 8.0,
    progress: Progress = Progress(),
) -> PoseDelay:
    """Measure the error of a connected headset's pose stamps; the wearer turns the head.

    Parameters
    ----------
    server : HeadsetServer
        With a connected headset.
    camera : Camera
        The rig's depth camera.
    T_H_D : (4, 4) float64
    latency_s : float
        From a frame's exposure to its earliest arrival, as in a calibration.
    duration_s : float
    progress : Progress

    Raises
    ------
    CameraError
        If the camera fails.
    HandcalError
        If the head was not turned enough, or the hand was not seen.
    CancelledError
        If it was cancelled.
    """
    finder = make_finder(SegmentSettings())

    def hand_D_m(frame: Frame) -> Float64:
        points_m = np.asarray(finder.find(frame).points_m, np.float64)
        return np.asarray(np.median(points_m, axis=0))

    server.send_prompt("Hold your hand still. Turn your head left and right.")
    try:
        says = "Turn the head, and hold the hand still"
        frames = _watch(camera, duration_s, 0.0, hand_D_m, progress, says)
    finally:
        server.send_prompt("")
    seen = _at_exposure(frames, round(1e9 * latency_s))
    delay = find_pose_delay(seen, server.pose_at_host_ns, T_H_D)
    if delay is None:
        raise HandcalError(
            f"the pose stamps could not be checked ({len(seen)} hands seen)",
            "hold the hand still in view of the camera, and turn the head left and right about "
            "once a second",
        )
    return delay


def _watch(
    camera: Camera,
    duration_s: float,
    extra_s: float,
    look: Callable[[Frame], Float64],
    progress: Progress,
    says: str,
) -> list[tuple[int, int, Float64]]:
    """Return what is seen in each frame for a while, with its time and its arrival.

    Frames in which there is no hand are left out, and those of the time after it.
    """
    frames = []
    start_s = time.monotonic()
    while (passed_s := time.monotonic() - start_s) < duration_s + extra_s:
        progress.at(passed_s / (duration_s + extra_s), says)
        try:
            frame = camera.read(_POLL_S)
            found = frame.t_camera_ns, frame.t_host_ns, look(frame)
        except (CameraTimeoutError, HandError):
            continue
        if passed_s < duration_s:
            frames.append(found)
    return frames


def _at_exposure(
    frames: Sequence[tuple[int, int, Float64]], latency_ns: int
) -> list[tuple[int, Float64]]:
    """Return what was seen with the host's time of the exposure.

    As `FrameClock`, but with the shortest delay of all frames for each.
    """
    delays_ns = [arrived_ns - exposed_ns for exposed_ns, arrived_ns, _ in frames]
    offset_ns = min(delays_ns, default=0) - latency_ns
    return [(exposed_ns + offset_ns, value) for exposed_ns, _, value in frames]


def _posed(
    seen: Sequence[tuple[int, Seen]], pose_at_host_ns: PoseAt, offsets_s: Float64
) -> list[tuple[Seen, list[Float64]]]:
    """Return what was seen with the head's poses at each offset, where all are known."""
    found = []
    for t_host_ns, value in seen:
        try:
            times_ns = [t_host_ns + round(1e9 * offset_s) for offset_s in offsets_s]
            found.append((value, [pose_at_host_ns(t_ns) for t_ns in times_ns]))
        except PoseError:  # also one that is pending
            continue
    return found


def _mean_pose(poses: Float64) -> tuple[Float64, float]:
    """Return the mean of poses (N, 4, 4), and their RMS difference from it."""
    mean = Rotation.from_matrix(poses[:, :3, :3]).mean()
    middle_m = poses[:, :3, 3].mean(axis=0)
    turns_rad = (mean.inv() * Rotation.from_matrix(poses[:, :3, :3])).magnitude()
    squares_m2 = np.square(poses[:, :3, 3] - middle_m).sum(axis=1) + np.square(_REACH_M * turns_rad)
    return rigid(mean.as_matrix(), middle_m), float(np.sqrt(squares_m2.mean()))
