import random

import pytest

from handcal.core.errors import PosePendingError
from handcal.link.poses import MIN_SAMPLES, ClockEstimator

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
