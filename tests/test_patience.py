"""The time limits of tests, which a busy machine stretches."""

from __future__ import annotations

import subprocess
import sys
import time

import pytest

from tests import helpers
from tests.helpers import Patience, _slowness_of, output_of


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


@pytest.mark.process
def test_the_output_of_a_program_that_ends_is_returned_and_one_that_hangs_fails() -> None:
    def start(code: str) -> subprocess.Popen[str]:
        pipe = subprocess.PIPE
        return subprocess.Popen([sys.executable, "-c", code], stdout=pipe, stderr=pipe, text=True)

    assert output_of(start("print('made')"), 60.0) == ("made\n", "")
    with start("import threading; threading.Event().wait()") as hanging:
        try:
            with pytest.raises(AssertionError, match="did not end"):
                output_of(hanging, 0.1)
        finally:
            hanging.kill()
