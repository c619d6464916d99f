"""The Unity component and the sample on stubs of Unity, against the real PC's end of the link."""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handcal.core.conventions import opengl_transform, pose
from handcal.core.display import projection_matrix, target_corners_m
from handcal.core.errors import PoseError
from handcal.core.geometry import invert, project, rigid, transform
from handcal.core.types import EYES, Eye, Float64, Projection
from handcal.link.nudges import NudgeSum, VerifyRequest
from handcal.link.pairing import Pairings
from handcal.link.server import Confirmation, HeadsetServer, Nudge
from handcal.link.shapes import Shape, Target
from handcal.rig.example import example_rig
from tests.headset.conftest import PACKAGE
from tests.headset.unity_player import PATIENCE_S, UnityPlayer, numbers
from tests.helpers import ROOT, eventually, unity_transform

pytestmark = pytest.mark.process
DEFINES = "HANDCAL_OPENXR_TIME;UNITY_WSA;ENABLE_LEGACY_INPUT_MANAGER;UNITY_2020_2_OR_NEWER"
SHIFT_M = (0.003, 0.001, 0.005)
SQUARE_M = np.array(
    [[x, y, 0.5] for x, y in ((-0.04, -0.03), (0.04, -0.03), (0.04, 0.05), (-0.04, 0.05))]
)

Start = Callable[..., UnityPlayer]


@pytest.fixture(scope="session")
def player(compiled: Callable[..., Path]) -> Path:
    folders = ("tests/headset/stubs", "tests/headset/player")
    package = (
        *map("Runtime/{}".format, ("", "Link", "MixedReality", "OpenXR")),
        "Samples~/Calibration",
    )
    sources = [*(ROOT / one for one in folders), *(PACKAGE / one for one in package)]
    return compiled("player.exe", *sources, defines=DEFINES)


@pytest.fixture(scope="session")
def library(player: Path) -> None:
    """Build the library of the native views, and a runtime, where the player finds them."""
    if shutil.which("gcc") is None or not Path("/usr/include/openxr/openxr.h").exists():
        pytest.skip("needs gcc and libopenxr-dev")
    for name, sources in (
        ("handcal_openxr", ("views.c", "unity.c")),
        ("unity_runtime", ("test/unity_runtime.c",)),
    ):
        paths = [str(ROOT / "resources/openxr" / source) for source in sources]
        command = ["gcc", "-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", *paths, "-lm"]
        command += ["-o", str(player.parent / f"lib{name}.so")]
        run = subprocess.run(command, capture_output=True, text=True)
        assert run.returncode == 0, run.stderr


@pytest.fixture
def start(player: Path, tmp_path: Path) -> Iterator[Start]:
    """Return a function that starts the app, whose folder it finds again."""
    started: list[UnityPlayer] = []

    def begin(**fields: str) -> UnityPlayer:
        started.append(UnityPlayer(player, tmp_path / "app", **fields))
        return started[-1]

    yield begin
    for app in started:
        app.close()


@pytest.fixture
def pairings(tmp_path: Path) -> Pairings:
    return Pairings((), tmp_path / "devices.json")


@pytest.fixture
def server(pairings: Pairings) -> Iterator[HeadsetServer]:
    with HeadsetServer(pairings) as server:
        yield server


@pytest.fixture
def app(start: Start, server: HeadsetServer) -> UnityPlayer:
    """Return an app that is paired and connected."""
    app = start(invitation=invitation(server))
    app.until(is_connected)
    return app


def confirmed(app: UnityPlayer, server: HeadsetServer) -> list[Confirmation]:
    """Return the confirmations once there are any."""
    confirmations: list[Confirmation] = []

    def is_confirmed(_: object) -> bool:
        confirmations.extend(server.confirmations())
        return bool(confirmations)

    app.until(is_confirmed)
    return confirmations


@cache
def invitation(server: HeadsetServer) -> str:
    """Return what the QR code of the first request says; an app pairs by it once."""
    return server.invite().text


def is_connected(told: Mapping[str, str]) -> bool:
    return told["connected"] == "True"


def faults(told: Mapping[str, str]) -> list[str]:
    """Return what the app logs, but for the missing speech of the stubs."""
    return [line for line in told["log"].split("|") if line and "spoken word" not in line]


