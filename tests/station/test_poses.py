"""The pose of a headset's own camera on its rig, from poses that both tell."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handcal.core.errors import CameraError, CameraTimeoutError, HandcalError, PoseError
from handcal.core.geometry import rigid
from handcal.core.types import LOOK_AROUND, Float64, Frame, Intrinsics
from handcal.station.poses import find_camera_pose, run_camera_pose

T_H_D: Float64 = rigid([0.3, -0.2, 0.1], [0.02, -0.03, 0.05])
OTHER_WORLD: Float64 = rigid([0.0, 0.5, 0.0], [1.0, 0.0, 2.0])
PERIOD_NS = 66_000_000


def looking_around(t_host_ns: int) -> Float64:
    """Return T_W_H of a head that turns by 25° each way within 4 s, and moves with it."""
    if t_host_ns < -1_000_000_000:
        raise PoseError("too old")
    phase = 2.0 * np.pi * 1e-9 * t_host_ns / 4.0
    sway = np.sin(phase)
    place_m = [0.5 + 0.06 * sway, 0.02 * np.sin(2.0 * phase), 1.0 - 0.03 * sway]
    return rigid([0.1 * np.cos(phase), np.radians(25.0) * sway, 0.0], place_m)


def seen(late_ns: int = 0, noise: float = 1.0, share: float = 1.0) -> list[tuple[int, Float64]]:
    rng = np.random.default_rng(1)

    def trembling() -> Float64:
        return rigid(noise * rng.normal(0.0, 0.001, 3), noise * rng.normal(0.0, 0.0005, 3))

    times_ns = PERIOD_NS * np.arange(round(share * 120))
    return [(int(t) + late_ns, looking_around(int(t)) @ T_H_D @ trembling()) for t in times_ns]


@pytest.mark.parametrize("late_ns", [0, 80_000_000])
def test_it_is_found_whatever_the_clocks_say(late_ns: int) -> None:
    found = find_camera_pose(seen(late_ns), looking_around)
    np.testing.assert_allclose(found.T_H_D, T_H_D, atol=0.002)
    assert found.offset_s == pytest.approx(-1e-9 * late_ns, abs=0.011)
    assert found.spread_m < 0.003


def test_two_worlds_are_no_one() -> None:
    elsewhere = [(t_ns, OTHER_WORLD @ T_W_D) for t_ns, T_W_D in seen()]
    with pytest.raises(HandcalError, match="use the world of hl2ss"):
        find_camera_pose(elsewhere, looking_around)


@pytest.mark.parametrize("frames", [[], seen(share=0.05), [seen()[0]] * 50])
def test_a_head_at_rest_or_hardly_seen_tells_nothing(frames: list[tuple[int, Float64]]) -> None:
    with pytest.raises(HandcalError, match="turn the head slowly"):
        find_camera_pose(frames, looking_around)


def test_poses_that_are_not_known_are_left_out() -> None:
    early = [(t_ns - 4_000_000_000, T_W_D) for t_ns, T_W_D in seen()]
    found = find_camera_pose(early, looking_around)
    np.testing.assert_allclose(found.T_H_D, T_H_D, atol=0.003)


class Scene:
    """A headset's app, its camera, and the time that passes for both."""

    name = "Scene"

    def __init__(self, tells: bool = True) -> None:
        self.prompts: list[str] = []
        self._tells, self._frames, self._ns = tells, 0, 0

    def monotonic(self) -> float:
        return 1e-9 * self._ns

    def send_prompt(self, text: str) -> None:
        self.prompts.append(text)

    def pose_at_host_ns(self, t_host_ns: int) -> Float64:
        return looking_around(t_host_ns)

    def read(self, timeout_s: float) -> Frame:
        self._frames += 1
        self._ns += PERIOD_NS
        if self._frames % 10 == 0:
            raise CameraTimeoutError(f"none for {timeout_s:g} s")
        camera = Intrinsics(2, 2, 1.0, 1.0, 0.5, 0.5)
        frame = Frame(
            self._frames, self._ns - 7, self._ns, np.ones((2, 2), np.uint16), 0.001, camera
        )
        T_W_D = looking_around(self._ns) @ T_H_D
        return replace(frame, T_W_D=T_W_D if self._tells else None)


def test_the_wearer_looks_around_and_the_pose_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    scene: Any = Scene()
    monkeypatch.setattr("handcal.station.poses.time", scene)
    found = run_camera_pose(scene, scene)
    np.testing.assert_allclose(found.T_H_D, T_H_D, atol=1e-6)
    assert scene.prompts == [LOOK_AROUND, ""]
    mute: Any = Scene(tells=False)
    monkeypatch.setattr("handcal.station.poses.time", mute)
    with pytest.raises(CameraError, match="does not report its pose"):
        run_camera_pose(mute, mute)
    assert mute.prompts[-1] == ""
