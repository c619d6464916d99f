"""The user test with a cube, which is tracked by the depth camera and drawn where it stands.

As in Hu et al. 2021 (user test): the cube is placed at random at 0.4, 0.5 and 0.6 m, the corners of
one face are drawn fixed in the world, and φ is adjusted by hand until they cover the real ones.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TypeAlias

import cv2
import numpy as np

from handcal.calibration.delay import ASSUMED_LATENCY_S
from handcal.calibration.drawing import Drawing
from handcal.camera.camera import Camera
from handcal.camera.clock import FrameClock
from handcal.core.display import TARGET_DEPTHS_M, view_of_eye
from handcal.core.errors import (
    CameraEndError,
    CameraError,
    CameraTimeoutError,
    FileError,
    HandcalError,
    PoseError,
    PosePendingError,
)
from handcal.core.geometry import image_points, invert, transform
from handcal.core.progress import Progress
from handcal.core.types import EYES, Eye, EyeDisplay, Float64, Frame, Rig, UInt8
from handcal.link.server import HeadsetServer
from handcal.link.shapes import Shape
from handcal.register.results import read_rendered_shift_m
from handcal.rig.cube import (
    Cube,
    CubeError,
    CubeFilter,
    TrackedCube,
    cube_corners_m,
    cube_pose,
    facing_corners_m,
    find_cube,
    read_cube,
)
from handcal.rig.example import example_rig
from handcal.rig.rig_file import read_rig
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import Trial, make_trial
from handcal.sim.cube_bench import simulated_wearer

_WAITING = 30  # frames whose head pose has not arrived
_RESEND_M = 0.0003
_MOST_KEPT = 20_000  # poses of more than ten minutes


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

    Attributes
    ----------
    problem : str
        Reason why the cube was not seen in the newest frame; empty if it was.
    frame : Frame or None
        The newest frame.
    T_D_T : (4, 4) float64 or None
        Pose of the cube in the depth camera, as measured in the newest frame; None if not seen.
    """

    def __init__(
        self,
        camera: Camera,
        cube: Cube,
        T_H_D: Float64,
        pose_at_host_ns: Callable[[int], Float64],
    ) -> None:
        self.cube = cube
        self.problem = ""
        self.frame: Frame | None = None
        self.T_D_T: Float64 | None = None
        self._camera = camera
        self._T_H_D = T_H_D
        self._pose_at_host_ns = pose_at_host_ns
        self._filter = CubeFilter()
        self._clock = FrameClock(ASSUMED_LATENCY_S)
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
        self.frame, self.T_D_T = frame, None
        try:
            self.T_D_T = see_cube(frame, self.cube)
            self._waiting.append((frame.t_camera_ns, t_host_ns, self._T_H_D @ self.T_D_T))
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
        raise CameraError("the depth camera delivers no colour, in which the cube is tracked")
    gray: UInt8 = np.asarray(cv2.cvtColor(frame.color, cv2.COLOR_RGB2GRAY), np.uint8)
    T_C_T = cube_pose(find_cube(gray, cube), cube, frame.color_intrinsics)
    return invert(frame.T_C_D) @ T_C_T


@dataclass(frozen=True, slots=True)
class TrackingOrder:
    """A cube to track, as ordered by command line or window."""

    rig: Path | None = None
    """Rig file; None: the shipped example."""
    cube: Path | None = None
    """Description of the cube; None: a 60 mm cube."""
    duration_s: float | None = None
    """None: until it is cancelled."""


@dataclass(frozen=True, slots=True, eq=False)
class CubeSight:
    """The cube at one frame."""

    cube: Cube
    frame: Frame
    T_D_T: Float64 | None
    """(4, 4); measured in this frame; None if it is not seen."""
    tracked: TrackedCube | None
    """The newest filtered pose; None before the first."""
    problem: str
    """Reason why it is not seen; empty if it is."""

    @property
    def corners_px(self) -> Float64 | None:
        """The cube's vertices in the colour image, (8, 2), as of `cube_corners_m`; or None."""
        frame = self.frame
        if self.T_D_T is None or frame.color_intrinsics is None:
            return None
        corners_C_m = transform(frame.T_C_D @ self.T_D_T, cube_corners_m(self.cube))
        return image_points(corners_C_m, frame.color_intrinsics)


