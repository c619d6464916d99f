"""Snapshots of a rendered calibration for panels, and a station with a scripted camera."""

from __future__ import annotations

import os
import shutil
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QCoreApplication, QEvent
from scipy.spatial.transform import Rotation

from handcal.calibration.hands import PlacedHand
from handcal.calibration.plan import NextStep, StepName
from handcal.calibration.procedure import Procedure
from handcal.calibration.sight import Observation
from handcal.calibration.states import CalibrationSettings, State
from handcal.camera.feed import CameraStatus
from handcal.camera.viewpoint import ViewpointCamera
from handcal.core.display import view_of_eye
from handcal.core.errors import CameraError, CameraTimeoutError
from handcal.core.geometry import rigid, transform
from handcal.core.types import (
    EYES,
    Alignment,
    CameraIdentity,
    Eye,
    Float64,
    Frame,
    HeadsetIdentity,
    Rig,
    UInt8,
    Verification,
)
from handcal.hand.segment import segment_hand
from handcal.hand.settings import SegmentSettings
from handcal.io.closable import Closable
from handcal.io.settings import settings_json
from handcal.link.client import HeadsetClient, HeadsetState
from handcal.link.statistics import LinkStatistics
from handcal.link.wire import Rejection
from handcal.register.results import Results, SolveSettings, results_json, solve_session
from handcal.rig.example import example_rig
from handcal.rig.rig_file import read_rig
from handcal.session.session import Session, SessionRecord
from handcal.sim.hand import make_hand
from handcal.sim.render import World, render
from handcal.sim.room import make_room
from handcal.sim.sensor import SensorSettings, sense_depth
from handcal.station.settings import StationSettings
from handcal.station.snapshot import Snapshot
from handcal.station.wearer_view import EyeView, render_eye_view
from tests.helpers import write_small_rig

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

KEY = "a pairing key of the tests"
IDENTITY = HeadsetIdentity("00000000000000aa", "Headset of the tests")
SENSOR = SensorSettings()
T_W_H = rigid([0.1, -0.2, 0.05], [0.3, -0.1, 0.2])
T_D_CURSOR = rigid([-0.2, 0.0, 0.0], [-0.01, 0.01, 0.50])
T_D_LIVE = T_D_CURSOR @ rigid([0.02, -0.03, 0.06], [0.012, -0.008, 0.01])
NOW_NS = 1_000_000_000_000
AGE_NS = 42_000_000
T_D_TURNED = T_D_LIVE @ rigid([0.0, 0.0, np.radians(15.0)])
FRAME_S, POSE_S = 0.08, 0.015
LINK = LinkStatistics(
    connected=True,
    sent=12_345,
    received=6_789,
    lost=3,
    lost_inbound=1,
    resent=5,
    acked=17,
    unacked=0,
    failed=0,
    rejected={str(reason): 0 for reason in Rejection},
    pose_rate_hz=60.0,
    latency_ms=2.4,
    clock_offset_ms=5000.123,
    clock_drift_ppm=-12.0,
    clock_drift_uncertainty_ppm=3.0,
    clock_uncertainty_ms=0.31,
    bytes_sent=4_500_000,
    bytes_received=650_000,
)


@dataclass(frozen=True, eq=False)
class Shots:
    """The hand that became the cursor and the live hand, as seen by the rig's camera."""

    cursor: PlacedHand
    live: PlacedHand
    frame: Frame
    rotation_rad: Float64


@pytest.fixture(autouse=True)
def _windows_are_deleted() -> Iterator[None]:
    """Delete a test's windows at its end: each that is left makes all later ones slower."""
    yield
    if QCoreApplication.instance() is not None:
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)


@pytest.fixture(scope="session")
def rig() -> Rig:
    return example_rig()


@pytest.fixture(scope="session")
def shots(rig: Rig) -> Shots:
    world = World(make_hand(1), make_room(1))
    (_, cursor), (frame, live) = (_shoot(rig, world, T) for T in (T_D_CURSOR, T_D_LIVE))
    turned = T_D_LIVE[:3, :3] @ T_D_CURSOR[:3, :3].T
    return Shots(cursor, live, frame, Rotation.from_matrix(turned).as_rotvec())


@pytest.fixture(scope="session")
def alignments(simulated: Callable[..., Alignment]) -> tuple[Alignment, ...]:
    return simulated(1), simulated(2)


@pytest.fixture(scope="session")
def results(rig: Rig, alignments: Sequence[Alignment]) -> Results:
    return solve_session(alignments, rig, SolveSettings())


@pytest.fixture(scope="session")
def solved_session(
    tmp_path_factory: pytest.TempPathFactory,
    rig: Rig,
    alignments: Sequence[Alignment],
    results: Results,
) -> Path:
    """Return the folder of a solved session, which no test changes."""
    settings = settings_json(CalibrationSettings())
    with Session.create(tmp_path_factory.mktemp("solved"), rig, settings, "wearer-1") as session:
        for alignment in alignments:
            session.save_alignment(alignment)
        session.save_results(results_json(results))
    return session.path


