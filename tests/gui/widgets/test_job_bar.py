from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
from PySide6.QtWidgets import QLabel, QProgressBar, QPushButton
from pytestqt.qtbot import QtBot

from handcal.errors import CancelledError, FileError
from handcal_gui.engine.jobs import IsCancelled, Report
from handcal_gui.widgets.job_bar import JobBar


@pytest.fixture
def bar(qtbot: QtBot) -> Iterator[JobBar]:
    bar = JobBar()
    qtbot.addWidget(bar)
    bar.show()
    yield bar
    bar.stop()


def until_cancelled(report: Report, is_cancelled: IsCancelled) -> object:
    report("Counting", 0.25)
    while not is_cancelled():
        threading.Event().wait(0.005)
    raise CancelledError("given up")


def test_a_job_is_shown_and_its_result_taken(qtbot: QtBot, bar: JobBar) -> None:
    may_end, taken = threading.Event(), list[object]()

    def work(report: Report, _is_cancelled: IsCancelled) -> object:
        report("Counting", 0.25)
        may_end.wait(10)
        return 42

    assert not bar.is_busy
    bar.run("Beginning", work, taken.append)
    progress, doing = bar.findChild(QProgressBar, "progress"), bar.findChild(QLabel, "doing")
    assert isinstance(progress, QProgressBar)
    assert isinstance(doing, QLabel)
    qtbot.waitUntil(lambda: doing.text() == "Counting…")
    assert progress.value() == progress.maximum() // 4
    assert progress.isVisible()
    may_end.set()
    qtbot.waitUntil(lambda: taken == [42])
    assert not bar.is_busy
    assert not progress.isVisible()


def test_a_job_is_cancelled(qtbot: QtBot, bar: JobBar) -> None:
    taken = list[object]()
    bar.run("Beginning", until_cancelled, taken.append)
    cancel = bar.findChild(QPushButton, "cancel")
    assert isinstance(cancel, QPushButton)
    cancel.click()
    assert not cancel.isEnabled()
    qtbot.waitUntil(lambda: not bar.is_busy)
    assert not taken


def test_a_failure_is_told(qtbot: QtBot, bar: JobBar) -> None:
    def work(_report: Report, _is_cancelled: IsCancelled) -> object:
        raise FileError("no such folder")

    with qtbot.waitSignal(bar.failed) as failed:
        bar.run("Beginning", work, lambda _: None)
    assert failed.args == ["no such folder"]
    assert not bar.is_busy


def test_the_newest_job_counts(qtbot: QtBot, bar: JobBar) -> None:
    taken = list[object]()
    bar.run("First", until_cancelled, taken.append)
    bar.run("Second", lambda _report, _is_cancelled: "second", taken.append)
    qtbot.waitUntil(lambda: not bar.is_busy)
    assert taken == ["second"]