def send_projections(server: HeadsetServer, wearer: str = "Ada") -> None:
    for eye, display in example_rig().eyes.items():
        size = display.width_px, display.height_px
        P, offline = projection_matrix(display, SHIFT_M), projection_matrix(display)
        server.send_projection(Projection(eye, P, *size, display.T_V_H, offline, wearer, "rig A"))


def test_digits_are_asked_for_until_they_are_right_and_then_never_again(
    start: Start, server: HeadsetServer
) -> None:
    host, port = server.address
    digits = server.invite().digits
    app = start()
    told = app.until(lambda told: told["keyboard"])
    assert "run handcal pair" in told["text"].replace("/", " ")
    app.do(f"type {host}")
    told = app.state(2)
    assert "is not understood" in told["text"].replace("/", " ")
    told = app.until(lambda told: told["keyboard"])
    assert told["keyboard"] == f"open:{host}"  # to be completed
    app.do(f"type {host}:{port} {(int(digits) + 1) % 10**8:08}")
    told = app.until(lambda told: "code is wrong" in told["text"].replace("/", " "))
    app.until(lambda told: told["keyboard"])
    app.do(f"type {host}:{port} {digits[:4]} {digits[4:]}")
    told = app.until(is_connected)
    assert (told["paired"], told["keyboard"]) == ("True", "")
    assert "Connected" in app.until(lambda told: told["text"])["text"]
    assert len(faults(told)) == 2  # the two mistakes
    eventually(lambda: server.device is not None, PATIENCE_S)
    assert server.device is not None
    assert server.device.name == "Stub 3"  # the model, as the device has no name
    app.close()
    eventually(lambda: not server.connected, PATIENCE_S)
    again = start()
    assert not again.until(is_connected)["keyboard"]


def test_an_invitation_with_digits_is_used_once(start: Start, server: HeadsetServer) -> None:
    host, port = server.address
    text = f"{host}:{port} {server.invite().digits}"
    app = start(invitation=text)
    app.until(is_connected)
    app.close()
    told = start(invitation=text).until(is_connected)
    assert faults(told) == []


def test_a_name_that_is_none_is_said(start: Start) -> None:
    app = start()
    app.until(lambda told: told["keyboard"])
    app.do(f"type {'x' * 300} 12345678")
    told = app.until(lambda told: "cannot be reached" in told["text"].replace("/", " "))
    assert (told["paired"], len(faults(told))) == ("False", 1)