@dataclass(frozen=True, slots=True, eq=False)
class CubeTracking:
    """Result of tracking a cube for some time."""

    frames: int
    """Frames read."""
    poses: int
    """Frames with the cube and a known head pose."""
    tracked: tuple[TrackedCube, ...]
    """The filtered poses of these frames, at most the newest 20,000."""
    problem: str
    """Reason why the cube was not seen last; empty if it always was."""
    error_m: float | None = None
    """Distance of the last pose from the true place, if that is simulated."""

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


def track_cube(
    order: TrackingOrder,
    connect: Callable[[], AbstractContextManager[HeadsetServer]] | None,
    open_camera: Callable[[], AbstractContextManager[Camera]] | None,
    see: Callable[[CubeSight], object] = lambda _: None,
    progress: Progress = Progress(),
) -> CubeTracking:
    """Track the cube with a rig's depth camera; a headset draws it where it is.

    Parameters
    ----------
    order : TrackingOrder
    connect : callable or None
        Opens the link with a connected headset, which draws with the offline calibration; None:
        the camera does not move, and nothing is drawn.
    open_camera : callable or None
        Opens the depth camera; None: the simulator, with a headset of its own.
    see : callable
        Called with every frame.
    progress : Progress

    Raises
    ------
    FileError
        If the rig file or the description of the cube cannot be used.
    LinkError
        If no headset connects.
    CameraError
        If the camera fails.
    CancelledError
    """
    rig = example_rig() if order.rig is None else read_rig(order.rig)
    cube = Cube() if order.cube is None else read_cube(order.cube)
    with ExitStack() as stack:
        server, bench = None, None
        if open_camera is None:
            server, bench = stack.enter_context(simulated_wearer(rig, cube, 1))
            camera: Camera = bench
        else:
            camera = stack.enter_context(open_camera())
            server = stack.enter_context(connect()) if connect is not None else None
        head = (lambda _: np.eye(4)) if server is None else server.pose_at_host_ns
        if server is not None:
            Drawing(rig, server, "").send({eye: np.zeros(3) for eye in EYES})
        tracker = CubeTracker(camera, cube, rig.T_H_D, head)
        found = run_cube_tracking(tracker, server, order.duration_s, see, progress)
    if bench is None or not found.tracked:
        return found
    apart_m = found.tracked[-1].T_W_T[:3, 3] - bench.T_W_T[:3, 3]
    return replace(found, error_m=float(np.linalg.norm(apart_m)))


def run_cube_tracking(
    tracker: CubeTracker,
    server: HeadsetServer | None,
    duration_s: float | None,
    see: Callable[[CubeSight], object] = lambda _: None,
    progress: Progress = Progress(),
) -> CubeTracking:
    """Track the cube for some time, as `track_cube`, with a tracker.

    Parameters
    ----------
    tracker : CubeTracker
    server : HeadsetServer or None
        With a connected headset, to which the cube is sent as a shape in the world; None: nothing
        is drawn.
    duration_s : float or None
        None: until it is cancelled, or a recording ends.
    see : callable
        Called with every frame.
    progress : Progress

    Raises
    ------
    CameraError
        If the camera fails.
    CancelledError
    """
    frames, poses, problem = 0, 0, ""
    tracked = deque[TrackedCube](maxlen=_MOST_KEPT)
    shown_m: Float64 | None = None
    start_s = time.monotonic()
    try:
        while duration_s is None or time.monotonic() - start_s < duration_s:
            if duration_s is None:
                progress.check()
            else:
                progress.at((time.monotonic() - start_s) / duration_s, "Tracking the cube")
            try:
                found = tracker.step()
            except CameraEndError:
                break
            frames += 1
            problem = tracker.problem or problem
            if found is not None:
                poses += 1
                tracked.append(found)
                corners_m = transform(found.T_W_T, cube_corners_m(tracker.cube))
                if server is not None and (
                    shown_m is None or np.abs(corners_m - shown_m).max() > _RESEND_M
                ):
                    server.send_shape(Shape(corners_m, EYES))
                    shown_m = corners_m
            if tracker.frame is not None:
                newest = tracked[-1] if tracked else None
                see(CubeSight(tracker.cube, tracker.frame, tracker.T_D_T, newest, tracker.problem))
    finally:
        if server is not None:
            server.send_shape(None)
    return CubeTracking(frames, poses, tuple(tracked), problem)


