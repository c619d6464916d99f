"""Solve the alignments with another method, for comparison in the results panel."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import QObject

from handcal.calibration.solve_again import solve_again
from handcal.core.progress import Progress
from handcal.core.types import Method
from handcal.register.results import SolveSettings
from handcal.session.session import SessionRecord
from handcal_gui.calibrate.results.panel import ResultsPanel
from handcal_gui.engine.jobs import Job


class Comparison(QObject):
    """Solves with another method when the results panel requests it.

    Parameters
    ----------
    panel : ResultsPanel
    """

    def __init__(self, panel: ResultsPanel) -> None:
        super().__init__(panel)
        self._panel = panel
        self._record: SessionRecord | None = None
        self._settings = SolveSettings()
        self._job: Job | None = None
        panel.compare_requested.connect(self._start)
        panel.compare_cancelled.connect(self._request_cancel)

    def use(self, record: SessionRecord, settings: SolveSettings) -> None:
        """Set the session to compare with."""
        self._record, self._settings = record, settings

    def cancel(self) -> None:
        """Cancel the comparison, and wait for its end; nothing is shown."""
        if self._job is not None:
            self._job.abandon()
            self._job = None

    def _request_cancel(self) -> None:
        """Cancel without waiting: a method may take seconds to react."""
        if self._job is not None:
            self._job.cancel()
            self._job.succeeded.disconnect()
            self._job.failed.disconnect()

    def _start(self, method: Method) -> None:
        self.cancel()
        record = self._record
        settings = replace(self._settings, method=method)

        def work(progress: Progress) -> object:
            assert record is not None
            return solve_again(record, settings, progress)

        self._job = Job(work)
        self._job.progressed.connect(self._panel.show_comparison_progress)
        self._job.succeeded.connect(self._panel.show_comparison)
        self._job.failed.connect(self._panel.comparison_failed)
        self._job.start()
