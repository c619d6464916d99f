"""Comparison with the results of another method for the same alignments."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QLabel,
    QProgressBar,
    QPushButton,
    QWidget,
)

from handcal.core.types import METHODS, Method
from handcal.register.results import Results
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import with_name
from handcal_gui.widgets.job_bar import show_share
from handcal_gui.widgets.layouts import hbox, keep_space, vbox
from handcal_gui.widgets.result_rows import comparison_rows
from handcal_gui.widgets.table import Table

_MEANINGS: Mapping[Method, str] = {
    "paper": tr("as published by Hu et al. 2021; slow."),
    "linear": tr("the paper's model, solved with all three rows of each pair."),
    "consistent": tr("exact model; robust to cut edges and a rotated hand; the default."),
    "icp": tr("rigid registration, the paper's baseline."),
    "icp-open3d": tr("the same by Open3D, which must be installed."),
}


class CompareTab(QWidget):
    """Requests the results of another method, and shows them beside the present ones.

    Attributes
    ----------
    table : Table
    requested : Signal(str)
        The method to solve the same alignments with.
    cancelled : Signal()
        The requested results are no longer needed.
    """

    requested = Signal(str)
    cancelled = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("comparison")
        self._results: Results | None = None
        self.table = Table("comparison-of-methods", tr("Comparison of methods"))
        keep_space(self.table)
        self._methods = QComboBox()
        self._methods.setObjectName("comparison-method")
        self._methods.setAccessibleName(tr("Compare with method"))
        self._methods.currentTextChanged.connect(self._explain)
        self._compare = QPushButton(tr("&Compare"))
        self._compare.setObjectName("comparison-start")
        self._compare.clicked.connect(self._ask)
        self._cancel = QPushButton(tr("Ca&ncel"))
        self._cancel.setObjectName("comparison-cancel")
        self._cancel.clicked.connect(self._request_cancel)
        self._progress = with_name(
            QProgressBar(format="%p %"), "comparison-progress", tr("Progress")
        )
        self._progress.setTextVisible(False)
        keep_space(self._progress)
        self._progress.setMaximumHeight(SPACING_PX)
        self._status = QLabel()
        self._status.setObjectName("comparison-status")
        self._status.setTextFormat(Qt.TextFormat.PlainText)
        self._status.setWordWrap(True)
        self._lay_out()
        self._set_busy(False)

    def show_results(self, results: Results) -> None:
        """Set the results to compare with; an earlier comparison is removed."""
        if self._cancel.isEnabled():
            self._request_cancel()
        self._results = results
        self._methods.clear()
        for method in METHODS:
            if method != results.method:
                self._methods.addItem(method)
        self.table.show_rows((), ())
        self.table.hide()

    def show_comparison(self, other: Results) -> None:
        """Show another method's results of the same alignments."""
        self._set_busy(False)
        if self._results is None:
            return
        columns = self._results.method, other.method, "Δ"
        self.table.show_rows(columns, comparison_rows(self._results, other))
        self.table.show()
        self._status.setText(
            tr(
                "Δ: {} minus {}. σ and expected error are realistic only for "
                "“consistent”; the other methods' are too small."
            ).format(other.method, self._results.method)
        )

    def show_progress(self, share: float) -> None:
        """Show the share that is done, 0..1."""
        show_share(self._progress, share)

    def show_failure(self, text: str) -> None:
        """Show the reason why there is no comparison."""
        self._set_busy(False)
        self._status.setText(text)

    def _explain(self, method: Method | Literal[""]) -> None:
        text = tr("{}: {} Compare shows it beside the present results.")
        self._status.setText(text.format(method, _MEANINGS[method]) if method else "")

    def _ask(self) -> None:
        method = self._methods.currentText()
        self._set_busy(True)
        self._status.setText(tr("Solving with {} …").format(method))
        self.requested.emit(method)

    def _request_cancel(self) -> None:
        self._set_busy(False)
        self._status.setText(tr("Cancelled."))
        self.cancelled.emit()

    def _set_busy(self, is_busy: bool) -> None:
        self._progress.setRange(0, 0)
        self._progress.setVisible(is_busy)
        has_focus = self._compare.hasFocus() or self._cancel.hasFocus()
        for one, is_offered in ((self._cancel, is_busy), (self._compare, not is_busy)):
            one.setVisible(is_offered)  # in the same place
            one.setEnabled(is_offered)
            if is_offered and has_focus:
                one.setFocus()
        self._methods.setEnabled(not is_busy)

    def _lay_out(self) -> None:
        label = QLabel(tr("Compare &with"))
        label.setBuddy(self._methods)
        row = hbox(label, (self._methods, 1), self._compare, self._cancel, spacing=SPACING_PX)
        parts = row, self._progress, self._status, (self.table, 1)
        vbox(*parts, on=self, margins=SPACING_PX // 2, spacing=SPACING_PX)
