"""The virtual headset over real datagrams: in a process of its own, and its endings."""

import os
import queue
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handcal.core.display import projection_matrix
from handcal.core.errors import LinkError, PosePendingError
from handcal.core.geometry import invert, transform
from handcal.core.types import EYES, Eye, Float64, Projection
from handcal.io.resources import resource_path
from handcal.link.client import HeadsetState
from handcal.link.pairing import KEY_VARIABLE
from handcal.link.reliable import Delivery
from handcal.link.server import Confirmation, HeadsetServer
from handcal.rig.rig_file import read_rig
from handcal.sim.hand import make_hand
from handcal.sim.headset import HeadsetSettings, _view, run_headset
from handcal.sim.scene import SceneReceiver, SceneState
from tests.sim.rims import rim_outline

KEY = "a pairing key of the tests"
RIG_PATH = resource_path("example_rig.yaml")
PROGRAM = """
import sys
from handcal.link.impair import Impairment
from handcal.link.pairing import read_pairing_key
from handcal.sim.headset import HeadsetSettings, run_headset, until_terminated
rig, port, scene_port = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
bad = Impairment(loss=0.3, reorder=0.1, duplicate=0.1)
run_headset(
    HeadsetSettings(rig, port, scene_port, seed=1, impairment=bad),
    read_pairing_key(),
    until_terminated(),
)
"""


def wait_for(ask: Callable[[], Any], timeout_s: float = 30.0) -> Any:
    """Ask until the answer is not None."""
    end_s = time.monotonic() + timeout_s
    while (answer := ask()) is None:
        assert time.monotonic() < end_s, "no answer in time"
        time.sleep(0.005)
    return answer


def raised(light: SceneReceiver) -> SceneState | None:
    """Return the state in which the hand is up and at rest; None before."""
    before = light.latest()
    time.sleep(0.1)
    after = light.latest()
    if before is None or after is None or before.T_W_hand is None or after.T_W_hand is None:
        return None
    moved_m = np.linalg.norm(after.T_W_hand[:3, 3] - before.T_W_hand[:3, 3])
    is_up = (invert(after.T_W_D) @ after.T_W_hand)[1, 3] < 0.2
    return after if is_up and moved_m < 0.001 else None


@pytest.fixture
def server() -> Iterator[HeadsetServer]:
    with HeadsetServer(KEY.encode()) as server:
        yield server


@pytest.fixture
def light() -> Iterator[SceneReceiver]:
    with SceneReceiver() as light:
        yield light


@pytest.fixture
def process(server: HeadsetServer, light: SceneReceiver) -> Iterator[subprocess.Popen[bytes]]:
    arguments = [str(RIG_PATH), str(server.address[1]), str(light.port)]
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *arguments], env={**os.environ, KEY_VARIABLE: KEY}
    ) as process:
        yield process
        process.kill()


def test_a_wearer_in_another_process_aligns_and_confirms(
    server: HeadsetServer, light: SceneReceiver, process: subprocess.Popen[bytes]
) -> None:
    server.wait_connected(20.0)
    state: SceneState = wait_for(lambda: raised(light))
    assert state.T_W_hand is not None
    rig = read_rig(RIG_PATH)
    for eye, display in rig.eyes.items():
        P, size = projection_matrix(display), (display.width_px, display.height_px)
        server.send_projection(Projection(eye, P, *size, display.T_V_H))
    rim_m = rim_outline(make_hand(1), invert(state.T_W_D) @ state.T_W_hand)[::10]
    server.wait_acked(server.send_cursor(transform(state.T_W_D, rim_m), cursor_id=1), 5.0)
    confirmation: Confirmation = wait_for(lambda: next(iter(server.confirmations()), None))
    assert confirmation.cursor_id == 1
    assert abs(time.monotonic_ns() - confirmation.t_host_ns) < 1e9

    assert confirmation.problem == ""
    device = wait_for(lambda: server.device)
    assert device.name == "Virtual headset"
    for eye in EYES:
        np.testing.assert_array_equal(device.views[eye].T_V_H, rig.eyes[eye].T_V_H)
        assert device.views[eye].width_px == rig.eyes[eye].width_px
    T_W_H = wait_for(light.latest).T_W_D @ invert(rig.T_H_D)  # the head hardly moves

    def pose_then() -> Float64 | None:
        with suppress(PosePendingError):  # poses are only interpolated
            return server.pose_at_host_ns(confirmation.t_host_ns)
        return None

    pose = wait_for(pose_then)
    np.testing.assert_allclose(pose, T_W_H, atol=0.03)
    wait_for(lambda: server.statistics().pose_rate_hz > 20.0 or None)
    statistics = server.statistics()
    assert statistics.clock_offset_ms == pytest.approx(12345.0, abs=2.0)
    assert statistics.lost_inbound > 0

    process.send_signal(signal.SIGTERM)
    assert process.wait(5.0) == 0
    wait_for(lambda: not server.connected or None)


