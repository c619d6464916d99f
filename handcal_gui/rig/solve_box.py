"""The bottom of a step: the verdict on its result, or what is needed to solve it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QWidget

from handcal.core.progress import Progress
from handcal.core.types import Origin
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.rig.rows import COLUMNS, LENS_COLUMNS
from handcal_gui.rig.solve import SolvedPart
from handcal_gui.widgets.fields import main_button, paragraph
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.job_bar import JobBar
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.table import Table
from handcal_gui.widgets.times import local_time

HEALTHS = {"good": Health.GOOD, "needs more views": Health.LIMITED, "bad": Health.BROKEN}

_NOT_YET = Finding("", Health.LIMITED, tr("Not solved yet"))


class SolveBox(QWidget):
    """Solves in a job, and shows verdict, reason and worst image.

    Attributes
    ----------
    button : MainButton
        The Solve button, placed and connected by the page.
    bar : JobBar
    numbers : QWidget
        The tables of the numbers and of the lens models compared, placed by the page.
    table : Table
    shown : Signal()
        Another result is shown, or none.
    """

    shown = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("solveBox")
        self.button = main_button("solve", tr("&Solve"))
        self.bar = JobBar()
        self.bar.failed.connect(self._show_failure)
        self._verdict = FindingLine("verdict")
        self._worst = paragraph("worst")
        self._worst.setIndent(3 * SPACING_PX)  # below the verdict's text
        self._lenses = Table("lenses", tr("Lens models compared"))
        self.table = Table("numbers", tr("Numbers"))
        self.numbers = QWidget()
        hbox((self.table, 2), (self._lenses, 3), on=self.numbers, spacing=SPACING_PX)
        self._shown = _NOT_YET
        self._need = ""
        vbox(self._verdict, self._worst, on=self, margins=0, spacing=SPACING_PX // 2)
        self.show_origin(None)

    @property
    def failure(self) -> str:
        """The finding of a step that failed or is bad; empty otherwise."""
        return self._shown.found if self._shown.health is Health.BROKEN else ""

    def run(self, work: Callable[[], object], then: Callable[[Any], object]) -> None:
        """Solve in a job and pass the result to `then`."""

        def solve(progress: Progress) -> object:
            solved = work()
            progress.check()
            return solved

        self.bar.run(tr("Solving"), solve, then)

    def show_origin(self, origin: Origin | None, outdated: str = "") -> None:
        """Show an earlier result, or that it is outdated; None if there is none."""
        if origin is None or outdated:
            self.show_finding(Finding("", Health.LIMITED, outdated) if outdated else _NOT_YET)
        else:
            text = tr("Solved {}: {}; {}; RMS {:.3f} px").format(
                local_time(origin.made), origin.verdict, origin.reason, origin.rms_px
            )
            self.show_finding(Finding("", HEALTHS.get(origin.verdict, Health.LIMITED), text))
        self._clear()

    def show_finding(self, finding: Finding) -> None:
        """Show a message about the result, followed by what is needed to solve."""
        self._shown = finding
        self._verdict.show_finding(finding, is_waiting=finding is _NOT_YET, need=self._need)

    def allow(self, need: str, *, is_busy: bool) -> None:
        """Enable the button, unless something is needed first, or being done."""
        self.button.setEnabled(not need and not is_busy)
        if need != self._need:
            self._need = need
            self.show_finding(self._shown)

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
            self._worst.setText(f"{worst}.")
        self._lenses.show_rows(LENS_COLUMNS, solved.lenses)
        self._lenses.setVisible(bool(solved.lenses))
        self.table.show_rows(COLUMNS, solved.rows)
        self.shown.emit()

    def _show_failure(self, why: str) -> None:
        self.show_finding(Finding("", Health.BROKEN, why))
        self._clear()

    def _clear(self) -> None:
        self._worst.hide()
        self._lenses.hide()
        self.table.show_rows(COLUMNS, ())
        self.shown.emit()
