"""The 3D window of a session, which runs in its own process."""

from __future__ import annotations

from PySide6.QtCore import QObject, Signal

from handcal.core.progress import Progress
from handcal.export.outcome import load_outcome
from handcal.export.window_3d import inspect_session
from handcal.session.session import SessionRecord
from handcal_gui.engine.jobs import Job


class Inspection(QObject):
    """Shows one session at a time in 3D.

    Attributes
    ----------
    failed : Signal(str)
        The reason why there is no window, or why it has ended.
    """

    failed = Signal(str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._job: Job | None = None

    def start(self, record: SessionRecord) -> None:
        """Solve a session's alignments again and show them; replaces a window that is open."""
        self.close()

        def work(progress: Progress) -> None:
            inspect_session(load_outcome(record, progress), progress=progress)

        self._job = Job(work)
        self._job.failed.connect(self.failed)
        self._job.start()

    def close(self) -> None:
        """Close the window; safe to call twice."""
        if self._job is not None:
            self._job.abandon()
            self._job = None
