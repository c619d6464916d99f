"""Controller of the review of a stored session: read, solved again, shown in the panels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QProgressDialog

from handcal.calibration.solve_again import solve_sound, stored_solve_settings
from handcal.core.progress import Progress
from handcal.core.types import Eye
from handcal.register.results import Results, SolveSettings, residuals_reach_m
from handcal.session.record import replay
from handcal.session.session import Session, SessionRecord
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.review_page import ReviewPage
from handcal_gui.calibrate.window import MainWindow
from handcal_gui.engine.jobs import Job
from handcal_gui.engine.latest_job import LatestJob
from handcal_gui.widgets.result_rows import EYE_NAMES, VERDICT_WORDS

_PATIENCE_MS = 500


@dataclass(frozen=True, slots=True, eq=False)
class _Stored:
    record: SessionRecord
    settings: SolveSettings
    results: Results | None


class ReviewController(QObject):
    """Opens stored sessions read-only, one at a time.

    Parameters
    ----------
    window : MainWindow
    page : ReviewPage

    Attributes
    ----------
    opened : Signal(Path)
    failed : Signal(str)
        The reason why a session could not be opened.
    record : SessionRecord or None
        The session shown.
    """

    opened = Signal(object)
    failed = Signal(str)

    def __init__(self, window: MainWindow, page: ReviewPage) -> None:
        super().__init__(window)
        self._window = window
        self._page = page
        self._job: Job | None = None
        self._progress: QProgressDialog | None = None
        self.record: SessionRecord | None = None
        self._results: Results | None = None
        # Without an answer, as of a session deleted meanwhile, what is shown stays.
        self._wearer = LatestJob(lambda path: replay(path).state.wearer, self)
        self._wearer.answered.connect(self._show_wearer)
        window.panels.results.residuals.shown.connect(self._show_alignment)

    def open(self, path: Path) -> None:
        """Read and solve a session, then show it."""
        self.close()

        def work(progress: Progress) -> _Stored:
            record = Session.open(path)
            settings = stored_solve_settings(record)
            record, results = solve_sound(record, settings, progress)
            return _Stored(record, settings, results)

        self._job = Job(work)
        self._job.succeeded.connect(self._show)
        self._job.failed.connect(self._fail)
        self._job.cancelled.connect(
            lambda: self._fail(tr("{} was not opened: cancelled").format(path))
        )
        self._show_progress(self._job)
        self._job.start()

    def close(self) -> None:
        """Cancel opening and comparison, and close the session; safe to call twice."""
        self._window.panels.results.comparison.cancel()
        if self._job is not None:
            self._job.abandon()
            self._job = None
        self._end_progress()
        self._wearer.stop()
        self.record = None

    def read_wearer(self) -> None:
        """Show, and export, the wearer's name as it is stored now: the library corrects it."""
        if self.record is not None:
            self._wearer.ask(self.record.path)

    def _show_wearer(self, _path: Path, wearer: str) -> None:
        assert self.record is not None
        self.record = replace(self.record, wearer=wearer)
        self._window.panels.session.show_record(self.record, self._results)
        self._page.show_wearer(wearer)
        self._window.show_wearer(wearer)

    def _show_progress(self, job: Job) -> None:
        """Show a dialog with the progress if opening takes long, with a Cancel button."""
        progress = QProgressDialog(tr("Reading the session…"), tr("Cancel"), 0, 0, self._window)
        progress.setObjectName("opening")
        progress.setMinimumDuration(_PATIENCE_MS)
        progress.canceled.connect(job.cancel)
        job.progressed.connect(lambda doing, _share: progress.setLabelText(f"{doing}…"))
        self._progress = progress

    def _end_progress(self) -> None:
        if self._progress is not None:
            self._progress.deleteLater()
            self._progress = None

    def _fail(self, why: str) -> None:
        self._end_progress()
        self.failed.emit(why)

    def _show(self, stored: _Stored) -> None:
        self._end_progress()
        self.record = record = stored.record
        self._results = stored.results
        panels = self._window.panels
        lack = _without_alignments(record)
        target_arcmin = stored.settings.verdict.target_arcmin
        panels.cloud.clear(lack)  # of the session shown before
        if stored.results is not None:
            panels.results.comparison.use(record, stored.settings)
            for number, last in [*record.alignments.items()][-1:]:
                self._show_alignment(number, last.eyes[0])
        # Then: residuals on the screen choose the alignment whose clouds are shown.
        panels.results.show_results(stored.results, record, target_arcmin)
        panels.session.set_read_only(True)
        panels.session.show_record(record, stored.results)
        panels.trials.set_read_only(True)
        panels.trials.show_record(record)
        note = lack or _other_verdicts(stored)
        self._page.show_session(record, stored.results, target_arcmin, note)
        self._window.show_page("review")
        self._window.show_wearer(record.wearer)
        self.opened.emit(record.path)

    def _show_alignment(self, number: int, eye: Eye) -> None:
        """Show the clouds of an alignment, the hand in the colours of its residuals."""
        if self.record is not None and self._results is not None:
            residuals_m = self._results.alignments[number][eye].residuals_m
            cloud = self._window.panels.cloud
            reach_m = residuals_reach_m(self._results)
            cloud.show_alignment(self.record.alignments[number], residuals_m, reach_m)


def _without_alignments(record: SessionRecord) -> str:
    """Return that a session has no alignments; empty if it has some."""
    if record.alignments:
        return ""
    if record.facts.verified:
        return tr("This session was only verified; it has no alignments.")
    return tr("It contains no alignments yet.")


def _other_verdicts(stored: _Stored) -> str:
    """Return the verdicts that a session holds if they are not those of solving it again."""
    held, results = (stored.record.results or {}).get("eyes"), stored.results
    if results is None or not isinstance(held, dict):
        return ""
    words = [
        f"{EYE_NAMES[eye].lower()} {VERDICT_WORDS[verdict]}"
        for eye, found in results.verdicts.items()
        if isinstance(held.get(eye), dict)
        and (verdict := held[eye].get("verdict")) in VERDICT_WORDS
        and verdict != found.name
    ]
    text = tr("Solved again by this version; when it was recorded, the verdict was {}.")
    return text.format(", ".join(words)) if words else ""