Adjust: TypeAlias = Callable[[Eye, Float64, Callable[[Float64], None]], Float64]
"""Given an eye, its φ, and a function that draws with another φ: returns φ as adjusted by hand."""

PLACE_PROMPT = "Look straight ahead. The cube will be put {:g} m in front of you."
_ACK_S = 6.0
_NEAR_M = 0.05
"""Largest distance of the cube from the wanted one."""
_POSE_AGE_NS = 60_000_000
_POSE_PATIENCE_S, _POLL_S = 3.0, 0.02


@dataclass(frozen=True, slots=True)
class TrialSettings:
    """Settings of the trials of one calibration."""

    eyes: tuple[Eye, ...] = EYES
    patience_s: float = 120.0
    """Longest time until the cube is at rest at the wanted distance."""


@dataclass(frozen=True, slots=True)
class TrialOrder:
    """The trials of a stored session, as ordered by command line or window."""

    session: Path
    cube: Path | None = None
    """Description of the cube; None: a 60 mm cube."""
    trials: TrialSettings = TrialSettings()


@dataclass(frozen=True, slots=True)
class StudyLeader:
    """The person who puts the cube down and adjusts φ."""

    place: Callable[[float], None]
    """Called before each distance: asks for the cube there."""
    adjust: Adjust


def record_user_trials(
    order: TrialOrder,
    connect: Callable[[], AbstractContextManager[HeadsetServer]] | None,
    open_camera: Callable[[], AbstractContextManager[Camera]],
    leader: StudyLeader,
    progress: Progress = Progress(),
) -> tuple[Trial, ...]:
    """Record the trials of a stored session, as `run_user_trials`.

    Parameters
    ----------
    order : TrialOrder
    connect : callable or None
        Opens the link with a connected headset; None: the simulator, whose wearer takes the
        leader's place, with the seed of the session.
    open_camera : callable
        Opens the depth camera; not called for the simulator.
    leader : StudyLeader
    progress : Progress

    Raises
    ------
    FileError
        If a file cannot be used, or `connect` is None and it is of no virtual headset.
    """
    record = Session.open(order.session)
    cube = Cube() if order.cube is None else read_cube(order.cube)
    rig = record.rig
    with ExitStack() as stack:
        camera: Camera
        if connect is None:
            station = record.settings.get("station", {})
            if station.get("headset") != "virtual" or "seed" not in station:
                raise FileError(
                    f"{order.session}: the virtual headset has no such wearer",
                    "make a session with handcal demo",
                )
            server, bench = stack.enter_context(simulated_wearer(rig, cube, station["seed"]))
            camera, leader = bench, StudyLeader(bench.place, bench.adjust)
        else:
            server = stack.enter_context(connect())
            camera = stack.enter_context(open_camera())
        session = stack.enter_context(Session(order.session))
        tracker = CubeTracker(camera, cube, rig.T_H_D, server.pose_at_host_ns)
        return run_user_trials(session, server, tracker, leader, order.trials, progress)


def run_user_trials(
    session: Session,
    server: HeadsetServer,
    tracker: CubeTracker,
    leader: StudyLeader,
    settings: TrialSettings = TrialSettings(),
    progress: Progress = Progress(),
) -> tuple[Trial, ...]:
    """Record a trial for each distance and eye of a session's calibration.

    Parameters
    ----------
    session : Session
        Solved.
    server : HeadsetServer
        With a connected headset.
    tracker : CubeTracker
    leader : StudyLeader
    settings : TrialSettings
    progress : Progress

    Returns
    -------
    tuple of Trial
        As saved in the session.

    Raises
    ------
    FileError
        If an eye of the session is not solved, or it cannot be written.
    HandcalError
        If the cube does not come to rest at the wanted distance.
    LinkError
        If the headset does not acknowledge what it is sent.
    CameraError
    CancelledError
    """
    record = session.contents
    rig, calibrated_m = record.rig, calibrated_shifts_m(record, settings.eyes)
    drawing = Drawing(rig, server, record.wearer)
    trials: list[Trial] = []
    # A headset draws nothing before it has the projections of both eyes.
    drawing.send({eye: calibrated_m.get(eye, np.zeros(3)) for eye in EYES})
    drawing.wait_acked(_ACK_S)
    try:
        for number, depth_m in enumerate(TARGET_DEPTHS_M):
            server.send_prompt(PLACE_PROMPT.format(depth_m))
            leader.place(depth_m)
            cube = wait_for_cube(tracker, server, rig, depth_m, settings, progress)
            for eye in settings.eyes:
                progress.at(number / len(TARGET_DEPTHS_M), f"{eye} eye, {depth_m} m")
                display, shift_m = rig.eyes[eye], calibrated_m[eye]
                draw = partial(_draw, drawing, eye)
                draw(shift_m)
                corners_W_m = _show_face(server, tracker.cube, cube, eye, display)
                adjusted_m = leader.adjust(eye, shift_m, draw)
                # The head has moved since: the trial is about where the corners are seen now.
                corners_E_m = transform(view_of_eye(display, _head_now(server)), corners_W_m)
                trials.append(make_trial(display, eye, depth_m, shift_m, adjusted_m, corners_E_m))
                session.save_trial(trials[-1])
                draw(shift_m)
    finally:
        server.send_shape(None)
        server.send_prompt("")
    return tuple(trials)


