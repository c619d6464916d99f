"""The delay of the camera's pictures, measured from a head that moves before a still background."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from handcal.calibration.delay import ASSUMED_SIGMA_S, DelayMeter
from handcal.calibration.hands import PlacedHand
from handcal.camera.clock import FrameClock
from handcal.core.errors import PoseError, PosePendingError
from handcal.core.geometry import rigid
from handcal.core.types import Float64, Frame, Intrinsics
from handcal.sim.hand import make_hand
from handcal.sim.render import World, render
from handcal.sim.room import make_room
from tests.calibration.test_hands import cloud

CAMERA = Intrinsics(320, 180, 251.0, 251.0, 159.5, 89.5)
T_H_D = rigid([0.02, -0.03, 0.01], [0.0, -0.05, 0.03])
PERIOD_NS = 60_000_000
START_NS = 10**18
CAMERA_AHEAD_NS = -7_000_000_000
TRACKING_RAD, TRACKING_M = 0.0003, 0.0002


def looking(t_s: float) -> Float64:
    """Look slowly to the left and to the right."""
    return rigid([0.01 * np.sin(t_s), 0.05 * np.sin(np.pi * t_s), 0.0], [0.003 * np.cos(t_s), 0, 0])


def turning(t_s: float) -> Float64:
    return rigid([0.0, 0.03 * t_s, 0.0])


def resting(_t_s: float) -> Float64:
    return np.eye(4)


@cache
def world() -> World:
    return World(make_hand(1), make_room(1))


def picture(T_W_H: Float64) -> tuple[np.ndarray, np.ndarray]:
    depth_m, color = render(world(), T_W_H @ T_H_D, None, CAMERA)
    return (1e4 * depth_m).astype(np.uint16), color


class Rehearsal:
    """A meter, and a head that moves, on a timeline of its own."""

    def __init__(
        self, head: Callable[[float], Float64], latency_s: float, late_s: Callable[[int], float]
    ) -> None:
        self.head, self.latency_s, self.late_s = head, latency_s, late_s
        self.clock = FrameClock(0.03)
        self.meter = DelayMeter(self.clock, self.pose_at, T_H_D)
        self.now_ns = START_NS
        self.rng = np.random.default_rng(1)

    def pose_at(self, t_ns: int) -> Float64:
        if t_ns > self.now_ns:
            raise PosePendingError("later")
        if t_ns < START_NS:
            raise PoseError("before")
        noise = rigid(*(size * self.rng.normal(size=3) for size in (TRACKING_RAD, TRACKING_M)))
        return self.head(1e-9 * (t_ns - START_NS)) @ noise

    def watch(self, seconds: float, plain: bool = False) -> bool:
        """See frames for a while; return True if the delay became known."""
        became_known = False
        for index in range(round(1e9 * seconds / PERIOD_NS)):
            exposed_ns = self.now_ns
            depth, color = picture(self.head(1e-9 * (exposed_ns - START_NS)))
            if plain:
                color = np.full_like(color, 127)
            arrived_ns = exposed_ns + round(1e9 * (self.latency_s + self.late_s(index)))
            self.now_ns = arrived_ns
            frame = Frame(
                index, exposed_ns + CAMERA_AHEAD_NS, arrived_ns, depth, 1e-4, CAMERA, color, CAMERA
            )
            self.clock.exposure_ns(frame)
            became_known |= self.meter.see(frame)
            self.now_ns = exposed_ns + PERIOD_NS
        return became_known


def rehearse(
    head: Callable[[float], Float64] = looking,
    latency_s: float = 0.03,
    late_s: Callable[[int], float] = lambda _: 0.0,
) -> Rehearsal:
    return Rehearsal(head, latency_s, late_s)


@pytest.mark.parametrize("latency_s", [0.005, 0.045, 0.18])
def test_the_delay_is_measured_while_the_wearer_looks_around(latency_s: float) -> None:
    """Also if most frames are held up by a busy computer."""
    rehearsal = rehearse(latency_s=latency_s, late_s=lambda i: 0.01 * (i % 4))
    assert rehearsal.watch(4.0)
    assert not rehearsal.meter.is_needed
    assert rehearsal.meter.delay_s == pytest.approx(latency_s, abs=0.005)


@pytest.mark.parametrize(("head", "is_needed"), [(resting, False), (turning, True)])
def test_a_head_at_rest_needs_no_delay_and_a_constant_rate_does_not_tell_it(
    head: Callable[[float], Float64], is_needed: bool
) -> None:
    rehearsal = rehearse(head)
    assert not rehearsal.watch(3.0)
    assert rehearsal.meter.delay_s is None
    assert rehearsal.meter.is_needed == is_needed


def test_a_plain_background_tells_nothing() -> None:
    rehearsal = rehearse()
    assert not rehearsal.watch(3.0, plain=True)
    assert rehearsal.meter.is_needed
    assert not rehearsal.watch(9.0, plain=True)
    assert not rehearsal.meter.is_needed, "it stays assumed"


def test_a_camera_with_another_clock_is_measured_again() -> None:
    rehearsal = rehearse()
    rehearsal.watch(4.0)
    assert rehearsal.meter.delay_s is not None
    depth, color = picture(np.eye(4))
    frame = Frame(
        0, rehearsal.now_ns + 10**12, rehearsal.now_ns, depth, 1e-4, CAMERA, color, CAMERA
    )
    rehearsal.clock.exposure_ns(frame)
    rehearsal.meter.see(frame)
    assert rehearsal.meter.delay_s is None


def test_frames_without_colour_leave_the_delay_assumed() -> None:
    rehearsal = rehearse()
    frame = Frame(0, 0, START_NS, np.ones((180, 320), np.uint16), 1e-4, CAMERA)
    assert rehearsal.clock.exposure_ns(frame) == START_NS - 30_000_000
    assert not rehearsal.meter.see(frame)
    assert not rehearsal.meter.is_needed


def test_uncertain_times_move_a_hand_by_the_speeds_of_head_and_hand() -> None:
    """A head that turns by 0.03 rad/s carries a hand 0.5 m away by 15 mm/s."""
    rehearsal = rehearse(turning)
    rehearsal.now_ns = START_NS + 10**9
    hands = [placed(START_NS + t_ns) for t_ns in (200_000_000, 500_000_000)]
    sigma_m = rehearsal.meter.time_sigma_m(hands, hands[1].t_host_ns + 20_000_000, 0.05)
    carried_m = ASSUMED_SIGMA_S * 0.03 * 0.5
    assert sigma_m == pytest.approx(np.hypot(np.sqrt(2.0) * carried_m, 0.02 * 0.05), rel=0.15)


def placed(t_ns: int) -> PlacedHand:
    points_m = np.array([[0.0, 0.0, 0.5]])
    return PlacedHand(cloud(), t_ns, np.eye(4), points_m, points_m[0])