@pytest.mark.parametrize("parent", [None, (1.5, -0.3, 2.0, 0.9, 0.0, 0.3, 0.1, 2.5)])
def test_points_are_drawn_where_the_eye_needs_them(
    start: Start, server: HeadsetServer, parent: tuple[float, ...] | None
) -> None:
    """The space of the camera's parent may be moved, turned and scaled."""
    app = start(invitation=invitation(server))
    T_unity = rigid([0.2, -0.4, 0.1], [0.3, 1.6, -0.7])
    quaternion = Rotation.from_matrix(T_unity[:3, :3]).as_quat()
    app.place("head", [*T_unity[:3, 3], *quaternion])
    if parent is not None:
        turn = np.array(parent[3:7]) / np.linalg.norm(parent[3:7])
        app.place("parent", [*parent[:3], *turn, parent[7]])
    T_W_H = unity_transform(T_unity)
    square_W = transform(T_W_H, SQUARE_M)
    app.until(is_connected)
    send_projections(server)
    server.send_shape(Shape(square_W))
    server.send_cursor(square_W, 1)
    told = app.until(lambda told: told["shape"] and told["cursor"] and told["wearer"] == "Ada")
    for number, eye in enumerate(EYES):
        display = example_rig().eyes[eye]
        P = projection_matrix(display, SHIFT_M)
        expected_px = project(P, transform(display.T_V_H, SQUARE_M))
        clip = numbers(told[f"projection{number}"]).reshape(4, 4)
        assert clip[3].tolist() == [0, 0, -1, 0]  # else shaders take it for orthographic
        clip = clip @ numbers(told[f"view{number}"]).reshape(4, 4)
        # All that an eye sees is in the frustum of culling, which is not much wider.
        corners = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1], [1]), -1).reshape(-1, 4)
        seen = corners @ np.linalg.inv(clip).T
        culled = seen @ numbers(told["culling"]).reshape(4, 4).T
        reach = np.abs(culled[:, :3] / culled[:, 3:]).max(axis=0)
        assert ((reach > [0.9, 0.7, 0.9]) & (reach < 1)).all()
        for what, most_px in (("shape", 0.01), ("cursor", 0.3)):  # float32; quanta of 0.1 mm
            world = numbers(told[what]).reshape(-1, 3)
            found = np.column_stack([world, np.ones(4)]) @ clip.T
            ndc = found[:, :3] / found[:, 3:]
            assert (np.abs(ndc[:, 2]) < 1).all()  # between the camera's planes
            found_px = (
                0.5 * (1 + ndc[:, :2] * [1, -1]) * [display.width_px, display.height_px] - 0.5
            )
            np.testing.assert_allclose(found_px, expected_px, atol=most_px)
    # The focus plane is before the head, at the virtual image's distance, in the world.
    display = example_rig().eyes["left"]
    distance_m = display.z_C0_S_m - display.t_C0_V_m[2]
    clip = numbers(told["view0"]).reshape(4, 4)
    in_V = (clip @ [*numbers(told["focus"]), 1.0])[:3]
    P = projection_matrix(display, SHIFT_M)
    in_V = in_V * [1, -1, -1] - np.linalg.solve(P[:, :3], P[:, 3])
    in_H = display.T_V_H[:3, :3].T @ (in_V - display.T_V_H[:3, 3])
    np.testing.assert_allclose(in_H, [0, 0, distance_m], atol=1e-3)
    # HoloLens 2 takes it under OpenXR by another call in each frame, of each pipeline.
    mode, *plane = told["reprojection"].split()
    assert mode == "PlanarManual"
    np.testing.assert_array_equal(numbers(" ".join(plane[:3])), numbers(told["focus"]))
    assert np.linalg.norm(numbers(" ".join(plane[3:]))) == pytest.approx(1, abs=1e-6)
    app.do("pipeline")
    assert app.state()["reprojection"] == told["reprojection"]
    assert faults(told) == []
    app.do("set setsFocusPlane=false")
    assert "PlanarManual" not in app.state()["reprojection"]


def test_the_target_is_drawn_where_the_eye_needs_it(
    app: UnityPlayer, server: HeadsetServer
) -> None:
    """It is fixed in V, while the view that is drawn with has the eye at its origin."""
    corners_V_m = target_corners_m(0.5)
    server.send_target(Target("right", corners_V_m))
    display = example_rig().eyes["right"]
    size = display.width_px, display.height_px
    for shift_m in (SHIFT_M, (-0.002, 0.004, -0.003)):
        P = projection_matrix(display, shift_m)
        server.send_projection(Projection("right", P, *size, display.T_V_H, P, "Ada", "rig A"))
        expected_px = project(P, corners_V_m)

        def is_there(told: Mapping[str, str], expected_px: Float64 = expected_px) -> bool:
            in_view = numbers(told["target"]).reshape(-1, 3)
            if len(in_view) != 4:
                return False
            clip = np.column_stack([in_view, np.ones(4)])
            clip = clip @ numbers(told["projection1"]).reshape(4, 4).T
            ndc = clip[:, :2] / clip[:, 3:] * [1, -1]
            return bool(np.abs(0.5 * (1 + ndc) * size - 0.5 - expected_px).max() < 0.01)

        app.until(is_there)