def _draw(drawing: Drawing, eye: Eye, shift_m: Float64) -> None:
    """Have the headset draw with φ, and wait until it does."""
    drawing.send({eye: shift_m})
    drawing.wait_acked(_ACK_S)


def _show_face(
    server: HeadsetServer, cube: Cube, tracked: TrackedCube, eye: Eye, display: EyeDisplay
) -> Float64:
    """Draw the corners of the face that an eye sees, and tell the wearer; return them (4, 3)."""
    T_E_T = view_of_eye(display, _head_now(server)) @ tracked.T_W_T
    corners_W_m = transform(tracked.T_W_T, facing_corners_m(cube, T_E_T))
    server.wait_acked(server.send_shape(Shape(corners_W_m, (eye,))), _ACK_S)
    server.wait_acked(server.send_prompt(adjust_prompt(eye), (eye,)), _ACK_S)
    return corners_W_m


def adjust_prompt(eye: Eye) -> str:
    """Return what the wearer is asked to do while φ is adjusted."""
    other = "right" if eye == "left" else "left"
    return (
        f"Close your {other} eye. Say where the drawn corners must move until they cover the "
        "cube's, and when they do."
    )


def calibrated_shifts_m(record: SessionRecord, eyes: Sequence[Eye]) -> Mapping[Eye, Float64]:
    """Return the calibrated φ of each eye of a session; FileError if one is not solved."""
    solved_m = read_rendered_shift_m(record.results)
    missing = [eye for eye in eyes if eye not in solved_m]
    if missing:
        raise FileError(f"{record.path}: the {missing[0]} eye is not solved", "calibrate it first")
    return {eye: solved_m[eye] for eye in eyes}


def wait_for_cube(
    tracker: CubeTracker,
    server: HeadsetServer,
    rig: Rig,
    depth_m: float,
    settings: TrialSettings,
    progress: Progress,
) -> TrackedCube:
    """Return the cube once it is at rest at about a distance from the eyes.

    Raises
    ------
    HandcalError
        If it does not come to rest there within the patience.
    """
    end_s = time.monotonic() + settings.patience_s
    why = "the cube is not seen"
    while time.monotonic() < end_s:
        progress.check()
        found = tracker.step()
        why = tracker.problem or why
        if found is None:
            continue
        T_E_W = view_of_eye(rig.eyes[settings.eyes[0]], _head_now(server))
        seen_m = float((T_E_W @ found.T_W_T)[2, 3])
        if abs(seen_m - depth_m) > _NEAR_M:
            why = f"it is {seen_m:.2f} m from the eyes"
        elif found.is_at_rest:
            return found
        else:
            why = "it moves"
    raise HandcalError(f"the cube did not come to rest at {depth_m} m: {why}", "put it down there")


def _head_now(server: HeadsetServer) -> Float64:
    """Return a pose T_W_H of just now; PoseError if none arrives for a while."""
    end_s = time.monotonic() + _POSE_PATIENCE_S
    while True:
        try:
            return server.pose_at_host_ns(time.monotonic_ns() - _POSE_AGE_NS)
        except PoseError:
            if time.monotonic() > end_s:
                raise
        time.sleep(_POLL_S)
