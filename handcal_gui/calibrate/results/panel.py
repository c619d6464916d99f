"""The results panel: verdicts, numbers, plots, residuals, and a comparison with another method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QResizeEvent, QShowEvent
from PySide6.QtWidgets import (
    QComboBox,
    QLabel,
    QPushButton,
    QStackedLayout,
    QStackedWidget,
    QTabWidget,
    QWidget,
)

from handcal.calibration.solve_again import solve_again
from handcal.core.geometry import transform
from handcal.core.progress import Progress
from handcal.core.types import EYES, METHODS, Alignment, Eye, EyeShift, Float64, Method
from handcal.register.benefit import DISTANCES_M
from handcal.register.results import Results, SolveSettings, residuals_reach_m
from handcal.session.record import SessionRecord, eye_trials
from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import add_action
from handcal_gui.app.theme import SPACING_PX, colors, follow_theme
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.parts.residual_scale import residual_ramp
from handcal_gui.calibrate.parts.result_card import ResultCard
from handcal_gui.widgets.brief import copy_text
from handcal_gui.widgets.fields import paragraph
from handcal_gui.widgets.job_bar import JobBar
from handcal_gui.widgets.layouts import hbox, keep_space, vbox
from handcal_gui.widgets.plots import Plot
from handcal_gui.widgets.result_rows import (
    EYE_NAMES,
    PHI,
    another_text,
    comparison_rows,
    result_rows,
    single_alignment_rows,
    trial_row,
    verdict_rows,
)
from handcal_gui.widgets.table import Row, Table, rows_as_text

_SHADES = 32
_POINTS_ACROSS = 130
"""A hand has about as many points across a large map, beside one another."""
_EMPTY = tr(
    "Nothing is solved yet.\n\nEach eye's position, its uncertainty and the verdict appear here "
    "once it is solved or verified."
)
_ALONE = tr(
    "±: of measuring the hand in this alignment alone. That of the result also counts how well "
    "the wearer aligns."
)
_DISTANCES = tr(
    "Expected error in arcminutes; bars and brackets hold 95 %. Dashed: without the calibration. "
    "Only the eye's place is uncertain here: an error of the rig itself comes on top, and matters "
    "most far away."
)
_LINES = tr("Each line ends in the number of its alignment. One that ends level has converged.")
_TO_POINTS, _TO_SURFACE = tr("Point RMS (mm)"), tr("Surface RMS (mm)")
_MEANINGS = {
    _TO_POINTS: tr(
        "Distance from the hand's points to their partners on the cursor at each iteration\n"
        "of each alignment, root mean square."
    ),
    _TO_SURFACE: tr(
        "Distance from the hand's points to the cursor's surface, along its normals, at each\n"
        "iteration of each alignment, root mean square. It is less than the Point RMS\n"
        "among the numbers of each eye, which is to single points of the cursor."
    ),
}
_SYMBOLS = {"left": "o", "right": "s"}
_MAX_SYMBOLS = 60
_BESIDE = {"left": -0.01, "right": 0.01}
"""Distance of an eye's bars from their place, so that the eyes' do not hide each other."""
_METHODS: Mapping[Method, str] = {
    "paper": tr("as published by Hu et al. 2021; slow."),
    "linear": tr("the paper's model, solved with all three rows of each pair."),
    "consistent": tr("exact model; robust to cut edges and a rotated hand; the default."),
    "icp": tr("rigid registration, the paper's baseline."),
    "icp-open3d": tr("the same by Open3D, which must be installed."),
}


class ResultsPanel(QWidget):
    """Shows results in tabs: eyes, plots, residuals, alignments, another method.

    Attributes
    ----------
    comparison : _CompareTab
    residuals : ResidualsTab
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("results-panel")
        self.setAccessibleName(tr("Results"))
        self._results: Results | None = None
        self._record: SessionRecord | None = None
        self._target_arcmin = 0.0
        self._card = ResultCard()
        self._numbers = Table("numbers-of-both-eyes", tr("Numbers of both eyes"))
        self._convergence = _ConvergencePlot()
        self.residuals = ResidualsTab()
        self._alignments = Table("each-alignment-alone", tr("Each alignment alone"))
        self._another = QLabel()
        self._another.setWordWrap(True)
        self._distances = _DistanceTab()
        self.comparison = _CompareTab()
        self._lay_out()
        self._add_copy()

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the results of a snapshot if they have changed."""
        results, record = snapshot.procedure.results, snapshot.record
        target_arcmin = snapshot.settings.solve.verdict.target_arcmin
        if results is not self._results:
            self.show_results(results, record, target_arcmin)
        elif record is not self._record and results is not None:
            self._show_eyes(results, record)

    def show_results(
        self, results: Results | None, record: SessionRecord | None, target_arcmin: float = 0.0
    ) -> None:
        """Show the results of a session, or a hint if there are none.

        A solved alignment that the record does not hold has no residual map, such as one that could
        not be written to a full disk.
        """
        self._results, self._record, self._target_arcmin = results, record, target_arcmin
        self._copy.setEnabled(results is not None)
        self._stack.setCurrentIndex(0 if results is None else 1)
        if results is None or record is None:
            self._tabs.setCurrentIndex(0)
            return
        self._show_eyes(results, record)
        if not results.alignments:
            self._choice.setCurrentIndex(0)
        self._choice.setEnabled(bool(results.alignments))
        for tab in (self.residuals, self._alone):
            self._tabs.setTabVisible(self._tabs.indexOf(tab), bool(results.alignments))
        self._convergence.show_results(results)
        self.residuals.show_results(results, record.alignments)
        self._alignments.show_rows([q.name for q in PHI], single_alignment_rows(results))
        self._another.setText(another_text(results))
        self._distances.show_results(results)
        self.comparison.show_results(results)

    def _show_eyes(self, results: Results, record: SessionRecord) -> None:
        """Show the verdicts and the numbers of both eyes, with those of their trials."""
        self._record = record
        self._card.show_results(results, record, self._target_arcmin)
        judged = eye_trials(results, record, self._target_arcmin)
        row = trial_row(judged, record.trials.values()) if record.trials else None
        names = [EYE_NAMES[eye] for eye in EYES]
        self._numbers.show_rows(names, result_rows(results, row))

    def as_text(self) -> str:
        """Return all numbers shown as tab-separated text."""
        if self._results is None or self._record is None:
            return ""
        judged = eye_trials(self._results, self._record, self._target_arcmin)
        rows = verdict_rows(self._results, judged)
        verdicts = rows_as_text((tr("Verdict"), tr("Reason")), rows)
        tables = self._numbers, self._alignments, self._distances.table, self.comparison.table
        return "\n\n".join([verdicts, *(table.as_text() for table in tables if table.keys)])

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
        tabs.setObjectName("results-tabs")
        tabs.setDocumentMode(True)
        tabs.setUsesScrollButtons(False)  # a long title is shortened instead
        tabs.setElideMode(Qt.TextElideMode.ElideRight)
        tabs.addTab(self._eyes_tab(), tr("Eyes"))
        tabs.addTab(self._plots_tab(), tr("Plots"))
        tabs.setTabToolTip(1, tr("Error against distance, and convergence of each registration"))
        tabs.addTab(self.residuals, tr("Residuals"))
        self._alone = self._alignments_tab()
        tabs.addTab(self._alone, tr("Alignments"))
        tabs.setTabToolTip(3, tr("φ of each alignment alone"))
        tabs.addTab(self.comparison, tr("Other method"))
        self._stack = QStackedLayout(self)
        self._stack.addWidget(empty)
        self._stack.addWidget(tabs)

    def _eyes_tab(self) -> QWidget:
        tab = QWidget()
        vbox(
            self._card, (self._numbers, 1), on=tab, margins=SPACING_PX // 2, spacing=SPACING_PX // 2
        )
        return tab

    def _plots_tab(self) -> QWidget:
        tab, iterations, stack = QWidget(), QWidget(), QStackedWidget()
        meaning = paragraph(
            "",
            tr("Each line ends in the number of its alignment; one that ends level has converged."),
        )
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


class _DistanceTab(QWidget):
    """Shows each eye's error against distance, without the calibration and with it."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.plot = Plot(
            "error-by-distance",
            tr("Error against distance"),
            tr("Distance (m)"),
            tr("Expected error (′)"),
        )
        self.plot.show_legend()
        ticks = [(float(np.log10(one)), f"{one:g}") for one in DISTANCES_M if one not in (0.4, 0.6)]
        self.plot.item.getAxis("bottom").setTicks([ticks])
        self.table = Table("error-by-distance-table", tr("Error against distance"))
        meaning = paragraph("", _DISTANCES)
        meaning.setContentsMargins(SPACING_PX, 0, SPACING_PX, SPACING_PX // 2)
        vbox((self.plot, 1), (self.table, 1), meaning, on=self, margins=0, spacing=0)

    def show_results(self, results: Results) -> None:
        """Replace the lines and the table."""
        self.plot.clear()
        x = np.log10(DISTANCES_M)
        columns: dict[str, tuple[str, ...]] = {}
        for eye, benefit in results.benefits.items():
            names = tr("{}, without").format(EYE_NAMES[eye]), tr("{}, with").format(EYE_NAMES[eye])
            texts = zip(*(one.texts for one in benefit.by_distance), strict=True)
            columns |= dict(zip(names, texts, strict=True))
            for which in ("without", "after"):
                error, low, high = (
                    [getattr(one, f"{which}{end}_arcmin") for one in benefit.by_distance]
                    for end in ("", "_low", "_high")
                )
                line = self.plot.add_line(
                    eye, name=EYE_NAMES[eye], dashed=which == "without", symbol=_SYMBOLS[eye]
                )
                line.setData(x + _BESIDE[eye], error)
                ends = np.column_stack([low, high, np.full(len(x), np.nan)])
                self.plot.add_line(eye).setData(np.repeat(x + _BESIDE[eye], 3), ends.ravel())
        rows = zip(*columns.values(), strict=True)
        self.table.show_rows(
            list(columns),
            [Row(f"{one:g} m", cells) for one, cells in zip(DISTANCES_M, rows, strict=True)],
        )


class _ConvergencePlot(Plot):
    """Shows the distance between hand and cursor by iteration, for each alignment and eye."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("convergence", tr("Convergence"), tr("Iteration"), _TO_POINTS, parent)
        self.show_legend()

    def show_results(self, results: Results) -> None:
        """Replace the lines; each ends in its alignment's number."""
        self.clear()
        for number, shifts in results.alignments.items():
            for eye, shift in shifts.items():
                rms_mm = 1e3 * np.sqrt(shift.history_m2)
                line = self.add_line(
                    eye,
                    name=EYE_NAMES[eye],
                    dashed=eye == "right",
                    symbol=_SYMBOLS[eye] if len(rms_mm) <= _MAX_SYMBOLS else None,
                )
                line.setData(np.arange(1, len(rms_mm) + 1), rms_mm)
                self.add_text(str(number), len(rms_mm), float(rms_mm[-1]))
        solved = [shift for eyes in results.alignments.values() for shift in eyes.values()]
        measure = _TO_SURFACE if any(map(_is_to_surface, solved)) else _TO_POINTS
        self.item.setLabel("left", measure)
        self.setToolTip(_MEANINGS[measure])
        histories = [shift.history_m2 for shift in solved]
        longest = max(map(len, histories), default=1)
        largest_mm = 1e3 * max((float(np.sqrt(max(one))) for one in histories), default=1e-3)
        self.item.setXRange(1, 1 + 1.1 * max(longest - 1, 1))  # with room for the last number
        self.item.setYRange(0.0, 1.1 * largest_mm)
        spacing = max(1, longest // 5)
        self.item.getAxis("bottom").setTickSpacing(spacing, spacing)


def _is_to_surface(shift: EyeShift) -> bool:
    """Return whether an alignment's history was measured along normals, unlike its RMS."""
    is_rms = np.isclose(shift.history_m2[-1], shift.rms_m**2, rtol=1e-6, atol=0.0)
    return shift.method == "consistent" and not is_rms


class _CompareTab(QWidget):
    """Solves the same alignments with another method, and shows both results.

    Attributes
    ----------
    table : Table
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("comparison")
        self._results: Results | None = None
        self._record: SessionRecord | None = None
        self._settings = SolveSettings()
        self.table = Table("comparison-of-methods", tr("Comparison of methods"))
        keep_space(self.table)
        self._methods = QComboBox()
        self._methods.setObjectName("comparison-method")
        self._methods.setAccessibleName(tr("Compare with method"))
        self._methods.currentTextChanged.connect(self._explain)
        self._compare = QPushButton(tr("&Compare"))
        self._compare.setObjectName("comparison-start")
        self._compare.clicked.connect(self._ask)
        self._jobs = JobBar(tr("Ca&ncel"))
        self._jobs.failed.connect(self.show_failure)
        self._jobs.busy_changed.connect(self._on_busy)
        self._status = QLabel()
        self._status.setObjectName("comparison-status")
        self._status.setTextFormat(Qt.TextFormat.PlainText)
        self._status.setWordWrap(True)
        label = QLabel(tr("Compare &with"))
        label.setBuddy(self._methods)
        row = hbox(label, (self._methods, 1), self._compare, spacing=SPACING_PX)
        parts = row, self._jobs, self._status, (self.table, 1)
        vbox(*parts, on=self, margins=SPACING_PX // 2, spacing=SPACING_PX)

    def use(self, record: SessionRecord, settings: SolveSettings) -> None:
        """Set the session to compare with."""
        self._record, self._settings = record, settings

    def cancel(self) -> None:
        """Cancel the comparison, and wait for its end; nothing is shown."""
        self._jobs.stop()

    def show_results(self, results: Results) -> None:
        """Set the results to compare with; an earlier comparison is removed."""
        self.cancel()
        self._results = results
        self._methods.clear()
        for method in METHODS:
            if method != results.method:
                self._methods.addItem(method)
        self.table.show_rows((), ())
        self.table.hide()

    def show_comparison(self, other: Results) -> None:
        """Show another method's results of the same alignments."""
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

    def show_failure(self, text: str) -> None:
        """Show the reason why there is no comparison."""
        self._status.setText(text)

    def _explain(self, method: Method | Literal[""]) -> None:
        text = tr("{}: {} Compare shows it beside the present results.")
        self._status.setText(text.format(method, _METHODS[method]) if method else "")

    def _ask(self) -> None:
        method: Method = self._methods.currentText()  # type: ignore[assignment]
        record, settings = self._record, replace(self._settings, method=method)

        def work(progress: Progress) -> object:
            assert record is not None
            return solve_again(record, settings, progress)

        self._jobs.run(tr("Solving with {}").format(method), work, self.show_comparison)

    def _on_busy(self, is_busy: bool) -> None:
        self._methods.setEnabled(not is_busy)
        self._compare.setEnabled(not is_busy)


class ResidualMap(Plot):
    """Shows residuals in colour; points without a partner are crosses.

    Attributes
    ----------
    scatters : tuple of 2 pyqtgraph.ScatterPlotItem
        Inliers and outliers, mm.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            "residual-map", tr("Residual map"), tr("Right (mm)"), tr("Down (mm)"), parent
        )
        self._shown = np.empty((0, 2)), np.empty(0)
        self._reach_m = 1.0
        self.scatters = (
            pg.ScatterPlotItem(size=4, pen=None),
            pg.ScatterPlotItem(size=5, symbol="x"),
        )
        self._bar = pg.ColorBarItem(width=14, interactive=False, label=tr("Residual (mm)"))
        item = self.item
        item.setAspectLocked()
        item.invertY()
        for scatter in reversed(self.scatters):
            item.addItem(scatter)
        item.layout.addItem(self._bar, 2, 5)
        follow_theme(self, self._redraw)

    def show_residuals(self, places_m: Float64, residuals_m: Float64, reach_m: float) -> None:
        """Show points.

        Parameters
        ----------
        places_m : (N, 2) float64
            Right and down, as seen from the eye.
        residuals_m : (N,) float64
            NaN for points without a partner.
        reach_m : float
            End of the colour scale.
        """
        self._shown, self._reach_m = (places_m, residuals_m), reach_m
        self._redraw()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Draw the points as large as the map has room for."""
        super().resizeEvent(event)
        least_px = min(self.width(), self.height()) // _POINTS_ACROSS
        for scatter, smallest_px in zip(self.scatters, (4, 5), strict=True):
            scatter.setSize(max(smallest_px, least_px))

    def _redraw(self) -> None:
        places_m, residuals_m = self._shown
        is_outlier = np.isnan(residuals_m)
        palette = pg.ColorMap(None, residual_ramp())
        self._bar.setColorMap(palette)
        for side in ("left", "right"):
            self._bar.getAxis(side).setTextPen(self.palette().windowText().color())
        self._bar.setLevels((0.0, 1e3 * self._reach_m))
        shades = [pg.mkBrush(c) for c in palette.getLookupTable(0.0, 1.0, _SHADES)]
        shade = (_SHADES / self._reach_m * residuals_m[~is_outlier]).astype(int)
        inliers, outliers = self.scatters
        inliers.setData(
            pos=1e3 * places_m[~is_outlier], brush=[shades[min(i, _SHADES - 1)] for i in shade]
        )
        outliers.setData(pos=1e3 * places_m[is_outlier], pen=colors().muted)


class ResidualsTab(QWidget):
    """Shows the residual map of one alignment and eye; drawn only while visible.

    Attributes
    ----------
    shown : Signal(int, str)
        The number of the alignment and the eye whose map is shown.
    """

    shown = Signal(int, str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("residuals")
        self._solved: dict[int, tuple[Alignment, Mapping[Eye, EyeShift]]] = {}
        self._reach_m = 1.0
        self._choice = QComboBox()
        self._choice.setObjectName("residuals-choice")
        self._choice.setAccessibleName(tr("Alignment and eye"))
        self._choice.currentIndexChanged.connect(self._show_chosen)
        self._map = ResidualMap()
        note = QLabel(
            tr("The hand as seen from the eye; a grey × is a point without a partner (outlier).")
        )
        note.setWordWrap(True)
        vbox(self._choice, (self._map, 1), note, on=self, spacing=SPACING_PX)

    def show_results(self, results: Results, alignments: Mapping[int, Alignment]) -> None:
        """Show the first alignment's map, and offer all alignments with available clouds."""
        self._solved = {
            number: (alignments[number], shifts)
            for number, shifts in results.alignments.items()
            if number in alignments
        }
        self._reach_m = residuals_reach_m(results) if self._solved else 1.0
        self._choice.clear()
        for number, (_, shifts) in self._solved.items():
            for eye in shifts:
                name = tr("Alignment {}, {}").format(number, EYE_NAMES[eye].lower())
                self._choice.addItem(name, (number, eye))

    def showEvent(self, event: QShowEvent) -> None:
        """Draw the map chosen while the tab was hidden."""
        super().showEvent(event)
        self._show_chosen()

    def _show_chosen(self) -> None:
        if not self.isVisible():
            return
        chosen = self._choice.currentData()
        if chosen is None:
            self._map.show_residuals(np.empty((0, 2)), np.empty(0), self._reach_m)
            return
        number, eye = chosen
        alignment, shifts = self._solved[number]
        hand_E_m = transform(alignment.T_E_W[eye], alignment.hand_m)
        self._map.show_residuals(hand_E_m[:, :2], shifts[eye].residuals_m, self._reach_m)
        self.shown.emit(number, eye)
