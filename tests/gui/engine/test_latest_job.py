"""Of many questions only the last is answered."""

from __future__ import annotations

import gc
import threading

import pytest
from pytestqt.qtbot import QtBot

from handcal.core.errors import FileError
from handcal_gui.engine.latest_job import LatestJob


def test_only_the_last_question_is_answered(qtbot: QtBot) -> None:
    may_go_on = threading.Event()
    worked_on: list[int] = []

    def work(question: int) -> int:
        worked_on.append(question)
        assert may_go_on.wait(5.0)
        return 10 * question

    job = LatestJob(work)
    answers: list[tuple[int, int]] = []
    job.answered.connect(lambda question, answer: answers.append((question, answer)))
    for question in range(5):
        job.ask(question)
    may_go_on.set()
    qtbot.waitUntil(lambda: bool(answers))
    assert answers == [(4, 40)]
    assert worked_on == [0, 4]
    job.stop()


def test_a_failure_is_reported_and_the_next_question_answered(qtbot: QtBot) -> None:
    def work(question: str) -> str:
        if question == "bad":
            raise FileError("it is damaged")
        return question

    job = LatestJob(work)
    with qtbot.waitSignal(job.failed) as failed:
        job.ask("bad")
    assert failed.args == ["it is damaged"]
    with qtbot.waitSignal(job.answered) as answered:
        job.ask("good")
    assert answered.args == ["good", "good"]
    job.stop()


@pytest.mark.parametrize("is_stopped", [True, False])
def test_it_may_go_while_it_is_asked(qtbot: QtBot, is_stopped: bool) -> None:
    began, may_go_on = threading.Event(), threading.Event()

    def work(_: object) -> None:
        began.set()
        assert may_go_on.wait(5.0)

    job = LatestJob(work)
    job.ask(None)
    assert began.wait(5.0)
    (thread,) = [t for t in threading.enumerate() if t.name == "handcal job"]
    if is_stopped:
        may_go_on.set()
        job.stop()
        assert not thread.is_alive()
    del job
    gc.collect()
    may_go_on.set()
    thread.join(5.0)
    assert not thread.is_alive()