def test_a_calibration_by_keys(app: UnityPlayer, server: HeadsetServer) -> None:
    send_projections(server)
    server.send_cursor(SQUARE_M, 7)
    server.send_prompt("Cover the blue hand with your own, then say confirm or press the trigger.")
    told = app.until(
        lambda told: told["cursor"] and told["wearer"] == "Ada" and "Cover" in told["text"]
    )
    assert max(map(len, told["text"].split("/"))) <= 32
    app.do("press Space")
    confirmations = confirmed(app, server)
    assert [(one.cursor_id, one.problem) for one in confirmations] == [(7, "")]

    server.send_cursor(np.zeros((0, 3)), 8)
    server.send_verify(VerifyRequest(3, "right", 1.0, 0.002))
    app.until(lambda told: not told["cursor"])
    nudges: list[Nudge] = []

    def is_nudged(order: str) -> bool:
        app.do(order)  # again, since the request may come after the cursor's removal
        nudges.extend(server.nudges())
        return bool(nudges)

    app.until(lambda _: is_nudged("press RightArrow"))
    app.until(lambda _: is_nudged("press Return") and nudges[-1].fits)
    last = nudges[-1]
    assert last.problem == ""
    assert last.moved.right_arcmin > 0
    assert (last.moved.down_arcmin, last.moved.size) == (0.0, 0.0)


@pytest.mark.parametrize(
    "gesture",
    ["TriggerButton", "left PrimaryButton", "right PointerActivated", "right PinchTouched"],
)
def test_a_hand_confirms_and_never_nudges(
    app: UnityPlayer, server: HeadsetServer, gesture: str
) -> None:
    """An air tap of HoloLens 2 is its hand's primary button, which enlarges on a controller."""
    server.send_cursor(SQUARE_M, 7)
    app.until(lambda told: told["cursor"])
    app.do("hold left GripButton", "hold right SecondaryButton", f"hold {gesture}", "frames 5")
    confirmations = confirmed(app, server)
    server.send_verify(VerifyRequest(3, "right", 1.0, 0.002))
    nudges: list[Nudge] = []

    def is_nudged(_: object) -> bool:
        app.do(f"release {gesture}", "frames 2", f"hold {gesture}")
        nudges.extend(server.nudges())
        return bool(nudges)

    app.until(is_nudged)
    assert all(nudge.fits and nudge.moved == NudgeSum() for nudge in nudges)
    assert len(confirmations + server.confirmations()) == 1


def test_the_calibration_is_kept_when_the_app_and_the_pc_are_gone(
    start: Start, pairings: Pairings
) -> None:
    with HeadsetServer(pairings) as server:
        app = start(invitation=invitation(server))
        app.until(is_connected)
        send_projections(server, "Bea")
        app.until(lambda told: told["wearer"] == "Bea")
        send_projections(server, "Ada")
        shown = app.until(lambda told: told["wearer"] == "Ada" and told["kept"] == "Ada,Bea")
        app.close()
    again = start()
    told = again.state(2)
    assert (told["wearer"], told["kept"]) == ("Ada", "Ada,Bea")
    assert told["projection1"] == shown["projection1"]
    assert "calibration of Ada" in told["text"].replace("/", " ")
    again.do("kept Bea")
    assert again.until(lambda told: told["wearer"] == "Bea")["kept"] == "Bea,Ada"


@pytest.mark.parametrize(
    ("order", "said"), [("pipeline", "scriptable render pipeline"), ("single", "single pass")]
)
def test_settings_that_make_a_calibration_worthless_are_said_in_view(
    start: Start, order: str, said: str
) -> None:
    app = start()
    app.do(order)
    told = app.state(2)
    assert said in told["text"].replace("/", " ")
    assert said in told["warning"]
    assert len(faults(app.state(3))) == 1  # said once


def test_a_pose_is_stamped_with_the_time_that_the_runtime_predicts(
    app: UnityPlayer, server: HeadsetServer
) -> None:

    app.state(30)
    assert not is_ahead(server)
    app.do("ahead 40")
    app.until(lambda _: is_ahead(server))


def test_the_runtime_s_views_are_told_as_they_are_now(start: Start, server: HeadsetServer) -> None:
    app = start(invitation=invitation(server))
    app.place("eyes", [0.0630])
    app.until(is_connected)
    app.state(70)  # more than a second of identities
    assert server.device is not None
    assert not server.device.views
    send_projections(server)
    app.until(lambda told: told["wearer"] == "Ada")
    for right, up in ((0.4, 0.3), (0.5, 0.35)):
        app.place("edges", [right, up])

        def is_reported(_: object, right: float = right, up: float = up) -> bool:
            edges = [-right, right, -up, up]
            views = () if server.device is None else server.device.views.values()
            found = [
                (view.width_px, np.allclose(view.tangents, edges, atol=1e-6)) for view in views
            ]
            return found == [(1440, True)] * 2

        app.until(is_reported)