@pytest.fixture
def record(tmp_path: Path, solved_session: Path) -> SessionRecord:
    """Return the record of a copy of the solved session."""
    copy = tmp_path / "sessions" / solved_session.name
    return Session.open(shutil.copytree(solved_session, copy))


@pytest.fixture
def snapshot(
    rig: Rig, shots: Shots, results: Results, record: SessionRecord
) -> Callable[..., Snapshot]:
    """Return a maker of snapshots of a state, by default of aligning, with changes to it.

    ``snapshot(State.ALIGN, observation={"is_over_limit": True}, camera={"dropped": 3}, number=2)``
    changes fields of the parts `observation`, `procedure`, `camera` and `link`, and of the
    snapshot itself; ``observation=None`` leaves it out. The record holds the eyes `verified`.
    """

    def make(
        state: State = State.ALIGN,
        *,
        observation: Mapping[str, Any] | None = {},
        procedure: Mapping[str, Any] = {},
        camera: Mapping[str, Any] = {},
        link: Mapping[str, Any] = {},
        verified: Mapping[Eye, Verification] | None = None,
        **changes: Any,
    ) -> Snapshot:
        observed = _observe(state, shots)
        snapshot = Snapshot(
            number=1,
            t_host_ns=NOW_NS,
            frame=shots.frame,
            observation=None if observation is None else replace(observed, **observation),
            camera=replace(CameraStatus("Simulated camera", rate_hz=30.0), **camera),
            link=replace(LINK, **link),
            link_problem="",
            procedure=replace(_procedure(state, shots, results), **procedure),
            record=record,
            next_step=NextStep(_NEXT[state], EYES, "as told"),
            views=_views(rig, shots),
        )
        if verified is not None:
            now = changes.get("record", record)
            facts = replace(now.facts, verified=verified)
            changes["record"] = replace(now, facts=facts, verified_now=frozenset(verified))
        return replace(snapshot, **changes)

    return make


class Camera(Closable):
    """A camera that shows one of the rendered frames and can be unplugged."""

    name = "Camera of the tests"
    identity = CameraIdentity()

    def __init__(self, frames: Mapping[str, Frame]) -> None:
        self.shows = "nothing"
        self.is_plugged = True
        self.depth_intrinsics = frames["cursor"].depth_intrinsics
        self._frames = frames
        self._index = 0

    def __call__(self, _serial: str = "") -> Camera:
        """Open it."""
        if not self.is_plugged:
            raise CameraError("no camera is connected; plug one in")
        return self

    def read(self, timeout_s: float = 1.0) -> Frame:
        if not self.is_plugged:
            raise CameraError("the camera was unplugged; plug it in again")
        time.sleep(FRAME_S)
        if self.shows == "silence":
            raise CameraTimeoutError("the camera gives no frame")
        self._index += 1
        shown, now_ns = self._frames[self.shows], time.monotonic_ns()
        depth = shown.depth.copy()
        depth[0, 0] = self._index % 1000  # a live picture always changes
        return replace(shown, index=self._index, t_camera_ns=now_ns, t_host_ns=now_ns, depth=depth)

    def close(self) -> None:
        pass


class StillCamera(ViewpointCamera):
    """A viewpoint camera that repeats one image, or fails once with `failure`."""

    def __init__(self, image: UInt8) -> None:
        self.name = "still"
        self.image = image
        self.failure: CameraError | None = None
        self.is_open = True

    def read(self) -> tuple[UInt8, int]:
        time.sleep(0.01)
        failure, self.failure = self.failure, None
        if failure is not None:
            raise failure
        return self.image.copy(), 0

    def close(self) -> None:
        self.is_open = False


@pytest.fixture
def still_camera() -> type[StillCamera]:
    return StillCamera


class Headset(Closable):
    """A headset at rest, controlled by the test."""

    def __init__(self, address: tuple[str, int], key: str) -> None:
        self._address, self._key = address, key
        self._ended = threading.Event()
        self._open()

    @property
    def shown(self) -> HeadsetState:
        return self._client.state()

    def confirm(self) -> None:
        self._client.confirm(time.monotonic_ns(), self.shown)

    def fall_silent(self) -> None:
        self._ended.set()
        self._thread.join()
        self._client.close()

    close = fall_silent

    def come_back(self) -> None:
        self._ended.clear()
        self._open()

    def _open(self) -> None:
        self._client = HeadsetClient(self._address, self._key.encode(), IDENTITY)
        self._thread = threading.Thread(target=self._tell_poses)
        self._thread.start()

    def _tell_poses(self) -> None:
        while not self._ended.wait(POSE_S):
            self._client.send_pose(T_W_H, time.monotonic_ns())


