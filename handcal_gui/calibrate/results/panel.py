"""The results panel: eye shifts, their uncertainty, and the benefit of another alignment."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QComboBox, QLabel, QStackedLayout, QStackedWidget, QTabWidget, QWidget

from handcal.core.types import EYES, Alignment, Eye
from handcal.register.results import Results
from handcal.session.judged_trials import EyeTrials, eye_trials
from handcal.session.record import SessionRecord
from handcal.session.trial import Trial
from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import add_action
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.parts.tab_bar import TabBar
from handcal_gui.calibrate.results.compare_tab import CompareTab
from handcal_gui.calibrate.results.convergence_plot import ConvergencePlot
from handcal_gui.calibrate.results.distance_tab import DistanceTab
from handcal_gui.calibrate.results.residuals_tab import ResidualsTab
from handcal_gui.calibrate.results.verdict_card import VerdictCard
from handcal_gui.widgets.brief import copy_text
from handcal_gui.widgets.fields import paragraph
from handcal_gui.widgets.layouts import fit_soon, hbox, vbox
from handcal_gui.widgets.result_rows import (
    EYE_NAMES,
    PHI,
    another_text,
    result_rows,
    single_alignment_rows,
    trial_row,
    verdict_rows,
)
from handcal_gui.widgets.table import Table, rows_as_text

_EMPTY = tr(
    "Nothing is solved yet.\n\nEach eye's position, its uncertainty and the verdict appear here "
    "once it is solved or verified."
)
_ALONE = tr(
    "±: of measuring the hand in this alignment alone. That of the result also counts how well "
    "the wearer aligns."
)
_MARGINS_PX = 3 * SPACING_PX // 2
"""Of the tab of the eyes: above the cards, between them and the numbers, and below."""


class ResultsPanel(QWidget):
    """Shows results in tabs: eyes, plots, residuals, alignments, comparison.

    Attributes
    ----------
    compare_requested : Signal(str)
        The method to solve the same alignments with; answered by `show_comparison` or
        `comparison_failed`.
    compare_cancelled : Signal()
        The answer is no longer needed.
    """

    compare_requested = Signal(str)
    compare_cancelled = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("results-panel")
        self.setAccessibleName(tr("Results"))
        self._results: Results | None = None
        self._trials: Mapping[int, Trial] = {}
        self._judged: Mapping[Eye, EyeTrials] = {}
        self._cards = {eye: VerdictCard(eye) for eye in EYES}
        self._numbers = Table("numbers-of-both-eyes", tr("Numbers of both eyes"))
        self._convergence = ConvergencePlot()
        self._residuals = ResidualsTab()
        self._alignments = Table("each-alignment-alone", tr("Each alignment alone"))
        self._another = QLabel()
        self._another.setWordWrap(True)
        self._distances = DistanceTab()
        self._compare = CompareTab()
        self._compare.requested.connect(self.compare_requested)
        self._compare.cancelled.connect(self.compare_cancelled)
        self._fit_soon = fit_soon(self._fit, self)
        self._lay_out()
        self._add_copy()

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the results of a snapshot if they have changed."""
        procedure, record = snapshot.procedure, snapshot.record
        if procedure.results is not self._results:
            self.show_results(procedure.results, record.alignments)
        self.show_trials(record, snapshot.settings.solve.verdict.target_arcmin)

    def show_results(
        self,
        results: Results | None,
        alignments: Mapping[int, Alignment],
        *,
        has_verdicts: bool = True,
    ) -> None:
        """Show results, or a hint if there are none.

        Parameters
        ----------
        results : Results or None
        alignments : mapping of int to Alignment
            By number. A solved alignment that is missing here has no residual map, such as one
            that could not be written to a full disk.
        has_verdicts : bool
            False if the page beside the panel shows the verdicts.
        """
        self._results, self._trials, self._judged = results, {}, {}
        self._copy.setEnabled(results is not None)
        self._stack.setCurrentIndex(0 if results is None else 1)
        if results is None:
            self._tabs.setCurrentIndex(0)
            return
        for card in self._cards.values():
            card.setVisible(has_verdicts)
        self._show_eyes(results)
        if not results.alignments:
            self._choice.setCurrentIndex(0)
        self._choice.setEnabled(bool(results.alignments))
        for tab in (self._residuals, self._alone):
            self._tabs.setTabVisible(self._tabs.indexOf(tab), bool(results.alignments))
        self._convergence.show_results(results)
        self._residuals.show_results(results, alignments)
        self._alignments.show_rows([q.name for q in PHI], single_alignment_rows(results))
        self._another.setText(another_text(results))
        self._distances.show_results(results)
        self._compare.show_results(results)
        self._fit()

    def show_trials(self, record: SessionRecord, target_arcmin: float) -> None:
        """Show the errors of a session's trials among the numbers, against the lab's target."""
        if self._results is not None and record.trials is not self._trials:
            self._trials = record.trials
            self._judged = eye_trials(self._results, record, target_arcmin)
            self._show_eyes(self._results)
            self._fit()

    def _show_eyes(self, results: Results) -> None:
        """Show the verdicts and the numbers of both eyes, with those of their trials."""
        for eye, card in self._cards.items():
            card.show_verdict(results, self._judged.get(eye))
        row = trial_row(self._judged, self._trials.values()) if self._trials else None
        names = [EYE_NAMES[eye] for eye in EYES]
        self._numbers.show_rows(names, result_rows(results, row))

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Fit the tab of the eyes into the panel."""
        super().resizeEvent(event)
        self._fit_soon.start()

    def show_comparison(self, other: Results) -> None:
        """Show the results of another method for the same alignments."""
        self._compare.show_comparison(other)

    def show_comparison_progress(self, _doing: str, share: float) -> None:
        """Show the share of the alignments that the other method has solved."""
        self._compare.show_progress(share)

    def comparison_failed(self, text: str) -> None:
        """Show the reason why there is no comparison."""
        self._compare.show_failure(text)

    def as_text(self) -> str:
        """Return all numbers shown as tab-separated text."""
        if self._results is None:
            return ""
        rows = verdict_rows(self._results, self._judged)
        verdicts = rows_as_text((tr("Verdict"), tr("Reason")), rows)
        tables = self._numbers, self._alignments, self._distances.table, self._compare.table
        return "\n\n".join([verdicts, *(table.as_text() for table in tables if table.keys)])

    def _fit(self) -> None:
        """Show the reasons of the verdicts only where the numbers fit below them."""
        width_px = (self.width() - 2 * SPACING_PX) // 2
        room_px = self.height() - self._tabs.tabBar().sizeHint().height() - _MARGINS_PX
        for is_shown in (True, False):
            for card in self._cards.values():
                card.show_reason(is_shown)
            cards_px = max(
                max(card.sizeHint().height(), card.heightForWidth(width_px))
                for card in self._cards.values()
            )
            if cards_px + self._numbers.whole_height_px <= room_px:
                break

    def _add_copy(self) -> None:
        self._copy = add_action(
            self,
            tr("Copy as text"),
            "Ctrl+C",
            lambda: copy_text(self, self.as_text(), tr("Copied: all numbers of the results")),
        )
        self._copy.setObjectName("copy")
        self._copy.setEnabled(False)  # until there are results
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)

    def _lay_out(self) -> None:
        empty = QLabel(_EMPTY)
        empty.setWordWrap(True)
        empty.setAlignment(Qt.AlignmentFlag.AlignCenter)
        empty.setContentsMargins(*4 * (2 * SPACING_PX,))
        self._tabs = tabs = QTabWidget()
        tabs.setTabBar(TabBar())
        tabs.setObjectName("results-tabs")
        tabs.setDocumentMode(True)
        tabs.setUsesScrollButtons(False)  # a long title is shortened instead
        tabs.setElideMode(Qt.TextElideMode.ElideRight)
        tabs.addTab(self._eyes_tab(), tr("Eyes"))
        tabs.addTab(self._plots_tab(), tr("Plots"))
        tabs.setTabToolTip(1, tr("Error against distance, and convergence of each registration"))
        tabs.addTab(self._residuals, tr("Residuals"))
        self._alone = self._alignments_tab()
        tabs.addTab(self._alone, tr("Single"))
        tabs.setTabToolTip(3, tr("φ of each alignment alone"))
        tabs.addTab(self._compare, tr("Compare"))
        self._stack = QStackedLayout(self)
        self._stack.addWidget(empty)
        self._stack.addWidget(tabs)

    def _eyes_tab(self) -> QWidget:
        cards = hbox(*((card, 1) for card in self._cards.values()), spacing=SPACING_PX)
        tab = QWidget()
        vbox(cards, (self._numbers, 1), on=tab, margins=SPACING_PX // 2, spacing=SPACING_PX // 2)
        return tab

    def _plots_tab(self) -> QWidget:
        tab, iterations, stack = QWidget(), QWidget(), QStackedWidget()
        meaning = paragraph("", tr("A line that ends level has converged."))
        meaning.setContentsMargins(SPACING_PX, 0, SPACING_PX, SPACING_PX // 2)
        vbox((self._convergence, 1), meaning, on=iterations, margins=0, spacing=0)
        self._choice = QComboBox()
        self._choice.setObjectName("plots-choice")
        self._choice.setAccessibleName(tr("Plot"))
        for name, plot in (
            (tr("Error against distance"), self._distances),
            (tr("Convergence"), iterations),
        ):
            self._choice.addItem(name)
            stack.addWidget(plot)
        self._choice.currentIndexChanged.connect(stack.setCurrentIndex)
        vbox(self._choice, (stack, 1), on=tab, margins=SPACING_PX // 2, spacing=SPACING_PX // 2)
        return tab

    def _alignments_tab(self) -> QWidget:
        tab = QWidget()
        meaning = paragraph("", _ALONE)
        vbox((self._alignments, 1), meaning, self._another, on=tab, spacing=SPACING_PX)
        return tab