def test_a_view_that_moves_is_said_once(start: Start) -> None:
    app = start()
    app.place("edges", [0.4, 0.3])
    app.place("eyes", [0.0630])
    app.state(2)
    app.place("eyes", [0.0650])
    told = app.until(lambda told: told["warning"])
    assert "has moved its view by 1" in told["warning"]
    assert "moved" not in told["text"]


def test_a_cursor_is_hidden_from_the_other_eye(app: UnityPlayer, server: HeadsetServer) -> None:
    send_projections(server)
    # The third is as from an older PC: for both eyes.
    shown: list[tuple[Eye, ...]] = [("left",), ("right",), (), EYES]
    for number, eyes in enumerate(shown, 1):
        server.send_cursor(number * SQUARE_M, number, eyes)
        hidden = [bool(eyes) and eye not in eyes for eye in EYES]

        def is_so(told: Mapping[str, str], hidden: list[bool] = hidden) -> bool:
            found = ["cursor" in told[f"hidden{at}"].split(",") for at in range(2)]
            return bool(told["cursor"]) and found == hidden

        app.until(is_so)
    assert faults(app.state()) == []


def test_live_hands_of_any_size_are_drawn(app: UnityPlayer, server: HeadsetServer) -> None:
    for count in (50, 800, 20, 21, 0, 5):
        outline = np.random.default_rng(count).normal(0.0, 0.05, (count, 3))

        def is_drawn(told: Mapping[str, str], hand: Float64 = outline) -> bool:
            server.send_live_hand(hand, False, ("left",), is_outline=True)
            return len(numbers(told["live hand"])) == hand.size

        app.until(is_drawn)
    assert faults(app.state()) == []


def test_a_disabled_component_leaves_nothing_and_comes_back(
    app: UnityPlayer, server: HeadsetServer
) -> None:
    send_projections(server)
    app.until(lambda told: told["wearer"] == "Ada")
    app.do("disable")
    told = app.state()
    assert (told["connected"], told["text"]) == ("False", "")
    assert "cursor" not in told
    assert numbers(told["projection0"])[0] == 1.0  # the runtime's own
    assert not numbers(told["culling"]).any()
    eventually(lambda: not server.connected, PATIENCE_S)
    app.do("enable")
    app.until(is_connected)


@pytest.mark.parametrize(
    "content",
    [
        "",
        "x",
        "f" * 17 + "\nh\n1\nQUJD",
        "00\nhost\n99999999999\nQUJD",
        "00\nhost\n1\nQUJD",
        "00\nh\n1\n?",
    ],
)
def test_a_damaged_pairing_is_said_and_asked_for_again(
    start: Start, tmp_path: Path, content: str
) -> None:
    (tmp_path / "app").mkdir()
    (tmp_path / "app/handcal-pairing.txt").write_text(content)
    (tmp_path / "app/handcal-calibrations.bin").write_bytes(b"\xff" * 9)
    app = start()
    told = app.until(lambda told: told["keyboard"])
    assert told["paired"] == "False"
    assert [line[:16] for line in faults(told)] == ["handcal: The pai", "handcal: The kep"]
    assert told["warning"]


