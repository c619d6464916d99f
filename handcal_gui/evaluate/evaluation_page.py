"""The page of one evaluation: settings, progress and results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QDialog, QLabel, QWidget

from handcal.core.errors import HandcalError
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.engine.latest_job import LatestJob
from handcal_gui.evaluate.results_view import ResultsView
from handcal_gui.evaluate.work import Evaluation, Outcome, Readiness
from handcal_gui.widgets.action_strip import action_strip
from handcal_gui.widgets.entries_form import EntriesForm
from handcal_gui.widgets.fields import button, main_button, make_linked, paragraph, with_name
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.job_bar import JobBar
from handcal_gui.widgets.layouts import keep_space, vbox


@dataclass(frozen=True, slots=True, eq=False)
class Preparation:
    """A preparation of an evaluation: its button and its dialog."""

    button: str
    help_text: str
    """Text and tooltip of the button."""
    is_possible: Callable[[Any], bool]
    """Returns whether the entries suffice to open the dialog."""
    dialog: Callable[[Any, QWidget], QDialog]
    """Creates the dialog, given entries and a parent; its `entries` have the changes made there."""
    name: str = "prepare"
    """Object name of the button."""
    request: str = ""
    """Sentence that asks for what to enter first; shown while the dialog cannot be opened."""


@dataclass(frozen=True, slots=True, eq=False)
class EvaluationSpec:
    """The specification of an evaluation and its page."""

    title: str
    question: str
    """The question it answers, and its duration."""
    evaluation: Evaluation
    form: Callable[[], EntriesForm]
    """Creates the form for its entries."""
    coming: str = ""
    """Announces what its results will show, in their place before there are any."""
    preparations: tuple[Preparation, ...] = ()
    """Buttons and dialogs that prepare data and devices."""
    note: str = ""
    """HTML about the format of its data, with a link to a page of the manual."""


class EvaluationPage(QWidget):
    """A page that runs one evaluation in a job and shows its result.

    Parameters
    ----------
    spec : EvaluationSpec
    entries : object
        Dataclass with the initial values.
    read : callable
        Shows a page of the manual.

    Attributes
    ----------
    busy_changed : Signal(bool)
    form : EntriesForm
    """

    busy_changed = Signal(bool)

    def __init__(
        self,
        spec: EvaluationSpec,
        entries: Any,
        read: Callable[[str], object] = lambda _page: None,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._evaluation = spec.evaluation
        self._question_text = spec.question
        self._question = paragraph("question")
        self._entries = entries
        self._readiness: Readiness | None = None
        self._failure = self._waits_for = ""
        self._is_done = self._is_cancelled = False
        self.form = spec.form()
        self.form.show_entries(entries)
        self._button = main_button("run", tr("Run"))
        self._dialog: Any = None
        self._preparing = {
            button(one.name, one.button, help_text=one.help_text): one for one in spec.preparations
        }
        self._request = with_name(QLabel(), "preparationRequest")
        # It stands beside the bar for a moment as a job starts, and would widen a small window.
        self._request.setMinimumWidth(1)
        self._bar = JobBar()
        self._found = FindingLine("readiness")
        keep_space(self._found)
        self._results = ResultsView(spec.coming)
        self._look = LatestJob(self._check, self)
        self._lay_out(spec, read)
        self.form.changed.connect(self._on_entries_changed)
        self._button.clicked.connect(self.run)
        for prepare, preparation in self._preparing.items():
            prepare.clicked.connect(partial(self._prepare, preparation))
        self._bar.failed.connect(self._show_failure)
        self._bar.cancelled.connect(self._note_cancelled)
        self._bar.busy_changed.connect(self._change_busy)
        self._look.answered.connect(self._on_readiness)
        self._look.failed.connect(self._show_failure)

    @property
    def entries(self) -> Any:
        """The settings as entered."""
        return self._entries

    @property
    def kept(self) -> str:
        """Sentence that says what of the evaluation is kept if it is cancelled."""
        return self._evaluation.kept

    @property
    def is_busy(self) -> bool:
        """True while the evaluation runs."""
        return self._bar.is_busy

    def run(self) -> None:
        """Start or resume the evaluation."""
        entries = self._entries
        self._failure, self._is_done, self._is_cancelled = "", False, False
        self._results.show_outcome(None)
        self._bar.run(
            tr("Starting"),
            lambda progress: self._evaluation.run(entries, progress),
            self._show_outcome,
        )

    def cancel(self) -> None:
        """Cancel the evaluation; completed trials of a study are kept."""
        self._bar.cancel()

    def stop(self) -> None:
        """Cancel the evaluation or its preparation, and wait for the end."""
        if self._dialog is not None:
            self._dialog.reject()
        self._bar.stop()
        self._look.stop()

    def wait_for(self, title: str) -> None:
        """Wait for another evaluation, given by its title; empty for none."""
        self._waits_for = title
        self._refresh()

    def showEvent(self, event: QShowEvent) -> None:
        """Check the folder again."""
        super().showEvent(event)
        self._ask()

    def _prepare(self, preparation: Preparation) -> None:
        """Open the dialog of a preparation, and take the entries with which it is closed."""
        self._dialog = dialog = preparation.dialog(self._entries, self)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.finished.connect(self._end_preparing)
        dialog.open()

    def _end_preparing(self) -> None:
        assert self._dialog is not None
        dialog, self._dialog = self._dialog, None
        self._take_entries(dialog.entries)

    def _on_entries_changed(self) -> None:
        self._results.show_outcome(None)
        self._take_entries(self.form.take(self._entries))

    def _take_entries(self, entries: Any) -> None:
        self._entries = entries
        self._failure, self._is_done, self._is_cancelled = "", False, False
        self._ask()

    def _ask(self) -> None:
        """Check the settings; nothing can be run until the check is done."""
        self._readiness = None
        if not self.is_busy and self.isVisible():
            self._look.ask(self._entries)
        self._refresh()

    def _check(self, entries: Any) -> Readiness:
        try:
            return self._evaluation.readiness(entries)
        except HandcalError as error:
            return Readiness(Finding("", Health.BROKEN, str(error)))

    def _on_readiness(self, entries: Any, readiness: Readiness) -> None:
        if entries == self._entries and not self.is_busy:
            self._readiness = readiness
            self._refresh()

    def _show_outcome(self, outcome: Outcome) -> None:
        self._results.show_outcome(outcome)
        self._is_done = True
        self._refresh()

    def _show_failure(self, why: str) -> None:
        self._failure = why
        self._refresh()

    def _note_cancelled(self) -> None:
        self._is_cancelled = True

    def _change_busy(self, is_busy: bool) -> None:
        self.form.setEnabled(not is_busy)
        self._ask()
        self.busy_changed.emit(is_busy)

    def _refresh(self) -> None:
        readiness = self._readiness
        requests = []
        for prepare, preparation in self._preparing.items():
            is_possible = preparation.is_possible(self._entries)
            prepare.setEnabled(is_possible and not self.is_busy)
            requests += [] if is_possible else [preparation.request]
        self._request.setText(" ".join(requests))
        self._request.setVisible(bool(self._request.text()) and not self.is_busy)
        is_shown = readiness is not None and readiness.is_done and not self._results.is_empty
        can_run = readiness is not None and readiness.can_run and not self._waits_for
        self._button.setEnabled(can_run and not is_shown)
        is_again = self._is_done and readiness is not None and not readiness.is_done
        task = tr("Check the entries, then start at the lower right.")
        if self.is_busy or is_shown:
            task = self.kept if self.is_busy else tr("Change the entries for another study.")
        elif is_again:
            task = tr("Change the entries, or run again if the files have changed.")
        if readiness is not None or self.is_busy or not self._question.text():
            self._question.setText(f"{self._question_text} {task}")
        if readiness is not None:
            self._button.setText(tr("Run again") if is_again else readiness.button)
        self._found.setVisible(not self.is_busy)  # the progress bar says more
        if finding := self._finding():
            is_waiting = bool(self._waits_for) and not self._failure
            self._found.show_finding(finding, is_waiting=is_waiting)

    def _finding(self) -> Finding | None:
        """Return the message to show; None to keep the present one."""
        if self._failure:
            return Finding("", Health.BROKEN, self._failure)
        if self._waits_for:
            found = tr("{} is running").format(self._waits_for)
            return Finding("", Health.LIMITED, found, tr("only one can run at a time"))
        if self._is_done:
            return Finding("", Health.GOOD, tr("Done"))
        if (readiness := self._readiness) is None:
            return None
        finding = readiness.finding
        if not self._is_cancelled:
            return finding
        if finding.health is Health.GOOD and not readiness.is_done:  # ready for a new start
            return replace(finding, found=tr("Cancelled; the next run starts from the beginning"))
        return replace(finding, found=tr("Cancelled; {}").format(finding.found))

    def _lay_out(self, spec: EvaluationSpec, read: Callable[[str], object]) -> None:
        note = make_linked(paragraph("format", spec.note))
        note.linkActivated.connect(read)
        note.setVisible(bool(spec.note))
        vbox(
            self._question,
            note,
            self.form,
            self._found,
            (self._results, 1),
            action_strip(self._button, *self._preparing, self._request, bar=self._bar),
            on=self,
            margins=0,
            spacing=SPACING_PX,
        )
