"""The workers that run a study's trials; `test_run` tests the trials themselves."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from handcal.core.errors import HandcalError
from handcal.lab.study.run import OVERSUBSCRIBE, open_workers


def opened_workers(workers: int | None, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return how many processes were asked for, without starting them."""
    asked: list[int] = []

    class Pool(ThreadPoolExecutor):
        def __init__(self, workers: int, *_: object) -> None:
            asked.append(workers)
            super().__init__(1)

    monkeypatch.setattr("handcal.lab.study.run.ProcessPoolExecutor", Pool)
    with open_workers(workers, None) as executor:
        assert executor.submit(abs, -3).result() == 3
    return asked


@pytest.mark.parametrize("workers", [None, 2, 4])
def test_there_are_no_more_workers_than_cores(
    workers: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 4)
    assert opened_workers(workers, monkeypatch) == [workers or 4]
    with pytest.raises(HandcalError, match="5 processes on the 4 cores"):
        opened_workers(5, monkeypatch)
    monkeypatch.setenv(OVERSUBSCRIBE, "1")
    assert opened_workers(5, monkeypatch) == [5]


@pytest.mark.parametrize(("platform", "opened"), [("win32", 61), ("linux", 100)])
def test_windows_waits_for_61_processes_at_most(
    platform: str, opened: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 100)
    monkeypatch.setattr(sys, "platform", platform)
    assert opened_workers(100, monkeypatch) == [opened]
