"""Asking something that takes a while again and again, when only the newest answer matters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QObject, Signal

from handcal_gui.jobs import Job


class LatestJob(QObject):
    """Calls `work` in a job, one at a time; of the questions asked meanwhile the last is kept.

    Parameters
    ----------
    work : callable
        Given the question.

    Attributes
    ----------
    answered : Signal(object, object)
        A question, and what `work` returned.
    failed : Signal(str)
        Why there is no answer, for a person to read.
    """

    answered = Signal(object, object)
    failed = Signal(str)

    def __init__(self, work: Callable[[Any], object], parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._work = work
        self._job: Job | None = None
        self._question: object = None
        self._next: list[object] = []

    def ask(self, question: object) -> None:
        """Ask, at once or after the answer to the present question."""
        self._next = [question]
        if self._job is None:
            self._start()

    def stop(self) -> None:
        """Forget what is asked, and wait for the job's end."""
        self._next = []
        if self._job is not None:
            self._job.wait()

    def _start(self) -> None:
        question = self._next.pop()
        # Without a parent: should this object be destroyed, the job's thread keeps the job alive.
        self._question = question
        self._job = Job(lambda _report, _is_cancelled: self._work(question))
        self._job.succeeded.connect(self._succeed)
        self._job.failed.connect(self._fail)
        self._job.start()

    def _succeed(self, answer: object) -> None:
        question = self._question
        self._end()
        self.answered.emit(question, answer)

    def _fail(self, why: str) -> None:
        self._end()
        self.failed.emit(why)

    def _end(self) -> None:
        assert self._job is not None
        self._job.wait()
        self._job = None
        if self._next:
            self._start()
