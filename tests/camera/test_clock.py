"""The camera's clock on the host's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.camera.clock import FrameClock
from handcal.core.types import Frame, Intrinsics

TINY = Intrinsics(2, 2, 1.0, 1.0, 0.5, 0.5)
PERIOD_NS = 33_333_333
LATENCY_NS = 30_000_000


def frame(t_camera_ns: int, t_host_ns: int) -> Frame:
    return Frame(0, t_camera_ns, t_host_ns, np.zeros((2, 2), np.uint16), 1e-4, TINY)


@given(
    st.integers(-(10**17), 10**17),
    st.lists(st.integers(0, 20_000_000), min_size=2, max_size=40),
)
def test_late_arrivals_do_not_move_the_exposure(offset_ns: int, late_ns: list[int]) -> None:
    """Whatever the load, a frame is dated by the quickest; the first counts as one of them."""
    clock = FrameClock(0.03)
    base_ns = 10**18
    for i, late in enumerate([0, *late_ns]):
        exposed_ns = base_ns + i * PERIOD_NS
        arrived = frame(exposed_ns + offset_ns, exposed_ns + LATENCY_NS + late)
        assert clock.exposure_ns(arrived) == exposed_ns


def test_a_quicker_frame_corrects_the_estimate() -> None:
    clock = FrameClock(0.0)
    assert clock.exposure_ns(frame(1_000, 9_000)) == 9_000
    assert clock.exposure_ns(frame(2_000, 5_000)) == 5_000
    assert clock.exposure_ns(frame(3_000, 9_000)) == 6_000


def test_the_rate_is_that_of_the_exposures() -> None:
    clock = FrameClock(0.0)
    for i in range(400):
        clock.exposure_ns(frame(i * PERIOD_NS, 10**12 + i * PERIOD_NS + i % 7))
    assert clock.period_s == pytest.approx(1e-9 * PERIOD_NS)


def test_a_measured_offset_replaces_the_assumption_until_the_camera_restarts() -> None:
    clock = FrameClock(0.03)
    assert clock.exposure_ns(frame(1_000_000_000, 2_000_000_000)) == 1_970_000_000
    clock.measured_ns = 900_000_000
    assert clock.exposure_ns(frame(1_100_000_000, 2_100_000_000)) == 2_000_000_000
    assert clock.exposure_ns(frame(500_000_000, 3_000_000_000)) == 2_970_000_000


def test_drift_is_followed() -> None:
    """A camera that runs 50 ppm slow; over ten seconds that is half a millisecond."""
    clock = FrameClock(0.03)
    for i in range(1500):
        exposed_ns = i * PERIOD_NS
        arrived = frame(round(exposed_ns * (1 - 50e-6)), exposed_ns + LATENCY_NS)
        assert abs(clock.exposure_ns(arrived) - exposed_ns) < 600_000
