"""The ArUco cube as seen by the depth camera's colour stream, drawn fixed in the world."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from handcal.camera.camera import Camera
from handcal.camera.clock import FrameClock
from handcal.errors import (
    CameraEndError,
    CameraError,
    CameraTimeoutError,
    PoseError,
    PosePendingError,
)
from handcal.geometry import invert, transform
from handcal.link.server import HeadsetServer
from handcal.link.shapes import Shape
from handcal.progress import Progress
from handcal.rig.cube import Cube, CubeError, cube_pose, find_cube
from handcal.rig.cube_track import CubeFilter, CubeTrackSettings, TrackedCube, cube_corners_m
from handcal.station.procedure import CalibrationSettings
from handcal.types import EYES, Float64, Frame, UInt8

_WAITING = 30  # frames whose head pose has not arrived
_RESEND_M = 0.0003


class CubeTracker:
    """Tracks the cube in the frames of the depth camera.

    Parameters
    ----------
    camera : Camera
        With colour.
    cube : Cube
    T_H_D : (4, 4) float64
    pose_at_host_ns : callable
        Returns T_W_H (4, 4) at a time of the host's clock; raises PosePendingError or PoseError.
    settings : CubeTrackSettings, optional

    Attributes
    ----------
    problem : str
        Reason why the cube was not seen in the newest frame; empty if it was.
    """

    def __init__(
        self,
        camera: Camera,
        cube: Cube,
        T_H_D: Float64,
        pose_at_host_ns: Callable[[int], Float64],
        settings: CubeTrackSettings | None = None,
    ) -> None:
        self.cube = cube
        self.problem = ""
        self._camera = camera
        self._T_H_D = T_H_D
        self._pose_at_host_ns = pose_at_host_ns
        self._filter = CubeFilter(settings)
        self._clock = FrameClock(CalibrationSettings().camera_latency_s)
        self._waiting: deque[tuple[int, int, Float64]] = deque(maxlen=_WAITING)

    def step(self) -> TrackedCube | None:
        """Read a frame; return the newest filtered pose, or None if there is no new one.

        Raises
        ------
        CameraEndError
            If a recording has ended.
        CameraError
            If the camera fails, or has no colour.
        """
        try:
            frame = self._camera.read(1.0)
        except CameraTimeoutError as error:
            self.problem = str(error)
            return None
        t_host_ns = self._clock.exposure_ns(frame)
        try:
            T_H_T = self._T_H_D @ see_cube(frame, self.cube)
            self._waiting.append((frame.t_camera_ns, t_host_ns, T_H_T))
            self.problem = ""
        except CubeError as error:
            self.problem = str(error)
        return self._place()

    def _place(self) -> TrackedCube | None:
        """Place the cube in the world at each time for which the head's pose is known."""
        newest = None
        while self._waiting:
            t_camera_ns, t_host_ns, T_H_T = self._waiting[0]
            try:
                T_W_H = self._pose_at_host_ns(t_host_ns)
            except PosePendingError:
                break
            except PoseError as error:
                self.problem = str(error)
            else:
                newest = self._filter.take(T_W_H @ T_H_T, t_camera_ns)
            self._waiting.popleft()
        return newest


def see_cube(frame: Frame, cube: Cube) -> Float64:
    """Return ``T_D_T`` (4, 4), the cube's pose in the depth camera, from the frame's colour.

    Raises
    ------
    CubeError
        If it is not found.
    CameraError
        If the frame has no colour.
    """
    if frame.color is None or frame.color_intrinsics is None:
        raise CameraError("the depth camera gives no colour; the cube is tracked in colour")
    gray: UInt8 = np.asarray(cv2.cvtColor(frame.color, cv2.COLOR_RGB2GRAY), np.uint8)
    T_C_T = cube_pose(find_cube(gray, cube), cube, frame.color_intrinsics)
    return invert(frame.T_C_D) @ T_C_T


@dataclass(frozen=True, slots=True, eq=False)
class CubeTracking:
    """Result of tracking a cube for some time."""

    frames: int
    """Frames read."""
    tracked: tuple[TrackedCube, ...]
    """A filtered pose for each frame with the cube and a known head pose."""
    problem: str
    """Reason why the cube was not seen last; empty if it always was."""

    @property
    def rate_hz(self) -> float | None:
        """Filtered poses per second; None for less than two."""
        if len(self.tracked) < 2:
            return None
        passed_ns = self.tracked[-1].t_ns - self.tracked[0].t_ns
        return 1e9 * (len(self.tracked) - 1) / passed_ns

    @property
    def jitter_m(self) -> float | None:
        """RMS movement of the filtered pose between two frames at rest; None without any."""
        moves = [
            after.T_W_T[:3, 3] - before.T_W_T[:3, 3]
            for before, after in pairwise(self.tracked)
            if before.is_at_rest and after.is_at_rest
        ]
        return float(np.sqrt(np.mean(np.sum(np.square(moves), axis=1)))) if moves else None


def run_cube_tracking(
    tracker: CubeTracker,
    server: HeadsetServer | None,
    duration_s: float,
    progress: Progress = Progress(),
) -> CubeTracking:
    """Track the cube for some time; a headset draws it where it is.

    Parameters
    ----------
    tracker : CubeTracker
    server : HeadsetServer or None
        With a connected headset, to which the cube is sent as a shape in the world; None: nothing
        is drawn.
    duration_s : float
    progress : Progress

    Raises
    ------
    CameraError
        If the camera fails.
    CancelledError
    """
    frames, tracked, problem = 0, list[TrackedCube](), ""
    shown_m: Float64 | None = None
    start_s = time.monotonic()
    try:
        while (passed_s := time.monotonic() - start_s) < duration_s:
            progress.at(passed_s / duration_s, "Tracking the cube")
            try:
                found = tracker.step()
            except CameraEndError:
                break
            frames += 1
            problem = tracker.problem or problem
            if found is None:
                continue
            tracked.append(found)
            corners_m = transform(found.T_W_T, cube_corners_m(tracker.cube))
            if server is not None and (
                shown_m is None or np.abs(corners_m - shown_m).max() > _RESEND_M
            ):
                server.send_shape(Shape(corners_m, EYES))
                shown_m = corners_m
    finally:
        if server is not None:
            server.send_shape(None)
    return CubeTracking(frames, tuple(tracked), problem)