@dataclass(frozen=True, eq=False)
class Studio:
    """The camera and headset of a station, controlled by the test; the rest is real."""

    settings: StationSettings
    camera: Camera
    headset: Headset


@pytest.fixture(scope="session")
def small_rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_small_rig(tmp_path_factory.mktemp("rig") / "rig.yaml")


@pytest.fixture(scope="session")
def frames(small_rig: Path) -> dict[str, Frame]:
    """Return the frames that the camera can show, by name."""
    rig = read_rig(small_rig)
    world = World(make_hand(1), make_room(1))
    poses = {"cursor": T_D_CURSOR, "live": T_D_LIVE, "turned": T_D_TURNED}
    return {name: _render(rig, world, T) for name, T in {**poses, "nothing": None}.items()}


@pytest.fixture
def studio(
    small_rig: Path, frames: Mapping[str, Frame], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Studio]:
    """Return the parts of a station to be opened with their settings and the pairing key `KEY`."""
    camera = Camera(frames)
    monkeypatch.setattr("handcal.station.station.RealSenseCamera", camera)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        address = probe.getsockname()
    settings = StationSettings(
        source="realsense",
        rig=str(small_rig),
        headset="network",
        host=address[0],
        port=address[1],
        sessions=str(tmp_path / "sessions"),
    )
    # A busy computer gives few frames a second, and a confirmation may lie between two.
    monkeypatch.setattr("handcal.calibration.hands.MATCH_NS", 600_000_000)
    monkeypatch.setattr("handcal.calibration.procedure._APPLY_TIMEOUT_S", 1.0)
    with Headset(address, KEY) as headset:
        yield Studio(settings, camera, headset)


def _render(rig: Rig, world: World, T_D_hand: Float64 | None) -> Frame:
    T_W_D, camera = T_W_H @ rig.T_H_D, rig.depth_intrinsics
    T_W_hand = None if T_D_hand is None else T_W_D @ T_D_hand
    depth_m, color = render(world, T_W_D, T_W_hand, camera)
    depth = sense_depth(depth_m, camera.fx, np.random.default_rng(0), SENSOR)
    t_ns = NOW_NS - AGE_NS
    return Frame(1, t_ns, t_ns, depth, SENSOR.depth_scale_m, camera, color, camera)


def _shoot(rig: Rig, world: World, T_D_hand: Float64) -> tuple[Frame, PlacedHand]:
    frame = _render(rig, world, T_D_hand)
    cloud = segment_hand(frame, SegmentSettings())
    T_W_D = T_W_H @ rig.T_H_D
    points_W_m = transform(T_W_D, cloud.points_m)
    middle_W_m = np.median(points_W_m, axis=0)
    return frame, PlacedHand(cloud, frame.t_host_ns, T_W_D, points_W_m, middle_W_m)


def _observe(state: State, shots: Shots) -> Observation:
    return Observation(
        state,
        shots.live,
        problem="",
        is_steady=True,
        cloud=shots.live.cloud,
        rotation_rad=shots.rotation_rad if state is State.ALIGN else None,
        segment_ms=4.2,
        guard_ms=3.1 if state is State.ALIGN else None,
    )


def _procedure(state: State, shots: Shots, results: Results) -> Procedure:
    is_sent = state in (State.APPLYING, State.APPLIED)
    applied_m = {eye: results.eyes[eye].shift_m if is_sent else np.zeros(3) for eye in EYES}
    return Procedure(
        state=state,
        eyes=EYES,
        cursor=shots.cursor if state in (State.ALIGN, State.ALIGNED, State.SOLVED) else None,
        refusal="",
        results=results if is_sent or state is State.SOLVED else None,
        applied_shift_m=applied_m,
        is_applied=state is not State.APPLYING,
    )


_NEXT = {
    State.SHOW_HAND: StepName.CURSOR,
    State.ALIGN: StepName.ALIGN,
    State.ALIGNED: StepName.SOLVE,
    State.SOLVED: StepName.APPLY,
    State.APPLYING: StepName.WAIT,
    State.APPLIED: StepName.DONE,
    State.VERIFY: StepName.NUDGE,
}
"""The plan's next step in each state, if nothing else is said."""


def _views(rig: Rig, shots: Shots) -> dict[Eye, EyeView]:
    """Return the views of eyes beside the viewpoints, through uncorrected displays."""
    views = {}
    for eye, display in rig.eyes.items():
        outline_E_m, cursor_E_m = (
            transform(view_of_eye(display, T_W_H) @ hand.T_W_D, hand.cloud.contour_m)
            for hand in (shots.live, shots.cursor)
        )
        shift_m = np.array([0.002, -0.001, 0.003])
        views[eye] = render_eye_view(
            eye, display, shift_m, np.zeros(3), outline_E_m, cursor_E_m, is_true=True
        )
    return views
