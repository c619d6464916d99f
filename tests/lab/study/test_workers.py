"""The workers that run a study's trials; `test_run` tests the trials themselves."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from handcal.lab.study.workers import open_workers


@pytest.mark.parametrize(("platform", "opened"), [("win32", 61), ("linux", 100)])
def test_windows_waits_for_61_processes_at_most(
    platform: str, opened: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []

    class Pool(ThreadPoolExecutor):
        def __init__(self, workers: int, *_: object) -> None:
            asked.append(workers)
            super().__init__(1)

    monkeypatch.setattr("handcal.lab.study.workers.ProcessPoolExecutor", Pool)
    with monkeypatch.context() as patch:
        patch.setattr(sys, "platform", platform)
        with open_workers(100, None) as executor:
            assert executor.submit(abs, -3).result() == 3
    assert asked == [opened]
