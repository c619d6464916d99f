"""A calibration with rendered frames and a headset over real datagrams, for the station's tests."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from handcal.calibration.procedure import Calibration
from handcal.calibration.sight import Observation
from handcal.calibration.states import CalibrationSettings, State
from handcal.core.display import projection_matrix
from handcal.core.errors import PoseError
from handcal.core.geometry import rigid
from handcal.core.types import EYES, Eye, Float64, Frame, HeadsetIdentity, Intrinsics, UInt16
from handcal.link.client import HeadsetClient, HeadsetState
from handcal.link.server import HeadsetServer
from handcal.rig.example import example_rig
from handcal.session.session import Session
from handcal.sim.hand import HandSettings, make_hand
from handcal.sim.render import World, render
from handcal.sim.room import make_room
from handcal.sim.sensor import SensorSettings, sense_depth
from tests.helpers import eventually

KEY = b"a pairing key of the tests"
IDENTITY = HeadsetIdentity("00000000000000aa", "Headset of the tests")
CAMERA = Intrinsics(640, 360, 502.5, 502.5, 319.5, 179.5)
RIG = replace(example_rig(), depth_intrinsics=CAMERA)
SENSOR = SensorSettings()
SETTINGS = CalibrationSettings()
PERIOD_NS = 80_000_000
HEADSET_AHEAD_NS = 5_000_000_000
CAMERA_AHEAD_NS = 7_000_000_000

T_W_H = rigid([0.1, -0.2, 0.05], [0.3, -0.1, 0.2])
T_D_HAND = rigid([-0.2, 0.0, 0.0], [0.0, 0.0, 0.5])
T_D_NEAR = rigid([-0.2, 0.0, 0.0], [0.006, -0.004, 0.5])
T_D_TURNED = rigid([-0.2, 0.0, 0.0], [0.006, -0.004, 0.5]) @ rigid([0.0, 0.0, np.radians(15.0)])


@cache
def world() -> World:
    return World(make_hand(1), make_room(1))


@cache
def depth_of(pose: bytes | None, thumb_out_rad: float = 0.0) -> UInt16:
    T_D_hand = None if pose is None else np.frombuffer(pose).reshape(4, 4)
    shaped = world()
    if thumb_out_rad:
        shaped = replace(shaped, hand=make_hand(1, HandSettings(thumb_out_rad=thumb_out_rad)))
    depth_m, _ = render(shaped, np.eye(4), T_D_hand, CAMERA)
    # The focal length of the full-resolution image, whose noise the smaller one inherits.
    return sense_depth(depth_m, 2 * CAMERA.fx, np.random.default_rng(0), SENSOR)


class Stage:
    """A calibration with its wearer and headset, on a timeline of its own that needs no waiting."""

    def __init__(
        self,
        server: HeadsetServer,
        client: HeadsetClient,
        session: Session,
    ):
        self.server, self.client = server, client
        self.calibration = Calibration(session, server, SETTINGS)
        self.t_ns = time.monotonic_ns()
        self._frames = 0

    def send_poses(self, T: Float64 = T_W_H, t_ns: int | None = None) -> None:
        """Tell the pose around a time, and wait until it is known."""
        t_ns = t_ns or self.t_ns
        for part_ns in (-20_000_000, 20_000_000):
            self.client.send_pose(T, t_ns + part_ns + HEADSET_AHEAD_NS)
        eventually(lambda: self._knows_pose(t_ns))

    def see(
        self,
        T_D_hand: Float64 | None = T_D_HAND,
        T: Float64 = T_W_H,
        *,
        pose: bool = True,
        told: Float64 | None = None,
        thumb_out_rad: float = 0.0,
    ) -> Observation:
        """Step with the next frame, of a hand or none; `told` is the pose it tells."""
        frame = self.frame(T_D_hand, T, pose=pose, thumb_out_rad=thumb_out_rad)
        calibration = self.calibration
        return calibration.judge(calibration.see(replace(frame, T_W_D=told)))

    def frame(
        self,
        T_D_hand: Float64 | None = T_D_HAND,
        T: Float64 = T_W_H,
        *,
        pose: bool = True,
        thumb_out_rad: float = 0.0,
    ) -> Frame:
        """Return the next frame."""
        self.t_ns += PERIOD_NS
        self._frames += 1
        if pose:
            self.send_poses(T)
        t_camera_ns = self.t_ns + CAMERA_AHEAD_NS
        depth = depth_of(None if T_D_hand is None else T_D_hand.tobytes(), thumb_out_rad).copy()
        depth[0, 0] = self._frames % 1000  # a live picture always changes
        return Frame(self._frames, t_camera_ns, self.t_ns, depth, SENSOR.depth_scale_m, CAMERA)

    def hold(self, T_D_hand: Float64 = T_D_HAND, frames: int = 7) -> Observation:
        """Hold the hand still for a while."""
        return [self.see(T_D_hand) for _ in range(frames)][-1]

    def press(
        self,
        t_ns: int | None = None,
        cursor_id: int | None = None,
        shown: HeadsetState | None = None,
    ) -> None:
        """Press the headset's button, at a time and for a cursor, as of now by default."""
        shown = shown or self.shown()
        shown = shown if cursor_id is None else replace(shown, cursor_id=cursor_id)
        t_headset_ns = (t_ns or self.t_ns) + HEADSET_AHEAD_NS
        self.client.wait_acked(self.client.confirm(t_headset_ns, shown), 5.0)
        self.wait_checked()

    def wait_checked(self) -> None:
        """Wait until the headset's clock is known to run on since the last message."""
        now_ns = time.monotonic_ns()
        eventually(lambda: self.server._clock.checked_host_ns > now_ns)

    def make_cursor(self, T_D_hand: Float64 = T_D_HAND, eyes: Sequence[Eye] = EYES) -> None:
        """Hold the hand, make the cursor of it, and wait until the headset shows it."""
        before = self.shown().cursor_id
        self.hold(T_D_hand)
        eventually(lambda: self.calibration.is_applied)
        self.calibration.make_cursor(eyes)
        eventually(lambda: self.shown().cursor_id > before and self.shown().prompt)

    def align(
        self,
        T_D_cursor: Float64 = T_D_HAND,
        T_D_hand: Float64 = T_D_NEAR,
        eyes: Sequence[Eye] = EYES,
    ) -> None:
        """Make a cursor and align the hand with it."""
        self.make_cursor(T_D_cursor, eyes)
        self.see(T_D_hand)
        self.press()
        self.see(T_D_hand)

    def calibrate(
        self,
        T_D_cursor: Float64 = T_D_HAND,
        T_D_hand: Float64 = T_D_NEAR,
        eyes: Sequence[Eye] = EYES,
    ) -> None:
        """Go round once."""
        self.align(T_D_cursor, T_D_hand, eyes)
        self.calibration.solve()
        self.calibration.apply()
        self.calibration.wait_applied()

    def state(self) -> State:
        return self.calibration.state

    def shown(self) -> HeadsetState:
        return self.client.state()

    def _knows_pose(self, t_ns: int) -> bool:
        try:
            self.server.pose_at_host_ns(t_ns)
        except PoseError:
            return False
        return True


def connect(server: HeadsetServer) -> HeadsetClient:
    client = HeadsetClient(
        server.address, KEY, IDENTITY, lambda: time.monotonic_ns() + HEADSET_AHEAD_NS
    )
    client.wait_connected(5.0)
    return client


def events(session: Session) -> list[tuple[str, dict[str, Any]]]:
    return [(event.name, event.data) for event in Session.open(session.path).events]


def shows_offline_projections(shown: HeadsetState) -> bool:
    return all(shows_projection(shown, eye, np.zeros(3)) for eye in EYES)


def shows_projection(shown: HeadsetState, eye: Eye, shift_m: Float64) -> bool:
    """Return whether the newest projection, if one has arrived, is that of a shift."""
    P = projection_matrix(RIG.eyes[eye], shift_m)
    return eye in shown.projections and np.array_equal(shown.projections[eye].P, P)


def shows(stage: Stage, eye: Eye, shift_m: Float64) -> bool:
    return shows_projection(stage.shown(), eye, shift_m)
