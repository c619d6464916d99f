import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handcal.camera.camera import Camera
from handcal.core.errors import CameraTimeoutError
from handcal.core.geometry import rigid
from handcal.core.types import Intrinsics
from handcal.sim.camera import SyntheticCamera, SyntheticSettings
from handcal.sim.hand import make_hand
from handcal.sim.render import World, render
from handcal.sim.room import make_room
from handcal.sim.scene import SceneState

SMALL = Intrinsics(width=320, height=180, fx=251.0, fy=251.0, cx=159.5, cy=89.5)
T_W_HAND = rigid([0.1, 0.1, 0.0], [0.0, 0.02, 0.5])


@pytest.fixture(scope="module")
def world() -> World:
    return World(make_hand(1), make_room(0))


def _now() -> SceneState:
    return SceneState(time.monotonic_ns(), np.eye(4), T_W_HAND)


def _camera(world: World) -> SyntheticCamera:
    return SyntheticCamera(world, _now, depth_intrinsics=SMALL)


def test_frames_come_at_the_cameras_rate_with_both_clocks(world: World) -> None:
    camera: Camera
    with _camera(world) as camera:
        frames = [camera.read() for _ in range(13)]
    assert [frame.index for frame in frames] == list(range(13))
    host_s = np.array([frame.t_host_ns for frame in frames]) * 1e-9
    camera_s = np.array([frame.t_camera_ns for frame in frames]) * 1e-9
    assert (host_s[-1] - host_s[0]) / 12 > 0.9 / 30  # slower where rendering takes longer
    # The camera's time is that of exposure, so that arrival is later by the rendering.
    latency_s = host_s - (camera_s - 123.456) / (1 + 20e-6)
    assert (latency_s > 0).all()
    assert (latency_s < 0.0301).all()


@pytest.mark.parametrize("late_s", [0.0, 0.12])
def test_slow_rendering_makes_no_late_camera_and_hides_none(
    world: World, monkeypatch: pytest.MonkeyPatch, late_s: float
) -> None:
    """On a busy computer a frame is rendered long after its exposure."""

    def render_slowly(*arguments: Any) -> Any:
        end_s = time.monotonic() + 0.2
        while time.monotonic() < end_s:
            pass
        return render(*arguments)

    monkeypatch.setattr("handcal.sim.camera.render", render_slowly)
    settings = SyntheticSettings(late_s=late_s)
    with SyntheticCamera(world, _now, depth_intrinsics=SMALL, settings=settings) as camera:
        frames = [camera.read() for _ in range(3)]
    exposed_s = np.array([frame.t_camera_ns for frame in frames]) * 1e-9 - 123.456
    arrived_s = np.array([frame.t_host_ns for frame in frames]) * 1e-9
    latency_s = arrived_s - exposed_s / (1 + 20e-6)
    assert (latency_s > late_s).all()
    assert (latency_s < 0.0301).all() == (late_s == 0.0)


def test_frame_shows_the_hand_at_its_depth(world: World) -> None:
    with _camera(world) as camera:
        frame = camera.read()
    depth_m = frame.depth * frame.depth_scale_m
    on_hand = (depth_m > 0.4) & (depth_m < 0.6)
    assert np.count_nonzero(on_hand) > 2000
    assert np.median(depth_m[on_hand]) == pytest.approx(0.49, abs=0.02)
    assert frame.color is not None
    assert frame.color_intrinsics == SMALL
    np.testing.assert_array_equal(frame.T_C_D, np.eye(4))


def test_no_scene_is_a_time_out_after_which_reading_goes_on(world: World) -> None:
    states: list[SceneState | None] = [None]
    with SyntheticCamera(world, lambda: states[-1], depth_intrinsics=SMALL) as camera:
        with pytest.raises(CameraTimeoutError, match="start the virtual headset"):
            camera.read(0.05)
        states.append(_now())
        assert camera.read().index == 0


def test_seed_decides_the_noise(world: World) -> None:
    def depth(seed: int) -> bytes:
        state = replace(_now(), t_ns=1)
        with SyntheticCamera(world, lambda: state, depth_intrinsics=SMALL, seed=seed) as camera:
            return camera.read().depth.tobytes()

    assert depth(1) == depth(1)
    assert depth(1) != depth(2)


def test_a_distortion_that_is_not_rendered_is_not_claimed(world: World) -> None:
    distorted = replace(SMALL, distortion=(0.1, 0.0, 0.0, 0.0))
    with SyntheticCamera(world, _now, depth_intrinsics=distorted) as camera:
        assert camera.depth_intrinsics == camera.read().depth_intrinsics == SMALL
