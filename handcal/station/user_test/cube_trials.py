"""Trials of the user test with a cube that stands in the room, for a calibrated session.

As in Hu et al. 2021 (user test): the cube is placed at random at 0.4, 0.5 and 0.6 m, the corners of
one face are drawn fixed in the world, and φ is adjusted by hand until they cover the real ones.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from handcal.calibration.drawing import Drawing
from handcal.camera.camera import Camera
from handcal.core.display import TARGET_DEPTHS_M, view_of_eye
from handcal.core.errors import FileError, HandcalError, PoseError
from handcal.core.geometry import transform
from handcal.core.progress import Progress
from handcal.core.types import EYES, Eye, Float64, Rig
from handcal.link.server import HeadsetServer
from handcal.link.shapes import Shape
from handcal.register.results import read_rendered_shift_m
from handcal.rig.cube import Cube, TrackedCube, facing_corners_m, read_cube
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import Trial, make_trial
from handcal.sim.cube_bench import simulated_wearer
from handcal.station.user_test.cube_tracking import CubeTracker

Adjust: TypeAlias = Callable[[Eye, Float64, Callable[[Float64], None]], Float64]
"""Given an eye, its φ, and a function that draws with another φ: returns φ as adjusted by hand."""

PLACE_PROMPT = "Look straight ahead. The cube will be put {:g} m in front of you."
_ACK_S = 6.0
_POSE_AGE_NS = 60_000_000
_POSE_PATIENCE_S, _POLL_S = 3.0, 0.02


@dataclass(frozen=True, slots=True)
class TrialSettings:
    """Settings of the trials of one calibration."""

    eyes: tuple[Eye, ...] = EYES
    depths_m: tuple[float, ...] = TARGET_DEPTHS_M
    near_m: float = 0.05
    """Largest distance of the cube from the wanted one."""
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
        If a file cannot be used, or the session is not of a simulated wearer but `connect` is None.
    """
    record = Session.open(order.session)
    cube = Cube() if order.cube is None else read_cube(order.cube)
    rig = record.rig
    with ExitStack() as stack:
        camera: Camera
        if connect is None:
            if "station" not in record.settings:
                raise FileError(
                    f"{order.session}: it is not of a simulated wearer",
                    "make one with handcal demo",
                )
            seed = record.settings["station"].get("seed", 1)
            server, bench = stack.enter_context(simulated_wearer(rig, cube, seed))
            camera, leader = bench, StudyLeader(bench.place, bench.adjust)
        else:
            server = stack.enter_context(connect())
            camera = stack.enter_context(open_camera())
        session = stack.enter_context(Session(order.session))
        tracker = CubeTracker(camera, cube, rig.T_H_D, server.pose_at_host_ns)
        return run_user_trials(
            session, server, tracker, leader.adjust, leader.place, order.trials, progress
        )


def run_user_trials(
    session: Session,
    server: HeadsetServer,
    tracker: CubeTracker,
    adjust: Adjust,
    place: Callable[[float], None],
    settings: TrialSettings | None = None,
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
    adjust : callable
        See `Adjust`.
    place : callable
        Called before each distance: asks for the cube there.
    settings : TrialSettings, optional
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
    settings = settings or TrialSettings()
    record = session.contents
    rig, calibrated_m = record.rig, calibrated_shifts_m(record, settings.eyes)
    drawing = Drawing(rig, server, record.wearer)
    trials: list[Trial] = []
    # A headset draws nothing before it has the projections of both eyes.
    drawing.send({eye: calibrated_m.get(eye, np.zeros(3)) for eye in EYES})
    drawing.wait_acked(_ACK_S)
    try:
        for round_number, depth_m in enumerate(settings.depths_m):
            server.send_prompt(PLACE_PROMPT.format(depth_m))
            place(depth_m)
            cube = wait_for_cube(tracker, server, rig, depth_m, settings, progress)
            for eye in settings.eyes:
                progress.at(round_number / len(settings.depths_m), f"{eye} eye, {depth_m} m")

                def draw(shift_m: Float64) -> None:
                    drawing.send({eye: shift_m})  # noqa: B023 (called before the next eye's turn)
                    drawing.wait_acked(_ACK_S)

                draw(calibrated_m[eye])
                T_E_T = view_of_eye(rig.eyes[eye], _head_now(server)) @ cube.T_W_T
                corners_W_m = transform(cube.T_W_T, facing_corners_m(tracker.cube, T_E_T))
                server.wait_acked(server.send_shape(Shape(corners_W_m, (eye,))), _ACK_S)
                server.wait_acked(server.send_prompt(adjust_prompt(eye), (eye,)), _ACK_S)
                adjusted_m = adjust(eye, calibrated_m[eye], draw)
                T_E_W = view_of_eye(rig.eyes[eye], _head_now(server))
                trial = make_trial(
                    rig.eyes[eye],
                    eye,
                    depth_m,
                    calibrated_m[eye],
                    adjusted_m,
                    transform(T_E_W, corners_W_m),
                )
                session.save_trial(trial)
                trials.append(trial)
                draw(calibrated_m[eye])
    finally:
        server.send_shape(None)
        server.send_prompt("")
    return tuple(trials)


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
        if abs(seen_m - depth_m) > settings.near_m:
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
