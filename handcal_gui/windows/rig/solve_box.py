"""The bottom of a step: the Solve button and the result."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtWidgets import QVBoxLayout, QWidget

from handcal.progress import Progress
from handcal.rig_types import Origin
from handcal.station.doctor import Finding, Health
from handcal_gui.theme import SPACING_PX
from handcal_gui.translation import tr
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.fields import main_button, with_name
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.job_bar import JobBar
from handcal_gui.widgets.layouts import hbox
from handcal_gui.widgets.number_table import NumberTable
from handcal_gui.widgets.sentence import sentence
from handcal_gui.widgets.times import local_time
from handcal_gui.windows.rig.rows import COLUMNS
from handcal_gui.windows.rig.solve import SolvedPart

HEALTHS = {"good": Health.GOOD, "needs more views": Health.LIMITED, "bad": Health.BROKEN}


class SolveBox(QWidget):
    """Solves in a job, and shows verdict, reason, worst image and numbers.

    Attributes
    ----------
    button : MainButton
        The Solve button, connected and enabled by the page.
    bar : JobBar
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("solveBox")
        self.button = main_button("solve", tr("Solve"))
        self.bar = JobBar()
        self.bar.failed.connect(self._show_failure)
        self._verdict = FindingLine("verdict")
        self._worst = FindingLine("worst")
        self._lenses = with_name(ElidedLabel(), "lenses")  # whole, it would hide the images
        self._table = NumberTable("numbers", tr("Numbers"))
        self._table.setMinimumWidth(40 * SPACING_PX)
        self._lay_out()
        self.show_origin(None)

    def run(self, work: Callable[[], object], then: Callable[[Any], object]) -> None:
        """Solve in a job and pass the result to `then`."""

        def solve(progress: Progress) -> object:
            solved = work()
            progress.check()
            return solved

        self.bar.run(tr("Solving"), solve, then)

    def show_origin(self, origin: Origin | None) -> None:
        """Show an earlier result; None if there is none."""
        self._worst.hide()
        self._lenses.hide()
        self._table.hide()
        if origin is None:
            self.show_finding(Finding("", Health.LIMITED, tr("Not solved yet")))
            return
        text = tr("Solved {}: {}; {}").format(
            local_time(origin.made), origin.verdict, origin.reason
        )
        self.show_finding(Finding("", HEALTHS.get(origin.verdict, Health.LIMITED), text))

    def show_finding(self, finding: Finding) -> None:
        """Show a message about the result."""
        self._verdict.show_finding(finding)

    def show_solved(self, solved: SolvedPart, kept: str) -> None:
        """Show a result; `kept` describes its use."""
        verdict = solved.verdict
        text = f"{verdict.name}: {verdict.reason}"
        self.show_finding(Finding("", HEALTHS[verdict.name], text, kept))
        self._worst.setVisible(solved.worst is not None)
        if solved.worst is not None:
            worst = tr("Worst: {}, {:.2f} px: {}").format(
                solved.worst.name, solved.worst.rms_px, solved.worst.why
            )
            self._worst.show_finding(Finding("", Health.LIMITED, worst))
        self._lenses.setText(f"{sentence(solved.lenses)}.")
        self._lenses.setVisible(bool(solved.lenses))
        self._table.show_rows(COLUMNS, solved.rows)
        self._table.show()

    def _show_failure(self, why: str) -> None:
        self._worst.hide()
        self._lenses.hide()
        self._table.hide()
        self.show_finding(Finding("", Health.BROKEN, why))

    def _lay_out(self) -> None:
        left = QVBoxLayout()
        left.setSpacing(SPACING_PX)
        row = hbox(self.button, (self.bar, 1), spacing=2 * SPACING_PX)
        left.addLayout(row)
        left.addWidget(self._verdict)
        left.addWidget(self._worst)
        left.addWidget(self._lenses)
        left.addStretch(1)
        hbox((left, 1), self._table, on=self, margins=0, spacing=2 * SPACING_PX)
