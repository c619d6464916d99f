from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
from PySide6.QtWidgets import QLabel, QProgressBar, QPushButton
from pytestqt.qtbot import QtBot

from handcal.core.progress import Progress
from handcal_gui.widgets.job_bar import JobBar
from tests.gui.helpers import child


@pytest.fixture
def bar(qtbot: QtBot) -> Iterator[JobBar]:
    bar = JobBar()
    qtbot.addWidget(bar)
    bar.show()
    yield bar
    bar.stop()


def until_cancelled(progress: Progress) -> object:
    progress.at(0.25, "Counting")
    while True:
        threading.Event().wait(0.005)
        progress.check()


def test_a_job_is_shown_and_its_result_taken(qtbot: QtBot, bar: JobBar) -> None:
    may_end, taken = threading.Event(), list[object]()

    def work(progress: Progress) -> object:
        progress.at(0.25, "Counting")
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
    cancel = child(bar, QPushButton, "cancel")
    cancel.click()
    assert not cancel.isEnabled()
    qtbot.waitUntil(lambda: not bar.is_busy)
    assert not taken


def test_the_newest_job_counts(qtbot: QtBot, bar: JobBar) -> None:
    taken = list[object]()
    bar.run("First", until_cancelled, taken.append)
    bar.run("Second", lambda _progress: "second", taken.append)
    qtbot.waitUntil(lambda: not bar.is_busy)
    assert taken == ["second"]
