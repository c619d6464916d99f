"""Repeated slow requests of which only the newest answer matters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QObject, Signal

from handcal_gui.engine.jobs import Job


class LatestJob(QObject):
    """Runs `work` in one job at a time, and answers only the newest request.

    Parameters
    ----------
    work : callable
        Called with the question.

    Attributes
    ----------
    answered : Signal(object, object)
        The question, and the value that `work` returned.
    failed : Signal(str)
        The reason why there is no answer, as a message for the user.
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
        """Start a request, now or when the running job has ended."""
        self._next = [question]
        if self._job is None:
            self._start()

    def stop(self) -> None:
        """Discard pending requests, and wait for the job's end."""
        self._next = []
        if self._job is not None:
            self._job.abandon()
            self._job = None

    def _start(self) -> None:
        question = self._next.pop()
        self._question = question
        self._job = Job(lambda _progress: self._work(question))
        self._job.succeeded.connect(self._succeed)
        self._job.failed.connect(self._fail)
        self._job.start()

    def _succeed(self, answer: object) -> None:
        if self._is_newest():
            self.answered.emit(self._question, answer)

    def _fail(self, why: str) -> None:
        if self._is_newest():
            self.failed.emit(why)

    def _is_newest(self) -> bool:
        """End the job; return False and start the next if there is a newer request."""
        assert self._job is not None
        self._job.wait()
        self._job = None
        if self._next:
            self._start()
            return False
        return True
