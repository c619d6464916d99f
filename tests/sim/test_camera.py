import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handcal.camera.camera import Camera
from handcal.core.errors import CameraError, CameraTimeoutError
from handcal.core.geometry import rigid, transform
from handcal.core.types import Float64, Frame, Intrinsics
from handcal.sim.camera import SyntheticCamera, SyntheticSettings
from handcal.sim.hand import make_hand
from handcal.sim.render import World, render
from handcal.sim.room import RoomSettings, make_room
from handcal.sim.scene import SceneState

SMALL = Intrinsics(width=320, height=180, fx=251.0, fy=251.0, cx=159.5, cy=89.5)
T_W_HAND = rigid([0.1, 0.1, 0.0], [0.0, 0.02, 0.5])


@pytest.fixture(scope="module")
def world() -> World:
    return World(make_hand(1), make_room(0, RoomSettings(texel_m=0.02)))


def _now() -> SceneState:
    return SceneState(time.monotonic_ns(), np.eye(4), T_W_HAND)


def _camera(world: World, seed: int = 0, aligned: bool = True) -> SyntheticCamera:
    settings = SyntheticSettings(aligned=aligned)
    return SyntheticCamera(world, _now, depth_intrinsics=SMALL, seed=seed, settings=settings)


def _points_D(frame: Frame) -> tuple[Float64, Float64]:
    """Return the hand's points in D, and what colour their own pixels have."""
    depth_m = frame.depth * frame.depth_scale_m
    v, u = np.nonzero((depth_m > 0.4) & (depth_m < 0.6))
    k = frame.depth_intrinsics
    rays = np.column_stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones(len(u))])
    return rays * depth_m[v, u, None], np.column_stack([u, v])


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


def test_frames_of_a_late_camera_arrive_later_in_their_order(world: World) -> None:
    settings = SyntheticSettings(late_s=0.12)
    with SyntheticCamera(world, _now, depth_intrinsics=SMALL, settings=settings) as camera:
        frames = [camera.read() for _ in range(4)]
    assert [frame.index for frame in frames] == [0, 1, 2, 3]
    host_s = np.array([frame.t_host_ns for frame in frames]) * 1e-9
    camera_s = np.array([frame.t_camera_ns for frame in frames]) * 1e-9
    assert (host_s - (camera_s - 123.456) / (1 + 20e-6) > 0.12).all()


def test_frame_shows_the_hand_at_its_depth(world: World) -> None:
    with _camera(world) as camera:
        frame = camera.read()
    points_m, _ = _points_D(frame)
    assert len(points_m) > 2000
    assert np.median(points_m[:, 2]) == pytest.approx(0.49, abs=0.02)
    assert frame.color is not None
    assert frame.color_intrinsics == SMALL
    np.testing.assert_array_equal(frame.T_C_D, np.eye(4))


def test_raw_pair_shows_the_same_hand_from_its_own_place(world: World) -> None:
    with _camera(world) as camera:
        aligned = camera.read()
    with _camera(world, aligned=False) as camera:
        raw = camera.read()
    assert aligned.color is not None
    assert raw.color is not None
    assert raw.color_intrinsics is not None
    assert np.linalg.norm(raw.T_C_D[:3, 3]) == pytest.approx(0.015, abs=0.001)
    points_m, pixels = _points_D(aligned)
    in_C = transform(raw.T_C_D, points_m)
    k = raw.color_intrinsics
    u = np.rint(in_C[:, 0] / in_C[:, 2] * k.fx + k.cx).astype(int)
    v = np.rint(in_C[:, 1] / in_C[:, 2] * k.fy + k.cy).astype(int)
    inside = (v >= 0) & (v < k.height) & (u >= 0) & (u < k.width)
    seen = raw.color[v[inside], u[inside]].astype(float)
    same = aligned.color[pixels[inside, 1], pixels[inside, 0]].astype(float)
    assert np.median(np.abs(seen - same)) < 3.0


def test_no_scene_is_a_time_out_that_says_what_to_do(world: World) -> None:
    with SyntheticCamera(world, lambda: None, depth_intrinsics=SMALL) as camera:
        start_s = time.monotonic()
        with pytest.raises(CameraTimeoutError, match="start the virtual headset"):
            camera.read(0.05)
        assert time.monotonic() - start_s < 5.0


def test_reading_again_after_a_time_out_works(world: World) -> None:
    states: list[SceneState | None] = [None]
    with SyntheticCamera(world, lambda: states[-1], depth_intrinsics=SMALL) as camera:
        with pytest.raises(CameraTimeoutError):
            camera.read(0.01)
        states.append(_now())
        assert camera.read().index == 0


def test_closed_camera_refuses(world: World) -> None:
    camera = _camera(world)
    camera.close()
    camera.close()
    with pytest.raises(CameraError, match="closed"):
        camera.read()


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
