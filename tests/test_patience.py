"""The time limits of tests, which a busy machine stretches."""

from __future__ import annotations

import time

import pytest

from tests import helpers
from tests.helpers import Patience, _slowness_of


def test_a_second_counts_by_the_share_that_the_threads_got() -> None:
    ms = 1_000_000
    before = {"1": (500 * ms, 100 * ms), "ended": (7 * ms, 7 * ms)}
    after = {"1": (540 * ms, 300 * ms), "new": (10 * ms, 250 * ms)}
    assert _slowness_of(before, after) == pytest.approx(1.0 + 450 / 50)
    assert _slowness_of(after, after) == 1.0  # at rest, such as a program that hangs
    assert _slowness_of({}, {"1": (ms, 5 * ms)}) == 1.0  # as on any machine
    assert _slowness_of({}, {"1": (0, 100 * ms)}) > 1000.0


@pytest.mark.parametrize("slowness", [1.0, 4.0])
def test_a_limit_is_reached_later_on_a_busy_machine(
    monkeypatch: pytest.MonkeyPatch, slowness: float
) -> None:
    now_s = 0.0
    monkeypatch.setattr(time, "monotonic", lambda: now_s)
    monkeypatch.setattr(helpers, "_slowness_of", lambda *_: slowness)
    monkeypatch.setattr(helpers, "_slowness", lambda: slowness)
    patience = Patience(3.0)
    while not patience.is_over():
        now_s += 1.0
    assert now_s == 3.0 * slowness
