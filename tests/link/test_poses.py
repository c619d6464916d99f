"""The headset's clock, and its poses between their times."""

from __future__ import annotations

import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.core.errors import PoseError, PosePendingError
from handcal.core.geometry import rigid
from handcal.core.types import Float64
from handcal.link.poses import MIN_SAMPLES, ClockEstimator, PoseBuffer

MS = 1_000_000
START_NS = 5_000_000_000_000


class Headset:
    """A clock with a known offset and drift, behind a network with known delays."""

    def __init__(self, offset_ns: int, drift: float) -> None:
        self.offset_ns = offset_ns
        self.drift = drift

    def at(self, host_ns: int) -> int:
        return host_ns + self.offset_ns + round(self.drift * (host_ns - START_NS))

    def ping(self, clock: ClockEstimator, host_ns: int, out_ns: int, back_ns: int) -> int:
        received = host_ns + out_ns
        answered = received + 50_000
        return clock.add(host_ns, self.at(received), self.at(answered), answered + back_ns)


@pytest.mark.parametrize("seed", range(5))
def test_offset_and_drift_through_asymmetric_jitter(seed: int) -> None:
    chance, headset, clock = random.Random(seed), Headset(20 * MS, 80e-6), ClockEstimator()
    for i in range(300):
        out = MS + round(chance.expovariate(1 / (4 * MS)))
        back = MS + round(chance.expovariate(1 / (0.5 * MS)))
        headset.ping(clock, START_NS + 100 * MS * i, out, back)
        if clock.fit is not None:
            apart = abs(clock.fit.drift - 80e-6)
            assert apart < 3 * clock.fit.drift_uncertainty, "as wrong as it says, from the start"
    now = START_NS + 30_000 * MS
    assert clock.fit is not None
    error_ns = abs(clock.to_headset_ns(now) - headset.at(now))
    assert error_ns < 0.5 * MS
    assert error_ns < clock.fit.uncertainty_ns
    assert abs(clock.fit.drift - 80e-6) < 25e-6
    assert 1e-6 < clock.fit.drift_uncertainty < 80e-6


def test_conversions_are_inverse() -> None:
    headset, clock = Headset(20 * MS, 80e-6), ClockEstimator()
    for i in range(100):
        headset.ping(clock, START_NS + 100 * MS * i, MS, 2 * MS)
    for host_ns in (START_NS - 10_000 * MS, START_NS, START_NS + 60_000 * MS):
        assert abs(clock.to_host_ns(clock.to_headset_ns(host_ns)) - host_ns) <= 2


def test_an_unknown_clock_says_so() -> None:
    headset, clock = Headset(0, 0.0), ClockEstimator()
    for i in range(MIN_SAMPLES - 1):
        headset.ping(clock, START_NS + i, MS, MS)
    with pytest.raises(PosePendingError, match="clock"):
        clock.to_headset_ns(START_NS)


def test_an_impossible_round_trip_is_ignored() -> None:
    clock = ClockEstimator()
    for _ in range(2 * MIN_SAMPLES):
        clock.add(START_NS, START_NS, START_NS + 10 * MS, START_NS + MS)
    assert clock.fit is None


@pytest.mark.parametrize("step_ms", [-300, -20, 20, 300, 3_600_000])
def test_a_clock_that_is_set_is_known_again_after_a_few_pings(step_ms: int) -> None:
    chance, headset, clock = random.Random(1), Headset(20 * MS, 80e-6), ClockEstimator()

    def ping(number: int) -> int:
        out, back = (MS + round(chance.expovariate(1 / (4 * MS))) for _ in range(2))
        return headset.ping(clock, START_NS + 100 * MS * number, out, back)

    assert not any(ping(number) for number in range(250))
    headset.offset_ns += step_ms * MS
    found = [ping(number) for number in range(250, 250 + MIN_SAMPLES)]
    assert found[0] == pytest.approx(step_ms * MS, abs=30 * MS)
    assert not any(found[1:])
    now = START_NS + 100 * MS * (250 + MIN_SAMPLES)
    assert clock.fit is not None
    error_ns = abs(clock.to_headset_ns(now) - headset.at(now))
    assert error_ns < min(5 * MS, 3 * clock.fit.uncertainty_ns)


def test_delays_and_drift_are_no_step() -> None:
    """Also pings that take 2 s one way, and the largest drift."""
    chance, headset, clock = random.Random(2), Headset(0, 450e-6), ClockEstimator()
    for number in range(600):
        out, back = (round(chance.paretovariate(0.7) * MS) % (2_000 * MS) for _ in range(2))
        assert headset.ping(clock, START_NS + 100 * MS * number, out, back) == 0


def pose(i: float) -> Float64:
    """A steady motion, 10 ms a step."""
    return rigid([0.0, 0.02 * i, 0.0], [0.001 * i, 0.0, 0.0])


@given(st.permutations(range(8)))
def test_poses_are_interpolated_in_whatever_order_they_came(order: list[int]) -> None:
    poses = PoseBuffer()
    for i in order:
        poses.add(10 * MS * i, pose(i))
    for step in (3.0, 3.5, 6.9):
        np.testing.assert_allclose(poses.at(round(10 * MS * step)), pose(step), atol=1e-12)


def test_refusals_say_why() -> None:
    poses = PoseBuffer()
    with pytest.raises(PosePendingError, match="not arrived"):
        poses.at(0)
    for t_ms in (100, 110, 200):
        poses.add(t_ms * MS, pose(t_ms))
    with pytest.raises(PoseError, match="100 ms before"):
        poses.at(0)
    with pytest.raises(PoseError, match="no pose for 90 ms"):
        poses.at(150 * MS)
    with pytest.raises(PosePendingError, match="not arrived"):
        poses.at(201 * MS)
    assert poses.at(105 * MS).shape == (4, 4)


@pytest.mark.parametrize(
    ("gap_ms", "moved_m", "turned_rad", "is_known"),
    [
        (50, 0.1, 0.5, True),
        (60, 0.1, 0.0, False),
        (60, 0.0, 0.1, False),
        (60, 0.004, 0.008, True),
        (250, 0.004, 0.008, True),
        (260, 0.0, 0.0, False),
    ],
)
def test_longer_gaps_are_interpolated_where_the_head_is_slow(
    gap_ms: int, moved_m: float, turned_rad: float, is_known: bool
) -> None:
    poses = PoseBuffer()
    poses.add(0, rigid())
    poses.add(gap_ms * MS, rigid([0.0, turned_rad, 0.0], [moved_m, 0.0, 0.0]))
    if is_known:
        assert poses.at(gap_ms * MS // 2)[0, 3] == pytest.approx(moved_m / 2)
    else:
        with pytest.raises(PoseError, match=f"no pose for {gap_ms} ms"):
            poses.at(gap_ms * MS // 2)


def test_only_the_newest_are_kept() -> None:
    poses = PoseBuffer(capacity=10)
    for i in range(30):
        poses.add(10 * MS * i, pose(i))
    poses.add(0, pose(0))
    with pytest.raises(PoseError, match="before the oldest"):
        poses.at(199 * MS)
    np.testing.assert_allclose(poses.at(200 * MS), pose(20))


def test_the_rate_counts_each_pose_once() -> None:
    poses = PoseBuffer()
    assert poses.rate_hz() == 0.0
    for i in range(300):
        for j in (i, max(i - 1, 0)):
            poses.add(10 * MS * j, pose(j))
    assert poses.rate_hz() == pytest.approx(100.0)