@pytest.fixture
def settings(server: HeadsetServer, light: SceneReceiver) -> HeadsetSettings:
    return HeadsetSettings(str(RIG_PATH), server.address[1], light.port, patience_s=0.3)


def test_a_device_without_a_wearer_shows_and_confirms_on_enter(
    server: HeadsetServer, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    presses: queue.SimpleQueue[str] = queue.SimpleQueue()
    monkeypatch.setattr("sys.stdin", iter(presses.get, ""))
    settings = HeadsetSettings(str(RIG_PATH), server.address[1], has_wearer=False)
    heard: list[Confirmation] = []
    for eye in EYES:
        server.send_projection(Projection(eye, np.eye(3, 4), 9, 8))
    cursor = server.send_cursor(np.zeros((1, 3)), 3, ["left"])

    def is_stopped() -> bool:
        if cursor.state is Delivery.ACKED:
            presses.put("\n")
            heard.extend(server.confirmations())
        return bool(heard)

    run_headset(replace(settings, duration_s=10.0), KEY.encode(), is_stopped)
    presses.put("")
    assert (heard[0].cursor_id, heard[0].problem) == (3, "")
    assert (
        "left and right; cursor 3 of the left eye; open: left and right" in capsys.readouterr().out
    )


@pytest.mark.parametrize(
    ("is_open", "cursor_eyes", "seeing"),
    [
        (EYES, EYES, EYES),
        (EYES, ("left",), ("left",)),
        (("right",), EYES, ("right",)),
        (("right",), ("left",), ()),
    ],
)
def test_a_wearer_sees_a_cursor_only_in_the_open_eyes_that_draw_it(
    is_open: tuple[Eye, ...], cursor_eyes: tuple[Eye, ...], seeing: tuple[Eye, ...]
) -> None:
    rig = read_rig(RIG_PATH)
    state = HeadsetState(
        cursor_W_m=np.zeros((1, 3)),
        cursor_eyes=cursor_eyes,
        eyes=is_open,
        projections={eye: Projection(eye, np.eye(3, 4), 9, 8) for eye in EYES},
    )
    view = _view(state, rig, 0.0)
    assert (view.cursor_W_m is not None, view.eyes) == (bool(seeing), seeing)
    assert _view(replace(state, cursor_W_m=None), rig, 0.0).eyes == is_open


def test_it_ends_when_the_pc_says_good_bye(
    settings: HeadsetSettings, server: HeadsetServer
) -> None:
    connected = []

    def is_stopped() -> bool:
        if server.connected:
            connected.append(True)
            server.close()
        return False

    run_headset(settings, KEY.encode(), is_stopped)
    assert connected


def test_nobody_answering_is_one_clear_line(settings: HeadsetSettings) -> None:
    with pytest.raises(LinkError, match="no PC answered") as error:
        run_headset(settings, b"a pairing key of somebody else", lambda: False)
    assert "\n" not in str(error.value)