def test_an_app_that_cannot_write_says_so_and_is_paired(
    start: Start, tmp_path: Path, server: HeadsetServer
) -> None:
    (tmp_path / "app/handcal-pairing.txt.part").mkdir(parents=True)
    told = start(invitation=invitation(server)).until(is_connected)
    assert "Cannot write" in told["warning"]


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize(("native", "wider_m"), [("stays", 0.0), ("moves", 0.004)])
def test_the_openxr_plug_in_draws_with_the_calibration_in_every_pipeline(
    start: Start, server: HeadsetServer, native: str, wider_m: float
) -> None:
    """Unity gets the calibrated views, and the runtime its own, whatever the head does."""
    app = start(invitation=invitation(server), native=native)
    own_H = np.reshape(own_views(wider_m), (2, 11))
    app.place("own", own_H.ravel())
    app.do("pipeline", "single")
    app.until(is_connected)
    send_projections(server)
    app.until(lambda told: told["wearer"] == "Ada")
    for _ in range(20):
        told = app.state()
        given, received, own = numbers(told["native"]).reshape(3, 2, 11)
        np.testing.assert_array_equal(received, own)
        for number, eye in enumerate(EYES):
            display = example_rig().eyes[eye]
            T_W_H = at(own[number]) @ invert(at(own_H[number]))
            T_W_V = T_W_H @ opengl_transform(invert(display.T_V_H))
            seen_m = transform(invert(at(given[number])) @ T_W_V, SQUARE_M * [1, -1, -1])
            left, right, up, down = np.tan(given[number, 7:])
            share = (seen_m[:, :2] / -seen_m[:, 2:] - [left, up]) / [right - left, down - up]
            pixels = share * [display.width_px, display.height_px] - 0.5
            P = projection_matrix(display, SHIFT_M)
            np.testing.assert_allclose(pixels, project(P, SQUARE_M), atol=0.01)
    assert told["layer"] == "1"  # switched off: it would correct as well
    assert numbers(told["projection0"])[0] == 0.0  # the camera is left alone
    assert told["warning"] == ""
    app.until(lambda _: server.device is not None and len(server.device.views) == 2)
    assert server.device is not None
    for eye, view in server.device.views.items():
        T_H_V = opengl_transform(at(own_H[EYES.index(eye)]))
        np.testing.assert_allclose(view.T_V_H, invert(T_H_V), atol=1e-6)
        np.testing.assert_allclose(view.tangents, [-0.4, 0.5, -0.3, 0.2], atol=1e-6)
    app.until(lambda _: is_ahead(server))
    assert faults(told) == []
    app.do("disable")
    given, _, own = numbers(app.state(2)["native"]).reshape(3, 2, 11)
    np.testing.assert_array_equal(given, own)


@pytest.mark.usefixtures("library")
def test_views_that_are_not_the_rig_s_are_refused_in_view(
    start: Start, server: HeadsetServer
) -> None:
    app = start(invitation=invitation(server), native="stays")
    app.place("own", own_views(wider_m=0.004))
    app.until(is_connected)
    send_projections(server)
    told = app.until(lambda told: "4.0 mm" in told["text"].replace("/", " "))
    given, _, own = numbers(told["native"]).reshape(3, 2, 11)
    np.testing.assert_array_equal(given, own)
    app.place("own", own_views())
    told = app.until(lambda told: "mm" not in told["text"])
    assert (told["warning"], len(faults(told))) == ("", 1)


def test_without_the_library_the_cameras_are_set_and_it_is_said(
    player: Path, server: HeadsetServer, tmp_path: Path
) -> None:
    alone = Path(shutil.copy(player, tmp_path))  # libraries are looked for beside it
    with UnityPlayer(alone, tmp_path / "app", invitation=invitation(server), native="stays") as app:
        app.until(is_connected)
        send_projections(server)
        told = app.until(lambda told: told["wearer"] == "Ada")
        assert "library handcal_openxr is missing" in told["log"]
        assert numbers(told["projection0"])[14] == -1.0


def own_views(wider_m: float = 0.0) -> list[float]:
    """Return the rig's views in the head for OpenXR, perhaps farther apart: poses and angles."""
    found: list[float] = []
    for eye in EYES:
        T_H_V = opengl_transform(invert(example_rig().eyes[eye].T_V_H))
        one = pose(T_H_V)
        apart_m = [wider_m * (eye == "right"), 0.0, 0.0]
        fov_rad = np.arctan([-0.4, 0.5, 0.3, -0.2])
        found += [*one.quaternion_xyzw, *(one.position_m + apart_m), *fov_rad]
    return found


def at(view: Float64) -> Float64:
    """Return the transform of a view's pose, from the view to its space."""
    return rigid(Rotation.from_quat(view[:4]).as_rotvec(), view[4:7])


def is_ahead(server: HeadsetServer) -> bool:
    """Return whether the PC knows a pose for a time that is still to come."""
    try:
        server.pose_at_host_ns(time.monotonic_ns() + 20_000_000)
    except PoseError:
        return False
    return True
