from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QLabel, QPushButton, QTabWidget
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.core.geometry import transform
from handcal.core.types import EYES, Alignment, Rig
from handcal.register.benefit import DISTANCES_M
from handcal.register.results import Results, SolveSettings, solve_session
from handcal.session.record import SessionRecord
from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.results.panel import (
    ResidualMap,
    ResultsPanel,
    _CompareTab,
    _ConvergencePlot,
)
from handcal_gui.widgets.plots import Plot
from handcal_gui.widgets.result_rows import REGISTRATION
from handcal_gui.widgets.table import Table
from tests.gui.helpers import child, show, text

Make = Callable[..., Snapshot]


@pytest.fixture
def held(record: SessionRecord, alignments: Sequence[Alignment]) -> SessionRecord:
    """Return a session with the alignments of the results."""
    return replace(record, alignments=dict(enumerate(alignments, 1)))


@pytest.fixture
def panel(qtbot: QtBot) -> ResultsPanel:
    return show(qtbot, ResultsPanel(), 420, 440)


@pytest.fixture
def solved(panel: ResultsPanel, results: Results, held: SessionRecord) -> ResultsPanel:
    panel.show_results(results, held, 8.0)
    return panel


@pytest.fixture(scope="module")
def other(alignments: Sequence[Alignment], rig: Rig) -> Results:
    return solve_session(alignments, rig, SolveSettings("icp"))


def button(panel: ResultsPanel, name: str) -> QPushButton:
    return child(panel, QPushButton, f"comparison-{name}")


def cell(table: Table, row: int, column: int) -> str:
    return str(table.model().index(row, column).data())


def status(panel: ResultsPanel) -> str:
    return child(panel, QLabel, "comparison-status").text()


def test_without_results_it_says_how_to_get_them(panel: ResultsPanel, snapshot: Make) -> None:
    panel.show_snapshot(snapshot(State.ALIGN))
    assert not child(panel, QTabWidget).isVisible()
    [empty] = [one for one in panel.findChildren(QLabel) if "Nothing is solved yet" in one.text()]
    assert empty.text().endswith("once it is solved or verified.")
    panel.show_snapshot(snapshot(State.SOLVED))
    assert child(panel, QTabWidget).isVisible()
    child(panel, QTabWidget).setCurrentIndex(2)
    panel.show_snapshot(snapshot(State.SHOW_HAND))
    assert not child(panel, QTabWidget).isVisible()
    assert panel.as_text() == ""
    panel.show_snapshot(snapshot(State.SOLVED))
    assert child(panel, QTabWidget).currentIndex() == 0  # not what the last wearer's ended with


def test_without_alignments_no_tab_is_of_them(
    panel: ResultsPanel, results: Results, held: SessionRecord
) -> None:
    panel.show_results(replace(results, alignments={}), replace(held, alignments={}), 8.0)
    tabs = child(panel, QTabWidget)
    seen = [tabs.tabText(i) for i in range(tabs.count()) if tabs.isTabVisible(i)]
    assert seen == ["Eyes", "Plots", "Other method"]


def test_the_numbers_are_the_results(solved: ResultsPanel, results: Results) -> None:
    table = child(solved, Table, "numbers-of-both-eyes")
    assert table.as_text().splitlines()[1].startswith("φ1 (mm)\t")
    for column, eye in enumerate(EYES):
        shown_mm = float(cell(table, 0, 1 + column).split("±")[0].replace("−", "-"))
        assert shown_mm == pytest.approx(1e3 * results.eyes[eye].shift_m[0], abs=0.005)


def test_an_eye_without_part_is_not_judged(
    panel: ResultsPanel, alignments: Sequence[Alignment], held: SessionRecord, rig: Rig
) -> None:
    one = {3: replace(alignments[0], eyes=("right",))}
    results = solve_session(one, rig, SolveSettings())
    panel.show_results(results, replace(held, alignments=one), 8.0)
    assert "– Not solved" in text(panel, "card-verdict-left")
    choices = child(panel, QComboBox, "residuals-choice")
    assert [choices.itemText(i) for i in range(choices.count())] == ["Alignment 3, right eye"]


def test_convergence_has_a_line_for_each_alignment_and_eye(
    solved: ResultsPanel, results: Results
) -> None:
    lines = child(solved, _ConvergencePlot).item.listDataItems()
    assert len(lines) == 4
    iterations, rms_mm = lines[2].getData()
    history_m2 = results.alignments[2]["left"].history_m2
    np.testing.assert_array_equal(iterations, np.arange(1, len(history_m2) + 1))
    np.testing.assert_allclose((rms_mm / 1e3) ** 2, history_m2)


