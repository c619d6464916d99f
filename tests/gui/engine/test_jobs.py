from __future__ import annotations

import threading
from typing import Any

import pytest
from pytestqt.qtbot import QtBot

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal_gui.engine.jobs import Job


def test_progress_and_result_reach_the_window_s_thread(qtbot: QtBot) -> None:
    def work(progress: Progress) -> str:
        progress.at(0.5, "half")
        return f"done in {threading.current_thread().name}"

    job = Job(work)
    heard: list[tuple[Any, ...]] = []
    job.progressed.connect(lambda *what: heard.append((*what, threading.current_thread())))
    with qtbot.waitSignal(job.succeeded, timeout=5000) as succeeded:
        job.start()
    job.wait()
    assert succeeded.args == ["done in handcal job"]
    assert heard == [("half", 0.5, threading.main_thread())]


def test_cancel_stops_the_work(qtbot: QtBot) -> None:
    started = threading.Event()

    def work(progress: Progress) -> None:
        started.set()
        while True:
            progress.check()

    job = Job(work)
    job.start()
    assert started.wait(5.0)
    with qtbot.waitSignal(job.cancelled, timeout=5000):
        job.cancel()
    job.wait()


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (FileError("the disk is full; free some space"), "the disk is full; free some space"),
        (KeyError("x"), "handcal hit an unexpected error (KeyError: 'x')"),
    ],
)
def test_failure_is_reported_in_words(qtbot: QtBot, error: Exception, text: str) -> None:
    def work(_progress: Progress) -> None:
        raise error

    job = Job(work)
    with qtbot.waitSignal(job.failed, timeout=5000) as failed:
        job.start()
    job.wait()
    assert failed.args == [text]


def test_nothing_is_heard_of_a_job_that_was_abandoned(qtbot: QtBot) -> None:
    job = Job(lambda progress: progress.at(0.5, "half"))
    heard: list[object] = []
    job.progressed.connect(lambda *what: heard.append(what))
    job.succeeded.connect(heard.append)
    job.start()
    job.abandon()
    qtbot.wait(50)
    assert heard == []
