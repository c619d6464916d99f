"""The headset client without Unity, on the test runtime with Mesa's OpenGL on a virtual display."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handcal.core.conventions import opengl_transform
from handcal.core.display import projection_matrix
from handcal.core.geometry import invert, project, rigid, transform
from handcal.core.progress import Progress
from handcal.core.types import EYES, Eye, Float64, HeadsetIdentity, HeadsetView, Projection
from handcal.export.outcome import SessionOutcome
from handcal.io.files import read_json, write_json
from handcal.io.resources import resource_path
from handcal.lab.demo import DemoSettings, run_demo
from handcal.link import handcal_pb2 as pb
from handcal.link import messages
from handcal.link.client import HeadsetClient, HeadsetState
from handcal.link.nudges import NudgeSum, VerifyRequest
from handcal.link.pairing import Pairings
from handcal.link.server import Confirmation, HeadsetServer
from handcal.link.shapes import Shape, Target
from handcal.openxr_client.client import _Wearer, paired_identity
from handcal.openxr_client.drawing import BLUE, RED, clip_from_V, own_projection, strokes_of
from handcal.rig.example import example_rig
from tests.helpers import eventually
from tests.openxr.conftest import OWN_ANGLES, REQUIRE, own_views
from tests.openxr.worn_client import command, write_wearer

KEY = b"0123456789abcdef0123"
RIG = example_rig()
T_W_H = rigid([0.1, -0.2, 0.05], [0.3, -0.1, 0.2])
POINTS_H_M = np.array(
    [
        (z_m * x, z_m * y, z_m)
        for x in np.linspace(-0.14, 0.14, 8)
        for y in np.linspace(-0.02, 0.12, 5)
        for z_m in [0.6 + 0.1 * np.sin(50.0 * x + 20.0 * y)]
    ]
)
"""In the rig's head, at different depths, and apart on both displays."""

real = [
    pytest.mark.process,
    pytest.mark.skipif(
        not os.environ.get(REQUIRE) and not (find_spec("xr") and shutil.which("Xvfb")),
        reason="needs pip install 'handcal[openxr]' and apt-get install xvfb libgl1-mesa-dri",
    ),
]


def projection(
    eye: Eye, shift_m: tuple[float, float, float] = (0.004, -0.003, 0.006)
) -> Projection:
    display = RIG.eyes[eye]
    P = projection_matrix(display, shift_m)
    return Projection(eye, P, display.width_px, display.height_px, display.T_V_H)


def expected_px(eye: Eye) -> Float64:
    """Return where handcal's P draws the points, as the link carries them in steps of 0.1 mm."""
    carried = messages.cursor(transform(T_W_H, POINTS_H_M), 0).cursor.points
    points_H_m = transform(invert(T_W_H), messages.read_points(carried))
    return project(projection(eye).P, transform(RIG.eyes[eye].T_V_H, points_H_m))


class Server(HeadsetServer):
    """Keeps the poses as they came."""

    def __init__(self) -> None:
        self.came: dict[int, Float64] = {}
        super().__init__(KEY)

    def _take_poses(self, poses: pb.Poses) -> None:
        self.came.update(messages.read_poses(poses))
        super()._take_poses(poses)


class Headset:
    """The client's process with the test runtime, and the PC's end of the link."""

    def __init__(self, server: Server, folder: Path) -> None:
        self.server, self.folder = server, folder
        self.head = folder / "head"

    def images(self) -> dict[Eye, Any]:
        """Return the images (rows, columns, RGBA) of a frame from now, the highest row first."""
        for _ in range(2):  # the first may be of a frame that was drawn before
            (self.folder / "take").touch()
            eventually(lambda: not (self.folder / "take").exists(), 20.0)
        images: dict[Eye, Any] = {}
        for number, eye in enumerate(EYES):
            data = (self.folder / f"eye{number}").read_bytes()
            width, height = np.frombuffer(data[:8], np.uint32)
            images[eye] = np.frombuffer(data[8:], np.uint8).reshape(height, width, 4)[::-1]
        return images


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x800x24"]
    process = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as numbers:
        yield f":{numbers.readline().strip()}"
    process.terminate()
    process.wait()