def test_the_measures_of_fit_have_different_names(solved: ResultsPanel, results: Results) -> None:
    plot = child(solved, _ConvergencePlot)
    assert plot.item.getAxis("left").labelText == "Surface RMS (mm)"
    assert "Point RMS (mm)" in [quantity.name for quantity in REGISTRATION]
    shift = results.alignments[1]["left"]
    full = replace(shift, method="paper"), replace(shift, history_m2=np.array([shift.rms_m**2]))
    for one in full:
        plot.show_results(replace(results, alignments={1: {"left": one}}))
        assert plot.item.getAxis("left").labelText == "Point RMS (mm)"


def test_the_error_against_distance_is_the_benefit(solved: ResultsPanel, results: Results) -> None:
    table = child(solved, Table, "error-by-distance-table")
    assert len(table.keys) == len(DISTANCES_M)
    lines = child(solved, Plot, "error-by-distance").item.listDataItems()
    for place, eye in enumerate(EYES):
        for number, one in enumerate(results.benefits[eye].by_distance):
            shown = tuple(cell(table, number, 2 * place + column) for column in (1, 2))
            assert shown == one.texts
        after = lines[4 * place + 2].getData()[1]
        assert list(after) == [one.after_arcmin for one in results.benefits[eye].by_distance]
    assert results.benefits["left"].by_distance[2].texts[1] in solved.as_text()


def test_the_map_shows_each_point_of_the_chosen_hand_once(
    solved: ResultsPanel, results: Results, alignments: Sequence[Alignment]
) -> None:
    child(solved, QTabWidget).setCurrentIndex(2)
    choices = child(solved, QComboBox, "residuals-choice")
    choices.setCurrentText("Alignment 2, left eye")
    inliers, outliers = (
        np.column_stack(scatter.getData()) for scatter in child(solved, ResidualMap).scatters
    )
    is_outlier = np.isnan(results.alignments[2]["left"].residuals_m)
    places_mm = 1e3 * transform(alignments[1].T_E_W["left"], alignments[1].hand_m)[:, :2]
    np.testing.assert_allclose(inliers, places_mm[~is_outlier])
    np.testing.assert_allclose(outliers, places_mm[is_outlier])
    assert 0 < len(outliers) < len(inliers)


def test_alignments_and_maps_are_those_of_the_results_whose_clouds_are_there(
    panel: ResultsPanel, results: Results, alignments: Sequence[Alignment], held: SessionRecord
) -> None:
    for clouds, maps in ((alignments[:1], 2), ((), 0), ([*alignments, alignments[0]], 4)):
        record = replace(held, alignments=dict(enumerate(clouds, 1)))
        panel.show_results(results, record, 8.0)
        child(panel, QTabWidget).setCurrentIndex(2)
        assert child(panel, QComboBox, "residuals-choice").count() == maps
        assert bool(len(child(panel, ResidualMap).scatters[0].getData()[0])) == bool(maps)
        table = child(panel, Table, "each-alignment-alone")
        labels = [line.split("\t")[0] for line in table.as_text().splitlines()[1:]]
        assert labels == ["1 left", "1 right", "2 left", "2 right"]


def test_another_method_is_solved_beside_the_present_one(
    solved: ResultsPanel, results: Results, held: SessionRecord, qtbot: QtBot
) -> None:
    tab = solved.comparison
    tab.use(held, SolveSettings())
    methods = child(solved, QComboBox, "comparison-method")
    methods.setCurrentText("linear")
    button(solved, "start").click()
    assert not button(solved, "start").isEnabled()
    qtbot.waitUntil(button(solved, "start").isEnabled, timeout=20_000)
    table = child(solved, _CompareTab).table
    assert table.as_text().startswith("\tconsistent\tlinear\tΔ\n")
    solved.show_results(replace(results), held, 8.0)
    assert not table.keys, "of the former results"


def test_another_method_can_be_cancelled_and_can_fail(
    solved: ResultsPanel, results: Results, held: SessionRecord, qtbot: QtBot
) -> None:
    solved.comparison.use(held, SolveSettings())
    button(solved, "start").click()
    child(solved, QPushButton, "cancel").click()
    qtbot.waitUntil(button(solved, "start").isEnabled, timeout=20_000)
    assert not solved.comparison.table.keys
    button(solved, "start").click()
    solved.show_results(replace(results), held, 8.0)  # other results cancel it, too
    assert button(solved, "start").isEnabled()
    solved.comparison.show_failure("the disk is full")
    assert status(solved) == "the disk is full"
    solved.comparison.cancel()


def test_everything_is_copied_as_text(
    solved: ResultsPanel, results: Results, other: Results, qtbot: QtBot
) -> None:
    solved.comparison.show_comparison(other)
    solved.activateWindow()
    table = child(solved, Table, "numbers-of-both-eyes")
    table.setFocus()
    qtbot.waitUntil(table.hasFocus)
    QTest.keyClick(table, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    copied = QGuiApplication.clipboard().text()
    assert results.verdicts["left"].reason in copied
    assert "\nφ1 (mm)\t" in copied
    assert "\n2 right\t" in copied
    assert "\tconsistent\ticp\tΔ\n" in copied
