"""Measure where a headset's own camera is on the rig of its app, from both their poses.

Both poses are in the same world. The transform between them is constant at the right time
offset between the two clocks, however the head moves.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.camera.camera import Camera
from handcal.core.errors import CameraError, CameraTimeoutError, HandcalError, PoseError
from handcal.core.frozen import freeze
from handcal.core.geometry import invert, rigid
from handcal.core.progress import Progress
from handcal.core.types import LOOK_AROUND, Float64
from handcal.link.server import HeadsetServer

_MOST_S, _STEP_S = 0.3, 0.01
_LEAST_SEEN = 30
_LEAST_TURN_RAD = np.radians(10.0)
_REACH_M = 0.5
"""Distance of a hand, at which a turn of the head is measured."""
_MOST_SPREAD_M = 0.015
_POLL_S = 0.05
_ENDED_S = 1.0
"""Poses of the last frames arrive after them."""


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


def find_camera_pose(
    seen: Sequence[tuple[int, Float64]], pose_at_host_ns: Callable[[int], Float64]
) -> CameraPose:
    """Return the pose of a camera on the rig.

    Parameters
    ----------
    seen : sequence of (t_host_ns, (4, 4) float64)
        Time of exposure and T_W_D, as the camera reports it.
    pose_at_host_ns : callable
        Returns T_W_H (4, 4), or raises PoseError.

    Raises
    ------
    HandcalError
        If the head was not turned enough, or both poses are not in the same world.
    """
    steps = round(_MOST_S / _STEP_S)
    offsets_s = _STEP_S * np.arange(-steps, steps + 1)
    found = []
    for t_ns, T_W_D in seen:
        try:
            poses = [pose_at_host_ns(t_ns + round(1e9 * offset_s)) for offset_s in offsets_s]
        except PoseError:
            continue
        found.append([invert(T_W_H) @ T_W_D for T_W_H in poses])
    turned = Rotation.from_matrix([T_W_D[:3, :3] for _, T_W_D in seen] or [np.eye(3)])
    turn_rad = float((turned[0].inv() * turned).magnitude().max())
    if len(found) < _LEAST_SEEN or turn_rad < _LEAST_TURN_RAD:
        raise HandcalError(
            f"the camera's pose was not found ({len(found)} frames, head turned by "
            f"{np.degrees(turn_rad):.0f}°)",
            "turn the head slowly left and right, about 20° each way",
        )
    means = [_mean_pose(np.array(column)) for column in zip(*found, strict=True)]
    best = int(np.argmin([spread_m for _, spread_m in means]))
    T_H_D, spread_m = means[best]
    if spread_m > _MOST_SPREAD_M:
        raise HandcalError(
            f"by the app's poses, the camera moves by {1e3 * spread_m:.0f} mm on the rig",
            "let the app use the world of hl2ss",
        )
    return CameraPose(T_H_D, spread_m, float(offsets_s[best]))


def _mean_pose(poses: Float64) -> tuple[Float64, float]:
    """Return the mean of poses (N, 4, 4), and their RMS difference from it."""
    mean = Rotation.from_matrix(poses[:, :3, :3]).mean()
    middle_m = poses[:, :3, 3].mean(axis=0)
    turns_rad = (mean.inv() * Rotation.from_matrix(poses[:, :3, :3])).magnitude()
    squares_m2 = np.square(poses[:, :3, 3] - middle_m).sum(axis=1) + np.square(_REACH_M * turns_rad)
    return rigid(mean.as_matrix(), middle_m), float(np.sqrt(squares_m2.mean()))


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
    server.send_prompt(LOOK_AROUND)
    frames: list[tuple[int, int, Float64]] = []
    start_s = time.monotonic()
    try:
        while (passed_s := time.monotonic() - start_s) < duration_s + _ENDED_S:
            progress.at(passed_s / (duration_s + _ENDED_S), "Look slowly left and right")
            try:
                frame = camera.read(_POLL_S)
            except CameraTimeoutError:
                continue
            if frame.T_W_D is None:
                raise CameraError(f"{camera.name} does not report its pose")
            if passed_s < duration_s:
                frames.append((frame.t_camera_ns, frame.t_host_ns, frame.T_W_D))
    finally:
        server.send_prompt("")
    offset_ns = min((arrived_ns - exposed_ns for exposed_ns, arrived_ns, _ in frames), default=0)
    seen = [(exposed_ns + offset_ns, T_W_D) for exposed_ns, _, T_W_D in frames]
    return find_camera_pose(seen, server.pose_at_host_ns)