@pytest.fixture
def environment(
    built: Path, display: str, tmp_path: Path, outcome: SessionOutcome, monkeypatch: Any
) -> None:
    """Set the environment of OpenXR programs on the test runtime."""
    runtime = {"library_path": str(built / "runtime.so"), "name": "test"}
    write_json(tmp_path / "runtime.json", {"file_format_version": "1.0.0", "runtime": runtime})
    for name, value in {
        "DISPLAY": display,
        "LIBGL_ALWAYS_SOFTWARE": "1",
        "XR_RUNTIME_JSON": tmp_path / "runtime.json",
        "XDG_CONFIG_HOME": tmp_path / "config",
        "XDG_DATA_HOME": tmp_path / "data",
        "HANDCAL_PAIRING_KEY": KEY.decode(),
        "TEST_VIEWS": " ".join(map(repr, own_views(outcome).ravel().tolist())),
        "TEST_CLOCK": "1",
        "TEST_IMAGES": tmp_path,
        "TEST_RECORD": tmp_path / "record.txt",
    }.items():
        monkeypatch.setenv(name, str(value))


@pytest.fixture
def headset(request: Any, environment: None, tmp_path: Path, monkeypatch: Any) -> Iterator[Headset]:
    with Server() as server:
        headset = Headset(server, tmp_path)
        if getattr(request, "param", "still") == "still":
            write_wearer(headset.head, T_W_H)
            monkeypatch.setenv("TEST_HEAD", str(headset.head))
        words = ["-m", "handcal", "openxr", "client", f"127.0.0.1:{server.address[1]}"]
        process = subprocess.Popen([sys.executable, *words], stderr=subprocess.PIPE, text=True)
        try:
            server.wait_connected(60.0)
            yield headset
        finally:
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=30.0)
        assert (process.returncode, errors) == (0, "")


def show(server: HeadsetServer) -> None:
    """Have the headset draw with a calibration, and the points as cursor, for the left eye only."""
    for eye in EYES:
        server.wait_acked(server.send_projection(projection(eye)), 5.0)
    server.wait_acked(server.send_cursor(transform(T_W_H, POINTS_H_M), 7, ("left",)), 5.0)


