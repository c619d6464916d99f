"""Reports on a headset: its state, what is wrong with it, and the stamps of its poses."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from handcal.core.errors import HandcalError, PoseError
from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import (
    DisplayCheck,
    Float64,
    Frame,
    HeadsetIdentity,
    HeadsetView,
    Intrinsics,
)
from handcal.link.client import HeadsetClient
from handcal.link.server import HeadsetServer
from handcal.link.statistics import LinkStatistics
from handcal.link.wire import VERSION
from handcal.rig.example import example_rig
from handcal.sim.camera import SyntheticCamera, SyntheticSettings
from handcal.sim.hand import make_hand
from handcal.sim.render import World
from handcal.sim.room import make_room
from handcal.sim.scene import SceneState
from handcal.station.checks import doctor
from handcal.station.checks.doctor import Health, examine_headset
from handcal.station.checks.headset import headset_problem, headset_state, link_problem
from handcal.station.poses import find_pose_delay, run_pose_delay

KEY = b"a pairing key of the tests"
RIG = example_rig()
DEVICE = HeadsetIdentity("c" * 16, "Lab 9", "runtime 1", "app 3", VERSION)
GOOD = LinkStatistics(
    connected=True, sent=1000, received=1000, lost=1, lost_inbound=2, resent=0, acked=9, unacked=0,
    failed=0, rejected={}, pose_rate_hz=60.2, latency_ms=3.0, clock_offset_ms=5.0,
    clock_drift_ppm=1.0, clock_drift_uncertainty_ppm=1.0, clock_uncertainty_ms=0.1,
    bytes_sent=0, bytes_received=0,
)  # fmt: skip
ABSENT = replace(GOOD, connected=False)
BACKWARD = HeadsetView(
    np.diag([-1.0, 1.0, -1.0, 1.0]), np.array([-0.3, 0.3, -0.17, 0.17]), 1268, 720
)
VIEW = HeadsetView(np.eye(4), np.array([-0.3, 0.3, -0.2, 0.2]), 1440, 936)


def test_a_good_headset_is_described_by_name() -> None:
    assert headset_problem(DEVICE, GOOD, RIG) == ""
    assert headset_state(DEVICE, GOOD) == (
        "Lab 9 (runtime 1, app 3, protocol 2): 60 poses/s, latency 3.0 ms, lost 0 % to it and 0 % "
        "from it, clock ± 0.10 ms"
    )
    unknown = replace(GOOD, latency_ms=None, clock_uncertainty_ms=None)
    assert "unnamed headset (not introduced)" in headset_state(None, unknown)


@pytest.mark.parametrize(
    ("device", "link", "problem"),
    [
        (DEVICE, replace(ABSENT, notice="headset B asks; A is connected"), "B asks"),
        (
            DEVICE,
            replace(ABSENT, rejected={"wrong_version": 1}),
            "not speak protocol 2 tried to; update it",
        ),
        (DEVICE, replace(ABSENT, rejected={"unpaired": 3}), "pair it with handcal pair"),
        (DEVICE, replace(ABSENT, rejected={"corrupt": 3}), "not from a headset app"),
        (None, ABSENT, "nothing arrives; check the address"),
        (None, GOOD, "not introduced itself"),
        (replace(DEVICE, protocol=1), GOOD, "protocol 1, not 2"),
        (DEVICE, replace(GOOD, pose_rate_hz=0.0), "sends no poses"),
        (DEVICE, replace(GOOD, failed=2), "did not acknowledge 2 messages"),
        (DEVICE, replace(GOOD, lost=400), "loses many datagrams"),
        (DEVICE, replace(GOOD, lost_inbound=400), "loses many datagrams"),
        (DEVICE, replace(GOOD, latency_ms=90.0), "network is slow"),
        (DEVICE, replace(GOOD, pose_rate_hz=30.0), "fewer than 60 poses"),
        (DEVICE, replace(GOOD, clock_uncertainty_ms=None), "clock is not known well"),
        (replace(DEVICE, views={"left": VIEW}), GOOD, "1440×936 px, the rig's 1268×720"),
        (
            replace(DEVICE, views={"left": BACKWARD}),
            GOOD,
            "left.T_V_H: the rendering camera looks 180° away",
        ),
    ],
)
def test_what_is_wrong_is_one_sentence(
    device: HeadsetIdentity | None, link: LinkStatistics, problem: str
) -> None:
    said = headset_problem(device, link, RIG)
    assert problem in said
    assert "\n" not in said


def test_an_app_of_another_version_is_named_while_no_headset_is_connected() -> None:
    other, address = {"wrong_version": 1}, ("10.0.0.2", 50_000)
    assert link_problem(ABSENT, address).endswith("with the pairing key")
    said = link_problem(replace(ABSENT, rejected=other), address)
    assert said.startswith(link_problem(ABSENT, address))
    assert said.endswith("; an app that does not speak protocol 2 tried to; update it, or handcal")
    assert link_problem(replace(GOOD, rejected=other), address) == ""


def test_another_headset_or_app_than_the_rigs_is_said() -> None:
    other = replace(RIG, headset=HeadsetIdentity("d" * 16))
    assert "not the rig's headset" in headset_problem(DEVICE, GOOD, other)
    check = DisplayCheck("today", "camera", "c" * 16, "runtime 1", "app 2", {"left": ""})
    changed = replace(RIG, display_check=check)
    assert "changed since the display check" in headset_problem(DEVICE, GOOD, changed)
    same = replace(RIG, display_check=replace(check, app="app 3"))
    assert headset_problem(DEVICE, GOOD, same) == ""


def head(t_s: float) -> Float64:
    """Return T_W_H of a head that turns left and right."""
    return rigid([0.0, 0.1 * np.sin(5.0 * t_s), 0.0], [0.01 * np.sin(3.0 * t_s), 0.0, 0.0])


@pytest.mark.parametrize("delay_s", [-0.05, 0.0, 0.0325, 0.1])
@pytest.mark.parametrize("sigma_m", [0.0, 0.001])
def test_the_error_of_the_stamps_is_found(delay_s: float, sigma_m: float) -> None:
    rng = np.random.default_rng(1)
    hand_W_m = RIG.T_H_D[:3, :3] @ np.array([0.02, 0.03, 0.5])
    seen = []
    for number in range(150):
        t_s = 10.0 + number / 30
        place = transform(invert(head(t_s) @ RIG.T_H_D), hand_W_m[None])[0]
        seen.append((round(1e9 * t_s), place + rng.normal(0.0, sigma_m, 3)))
    # The pose with the stamp t is for t + delay.
    found = find_pose_delay(seen, lambda t_ns: head(1e-9 * t_ns + delay_s), RIG.T_H_D)
    assert found is not None
    assert found.delay_s == pytest.approx(delay_s, abs=max(3.0 * found.sigma_s, 0.0005))
    assert found.sigma_s < 0.002
    assert found.is_wrong == (abs(delay_s) > 0.02)


def test_a_head_at_rest_or_a_hand_not_seen_tells_nothing() -> None:
    rng = np.random.default_rng(1)
    places_m = rng.normal([0.0, 0.0, 0.5], 0.001, (150, 3))
    still = [(number * 33_000_000, place_m) for number, place_m in enumerate(places_m)]
    assert find_pose_delay(still, lambda _: np.eye(4), RIG.T_H_D) is None
    assert find_pose_delay(still[:20], lambda t_ns: head(1e-9 * t_ns), RIG.T_H_D) is None

    def unknown(_: int) -> Float64:
        raise PoseError("no pose")

    assert find_pose_delay(still, unknown, RIG.T_H_D) is None


LATENCY_S = 0.03
POSE_NS = 1_000_000_000 // 60
FRAMES = 50


class PunctualCamera(SyntheticCamera):
    """A camera whose frames arrive at once, however long the simulation renders."""

    frames = 0

    def read(self, timeout_s: float = 1.0) -> Frame:
        frame = super().read(timeout_s)
        self.frames += 1
        return replace(frame, t_host_ns=frame.t_camera_ns + round(1e9 * LATENCY_S))


@contextmanager
def turning_head(delay_s: float) -> Iterator[tuple[HeadsetServer, PunctualCamera]]:
    """Run a headset whose poses are for `delay_s` later than their stamps, and a still hand."""
    whole = RIG.depth_intrinsics
    fx, fy, cx, cy = (0.25 * one for one in (whole.fx, whole.fy, whole.cx, whole.cy))
    intrinsics = Intrinsics(whole.width // 4, whole.height // 4, fx, fy, cx, cy)
    T_W_hand = RIG.T_H_D @ rigid([0.1, 0.1, 0.05], [0.0, 0.02, 0.5])

    def scene() -> SceneState:
        t_ns = time.monotonic_ns()
        return SceneState(t_ns, head(1e-9 * t_ns) @ RIG.T_H_D, T_W_hand)

    settings = SyntheticSettings(rate_hz=15.0, clock_offset_s=0.0, clock_drift=0.0)
    world = World(make_hand(1), make_room(1))
    camera = PunctualCamera(world, scene, depth_intrinsics=intrinsics, settings=settings)
    is_over = threading.Event()
    with HeadsetServer(KEY) as server, HeadsetClient(server.address, KEY, DEVICE) as client:

        def send() -> None:
            t_ns = time.monotonic_ns()
            while not is_over.wait(1 / 100):
                while t_ns < time.monotonic_ns():  # also what a busy machine has missed
                    client.send_pose(head(1e-9 * t_ns + delay_s), t_ns)
                    t_ns += POSE_NS

        thread = threading.Thread(target=send)
        thread.start()
        try:
            server.wait_connected(5.0)
            yield server, camera
        finally:
            is_over.set()
            thread.join()


def pass_by_frames(patch: pytest.MonkeyPatch, camera: PunctualCamera, duration_s: float) -> None:
    """Let a duration pass in `FRAMES` frames: a busy machine gives few in a second."""
    clock = SimpleNamespace(monotonic=lambda: camera.frames * duration_s / FRAMES)
    patch.setattr("handcal.station.poses.time", clock)


@pytest.mark.process
def test_wrong_stamps_are_found_over_the_link(monkeypatch: pytest.MonkeyPatch) -> None:
    with turning_head(0.04) as (server, camera):
        pass_by_frames(monkeypatch, camera, 4.0)
        found = run_pose_delay(server, camera, RIG.T_H_D, LATENCY_S, 4.0)
        assert found.delay_s == pytest.approx(0.04, abs=0.005)
        assert found.is_wrong
        with pytest.raises(HandcalError, match="turn the head left and right"):
            run_pose_delay(server, camera, RIG.T_H_D, LATENCY_S, 0.1)


@pytest.mark.process
def test_the_doctor_reports_on_a_headset(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "_SETTLE_S", 0.5)
    with HeadsetServer(KEY) as server:
        (absent,) = examine_headset(server, None, None, 0.1)
    assert (absent.health, absent.what) == (Health.BROKEN, "Headset")
    with turning_head(0.0) as (server, camera):
        pass_by_frames(monkeypatch, camera, 8.0)
        headset, stamps = examine_headset(server, RIG, camera, 5.0)
    assert headset.found.startswith("Lab 9 (runtime 1, app 3, protocol 2)")
    assert (stamps.what, stamps.health) == ("Pose stamps", Health.GOOD)
