"""The contract of every camera: device, recording or simulator."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pytest

from handcal.camera.camera import Camera
from handcal.camera.hololens2 import HoloLens2Camera, HoloLens2RealSense
from handcal.camera.live import open_hololens2
from handcal.camera.oak import OakCamera
from handcal.camera.orbbec import OrbbecCamera
from handcal.camera.realsense import RealSenseCamera
from handcal.camera.recordings import open_recording, record_frames
from handcal.camera.settings import HoloLens2Settings
from handcal.core.errors import CameraEndError, CameraError, CameraTimeoutError
from handcal.core.types import CameraIdentity, Frame, Intrinsics
from handcal.sim.ahat import ahat_rays
from handcal.sim.camera import SyntheticCamera
from handcal.sim.hand import make_hand
from handcal.sim.render import World
from handcal.sim.room import make_room
from handcal.sim.scene import swaying_hand
from tests.camera.hl2ss_server import (
    GROUPS,
    NAME,
    Hl2ssServer,
    ahat_payload,
    calibration_of,
    camera_list_of,
    depth_packet_of,
    packet_of,
    realsense_settings,
)
from tests.camera.rosbag import write_rosbag
from tests.camera.stand_ins import OakStandIn, OrbbecStandIn

COUNT = 6
KINDS = (
    *("simulator", "realsense", "hololens2", "hololens2-realsense", "orbbec", "oak"),
    *("folder", "recording", "mcap", "rosbag-db3"),
)
D415 = CameraIdentity("Intel RealSense D415", "123", "5.16.0.1")
OpenCamera: TypeAlias = Callable[[], Camera]


@pytest.fixture(scope="module")
def world() -> World:
    return World(make_hand(1), make_room(0))


@pytest.fixture(params=KINDS)
def open_camera(
    request: pytest.FixtureRequest,
    world: World,
    plug_in: Callable[..., Any],
    make_frames: Callable[..., Iterator[Frame]],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> OpenCamera:
    match request.param:
        case "simulator":
            small = Intrinsics(width=320, height=180, fx=251.0, fy=251.0, cx=159.5, cy=89.5)
            return lambda: SyntheticCamera(world, swaying_hand, depth_intrinsics=small)
        case "realsense":
            plug_in(sizes=((848, 480),))
            return RealSenseCamera
        case "hololens2":
            port = request.getfixturevalue("hl2ss_port")
            return lambda: HoloLens2Camera(HoloLens2Settings("127.0.0.1", port=port))
        case "hololens2-realsense":
            server = request.getfixturevalue("realsense_server")
            settings = realsense_settings(server, tmp_path)
            return lambda: open_hololens2(settings)
        case "orbbec":
            monkeypatch.setitem(sys.modules, "pyorbbecsdk", OrbbecStandIn())
            return OrbbecCamera
        case "oak":
            monkeypatch.setitem(sys.modules, "depthai", OakStandIn())
            return OakCamera
        case "mcap" | "rosbag-db3" as kind:
            write_rosbag(tmp_path / "bag", make_frames(COUNT), is_mcap=kind == "mcap")
            return lambda: open_recording(tmp_path / "bag")
        case kind:
            path = tmp_path / ("made" if kind == "folder" else "made.db3")
            record_frames(path, make_frames(COUNT), D415)
            return lambda: open_recording(path)


@pytest.fixture
def hl2ss_port() -> Iterator[int]:
    """Yield the port of a HoloLens 2 whose images are noise."""

    def noise() -> Iterator[bytes]:
        rng = np.random.default_rng(1)
        for ticks in count(1):
            image = rng.integers(400, 500, (512, 512), np.uint16)
            yield packet_of(10_000 * ticks, ahat_payload(image, image), np.eye(4))

    with Hl2ssServer(calibration_of(ahat_rays(), np.eye(4)), noise().__next__) as server:
        yield server.port


@pytest.fixture
def realsense_server() -> Iterator[Hl2ssServer]:
    """Yield a HoloLens 2 with a RealSense whose images are noise."""

    def noise() -> Iterator[bytes]:
        rng = np.random.default_rng(1)
        for ticks in count(1):
            yield depth_packet_of(10_000 * ticks, rng.integers(400, 500, (32, 48), np.uint16))

    with Hl2ssServer(camera_list_of(GROUPS), noise().__next__) as server:
        yield server


def test_frames_come_in_order_with_both_clocks(open_camera: OpenCamera) -> None:
    before_ns = time.monotonic_ns()
    with open_camera() as camera:
        frames = [camera.read(5.0) for _ in range(COUNT)]
        assert camera.name
        assert {frame.depth_intrinsics for frame in frames} == {camera.depth_intrinsics}
    for clock in ("index", "t_camera_ns", "t_host_ns"):
        times = [getattr(frame, clock) for frame in frames]
        assert (np.diff(times) > 0).all(), clock
    assert before_ns < frames[0].t_host_ns
    assert frames[-1].t_host_ns < time.monotonic_ns()


def test_frames_show_something_and_keep_it(open_camera: OpenCamera) -> None:
    with open_camera() as camera:
        first = camera.read(5.0)
        copy = first.depth.copy()
        later = [camera.read(5.0) for _ in range(COUNT - 1)]
    assert first.depth.any()
    np.testing.assert_array_equal(first.depth, copy)  # though the camera went on, and was closed
    assert not np.array_equal(first.depth, later[-1].depth)
    assert 1e-5 < first.depth_scale_m < 1e-2
    with_color = [frame for frame in [first, *later] if frame.color is not None]
    assert with_color or isinstance(camera, HoloLens2RealSense)  # whose colour is not read
    for frame in with_color:
        assert np.linalg.det(frame.T_C_D[:3, :3]) == pytest.approx(1.0, abs=1e-5)
        assert np.linalg.norm(frame.T_C_D[:3, 3]) < 0.1


def test_a_camera_is_closed_once_and_for_all(open_camera: OpenCamera) -> None:
    with open_camera() as camera:
        camera.read(5.0)
    camera.close()
    with pytest.raises(CameraError, match="is closed; open it again") as raised:
        camera.read(0.1)
    assert not isinstance(raised.value, CameraTimeoutError | CameraEndError)


def test_a_camera_can_be_opened_again(open_camera: OpenCamera) -> None:
    for _ in range(2):
        with open_camera() as camera:
            assert camera.read(5.0).depth.any()


def test_a_camera_tells_which_device_it_is(open_camera: OpenCamera) -> None:
    with open_camera() as camera:
        simulated = CameraIdentity("Simulated camera", "simulated", "")
        others = {"Simulated camera": simulated, "Recording bag": CameraIdentity()}
        others["Orbbec Femto Bolt"] = CameraIdentity("Orbbec Femto Bolt", "AB1", "1.0.9")
        others["OAK-D Pro"] = CameraIdentity("OAK-D Pro", "18A")
        others[f"{NAME} on the HoloLens 2 at 127.0.0.1"] = CameraIdentity("Intel RealSense D415")
        others["HoloLens 2 AHAT at 127.0.0.1"] = CameraIdentity("HoloLens 2 AHAT")
        assert camera.identity == others.get(camera.name, D415)