class TestOnTheRuntime:
    pytestmark = real

    def test_points_are_drawn_where_the_projection_says(self, headset: Headset) -> None:
        """Also the live hand's, whose colour says whether it is rotated too far."""
        show(headset.server)
        image = headset.images()
        assert not image["right"].any()
        assert_drawn(image["left"], expected_px("left"), (1.0, 1.0, 1.0))
        headset.server.send_cursor(np.empty((0, 3)), 7)
        for is_over, color in ((True, RED), (False, BLUE)):
            headset.server.send_live_hand(transform(T_W_H, POINTS_H_M), is_over)
            image = headset.images()
            for eye in EYES:
                assert_drawn(image[eye], expected_px(eye), color)

    @pytest.mark.parametrize("headset", ["moving"], indirect=True)
    def test_poses_are_the_runtimes_at_the_time_of_display(self, headset: Headset) -> None:
        eventually(lambda: len(headset.server.came) > 60, 20.0)
        came = dict(headset.server.came)
        device = headset.server.device
        assert device is not None
        T_H_V = invert(device.views["left"].T_V_H)
        checked = 0
        for line in (headset.folder / "record.txt").read_text().splitlines()[:-1]:
            word, seconds, view, *numbers = line.split()
            t_ns = round(float(seconds) * 1e9)
            near = [t for t in came if abs(t - t_ns) <= 1]  # the record has nine digits
            if word != "received" or view != "0" or len(numbers) < 22 or not near:
                continue
            own, got = np.array(numbers, float).reshape(2, 11)
            np.testing.assert_array_equal(got, own)  # what is submitted is the runtime's own
            T_W_V = opengl_transform(rigid(_matrix(own[:4]), own[4:7]))
            np.testing.assert_allclose(came[near[0]] @ T_H_V, T_W_V, atol=2e-6)
            checked += 1
        assert checked > 30
        ahead_s = 1e-9 * (max(came) - time.perf_counter_ns())
        assert ahead_s < 0.05  # on this machine's clock

    def test_a_press_confirms_what_is_drawn_then(self, headset: Headset) -> None:
        show(headset.server)
        eventually(lambda: headset.server.statistics().clock_offset_ms is not None)
        time.sleep(0.2)  # until it is drawn
        before_ns = time.monotonic_ns()
        write_wearer(headset.head, T_W_H, is_pressed=True)
        found: list[Confirmation] = []

        def has_come() -> bool:
            found.extend(headset.server.confirmations())
            return bool(found)

        eventually(has_come)
        write_wearer(headset.head, T_W_H)
        (confirmation,) = found
        assert (confirmation.cursor_id, confirmation.problem) == (7, "")
        assert -0.005 < 1e-9 * (confirmation.t_host_ns - before_ns) < 0.2

    def test_nothing_is_corrected_twice(
        self, run: Any, headset: Headset, calibration: dict[str, Any], tmp_path: Path
    ) -> None:
        """`run` has installed the layer before the client started."""
        write_json(tmp_path / "config/handcal/openxr.json", calibration)
        time.sleep(1.5)  # the layer reads it once a second
        show(headset.server)
        assert_drawn(headset.images()["left"], expected_px("left"), (1.0, 1.0, 1.0))
        status = read_json(tmp_path / "config/handcal/openxr-status.json")
        assert status["reason"] == "handcal openxr client corrects already"

    @pytest.mark.slow
    def test_a_calibration(
        self, environment: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        head = tmp_path / "head"
        write_wearer(head, np.eye(4))
        monkeypatch.setenv("TEST_HEAD", str(head))
        monkeypatch.setenv("TEST_SIZE_PX", "317")  # Mesa draws slowly
        monkeypatch.setattr("handcal.sim.simulation.program_command", lambda: command(head))
        rig = resource_path("example_rig.yaml")
        result = run_demo(DemoSettings(seed=3), rig, tmp_path / "sessions", Progress())
        error_arcmin = result["reprojection_arcmin"]
        assert error_arcmin["after"] < 0.5 * error_arcmin["before"]
        assert result["link"]["projection_acked"] == {"left": True, "right": True}


def assert_drawn(image: Any, wanted_px: Float64, color: tuple[float, float, float]) -> None:
    """Check that an image holds dots of a colour at these places, and nothing else."""
    count, labels, _, middles = cv2.connectedComponentsWithStats(
        (image[..., :3].max(axis=2) > 0).astype(np.uint8), connectivity=8
    )
    assert count - 1 == len(wanted_px)
    off_px = middles[1:, None] - wanted_px
    nearest_px = off_px[np.linalg.norm(off_px, axis=2).argmin(axis=0), range(len(wanted_px))]
    assert np.abs(nearest_px).max() <= 0.51  # a dot's middle is a pixel's
    assert np.abs(nearest_px.mean(axis=0)).max() <= 0.15
    np.testing.assert_allclose(
        image[labels > 0][:, :3], [255 * np.array(color)] * (labels > 0).sum(), atol=1
    )


def _matrix(quaternion_xyzw: Float64) -> Float64:
    return np.asarray(Rotation.from_quat(quaternion_xyzw).as_matrix())


def test_clip_space_is_where_the_pixels_are() -> None:
    """Without a graphics card: also outside the middle, and beside the runtime's own view."""
    view = own_view("left")
    for shown in (projection("left"), own_projection("left", view)):
        points = np.column_stack([POINTS_H_M, np.ones(len(POINTS_H_M))]).T
        x, y, _, w = clip_from_V(shown) @ points
        pixels = np.column_stack([(x / w + 1) * shown.width_px, (1 - y / w) * shown.height_px]) / 2
        np.testing.assert_allclose(pixels - 0.5, project(shown.P, POINTS_H_M), atol=1e-9)
    left, right, up, down = view.tangents
    edges = project(own_projection("left", view).P, np.array([[left, up, 1.0], [right, down, 1.0]]))
    np.testing.assert_allclose(edges, [[-0.5, -0.5], [1267.5, 719.5]], atol=1e-9)


def own_view(eye: Eye) -> HeadsetView:
    left, right, up, down = np.tan(OWN_ANGLES[eye])
    return HeadsetView(np.eye(4), np.array([left, right, -up, -down]), 1268, 720)


def test_each_eye_is_shown_its_own() -> None:
    corners = np.array([[0.0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    state = HeadsetState(
        cursor_W_m=POINTS_H_M,
        cursor_eyes=("right",),
        live_W_m=POINTS_H_M,
        live_eyes=("left",),
        is_outline=True,
        target=Target("left", corners),
        shape=Shape(np.vstack([corners, 2.0 * corners]), ("right",)),
    )
    left, right = (
        [(one.kind, len(one.points_m)) for one in strokes_of(state, eye)] for eye in EYES
    )
    assert left == [("loop", 40), ("loop", 4)]
    assert right == [("dots", 40), ("lines", 24)]
    assert [one.is_in_world for one in strokes_of(state, "left")] == [True, False]


class Pressed:
    """A runtime with presses and a confirmation, and the link's record of what was sent."""

    def __init__(self) -> None:
        self.presses: list[tuple[int, int, int]] = []
        self.confirmed_ns: int | None = None
        self.sent: list[tuple[Any, ...]] = []

    def take_presses(self) -> list[tuple[int, int, int]]:
        return self.presses

    def take_confirmation(self) -> int | None:
        return self.confirmed_ns

    def confirm(self, t_ns: int, state: HeadsetState) -> None:
        self.sent.append((t_ns, state.cursor_id))

    def nudge(self, t_ns: int, state: HeadsetState, moved: NudgeSum, fits: bool = False) -> None:
        self.sent.append((moved, fits))


def test_presses_are_summed_for_each_verification() -> None:
    there: Any = Pressed()
    wearer = _Wearer(there)
    there.presses = [(1, 0, 0), (0, -1, 1)]
    wearer.act(there)
    assert there.sent == []  # nothing to verify
    wearer.shown = HeadsetState(verify=VerifyRequest(3, "left", 2.0, 0.01))
    wearer.act(there)
    there.presses, there.confirmed_ns = [], 5
    wearer.act(there)
    assert there.sent == [(NudgeSum(2.0, -2.0, 0.01), False), (NudgeSum(2.0, -2.0, 0.01), True)]
    wearer.shown = HeadsetState(verify=VerifyRequest(4, "right"))
    wearer.act(there)
    assert there.sent[-1] == (NudgeSum(), True)
    wearer.shown = HeadsetState()
    wearer.act(there)
    assert len(there.sent) == 3  # no cursor to confirm
    wearer.shown = HeadsetState(cursor_W_m=POINTS_H_M, cursor_id=9)
    wearer.act(there)
    assert there.sent[-1] == (5, 9)


def test_the_headset_of_this_computer_needs_no_pairing(tmp_path: Path) -> None:
    file = tmp_path / "pairing.key"
    with HeadsetServer(Pairings.read(file)) as server:
        device_id, key = paired_identity(Pairings.read(file))
        with HeadsetClient(server.address, key, HeadsetIdentity(device_id)) as client:
            client.wait_connected(10.0)  # within a second, in which the PC reads its file again
    assert paired_identity(Pairings.read(file)) == (device_id, key)
