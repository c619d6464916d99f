from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pyqtgraph as pg
import pytest
from handcal_gui.calibrate.results.compare_tab import CompareTab
from handcal_gui.calibrate.results.convergence_plot import ConvergencePlot
from handcal_gui.calibrate.results.residual_map import ResidualMap
from handcal_gui.calibrate.results.verdict_card import VerdictCard
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QLabel, QPushButton, QTabWidget
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.core.geometry import transform
from handcal.core.types import EYES, Alignment, Rig, Verdict, VerdictName
from handcal.register.benefit import DISTANCES_M
from handcal.register.results import Results, SolveSettings, solve_session
from handcal.session.trial import make_trial
from handcal.station.snapshot import Snapshot
from handcal_gui.app.theme import colors
from handcal_gui.calibrate.results.panel import ResultsPanel
from handcal_gui.widgets.plots import Plot
from handcal_gui.widgets.result_rows import REGISTRATION
from handcal_gui.widgets.table import Table
from tests.gui.helpers import child, show
from tests.gui.views import with_target

Make = Callable[..., Snapshot]


def numbered(alignments: Sequence[Alignment]) -> dict[int, Alignment]:
    return dict(enumerate(alignments, 1))


@pytest.fixture
def panel(qtbot: QtBot) -> ResultsPanel:
    return show(qtbot, ResultsPanel(), 420, 440)


@pytest.fixture
def solved(
    panel: ResultsPanel, results: Results, alignments: Sequence[Alignment], rig: Rig
) -> ResultsPanel:
    panel.show_results(results, numbered(alignments))
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


def test_trials_stand_among_the_numbers_as_soon_as_they_are_recorded(
    panel: ResultsPanel, snapshot: Make, rig: Rig
) -> None:
    seen = snapshot(State.APPLIED)
    results = seen.procedure.results
    assert results is not None
    accepted = replace(results, verdicts=dict.fromkeys(EYES, Verdict("accept", "as told")))
    procedure = replace(seen.procedure, results=accepted)
    seen = replace(seen, procedure=procedure, settings=with_target(7.5))
    panel.resize(360, 416)
    both = {
        number: make_trial(rig.eyes[eye], eye, 0.4, accepted.eyes[eye].shift_m, [0.05, 0.0, 0.0])
        for number, eye in enumerate(EYES)
    }
    for trials, told in (({}, False), (both, True), ({}, False)):
        record = replace(seen.record, trials=trials)
        panel.show_snapshot(replace(seen, record=record))
        table = child(panel, Table, "numbers-of-both-eyes")
        assert table.horizontalScrollBar().maximum() == 0
        rows = child(panel, Table, "numbers-of-both-eyes").as_text()
        assert ("Trials\t⚠ " in rows) == told
        for card in panel.findChildren(VerdictCard):
            labels = card.findChildren(QLabel)
            words = [label.text() for label in labels]
            shade = labels[1].palette().windowText().color()
            assert shade == QColor(colors().warning if told else colors().good)
            assert ("⚠ Trials over 7.5′" in words) == told
            assert ("✓ Accept" in words) != told
        assert ("Trials over 7.5′" in panel.as_text()) == told


def test_without_alignments_no_tab_is_of_them(
    panel: ResultsPanel, results: Results, rig: Rig
) -> None:
    panel.show_results(replace(results, alignments={}), {})
    tabs = child(panel, QTabWidget)
    seen = [tabs.tabText(i) for i in range(tabs.count()) if tabs.isTabVisible(i)]
    assert seen == ["Eyes", "Plots", "Compare"]


def test_a_low_panel_has_room_for_all_numbers(qtbot: QtBot, solved: ResultsPanel) -> None:
    table = child(solved, Table, "numbers-of-both-eyes")
    cards = solved.findChildren(VerdictCard)
    solved.resize(375, table.whole_height_px)  # too low for the reasons
    QApplication.processEvents()
    other_px = solved.height() - table.height()

    def has_reasons() -> bool:
        shown = [one.text() for one in solved.findChildren(QLabel) if one.isVisible()]
        [found] = {card.toolTip() in shown for card in cards}
        return found

    before = has_reasons()
    for room_px, expected in ((280, True), (3, False), (280, True)):
        solved.resize(375, table.whole_height_px + other_px + room_px)
        assert has_reasons() == before, "nothing is hidden within the resize event"
        qtbot.waitUntil(lambda: table.verticalScrollBar().maximum() == 0)
        QApplication.processEvents()
        assert has_reasons() == expected
        before = expected


def test_the_numbers_are_the_results(solved: ResultsPanel, results: Results) -> None:
    table = child(solved, Table, "numbers-of-both-eyes")
    assert table.as_text().splitlines()[1].startswith("φ1 (mm)\t")
    for column, eye in enumerate(EYES):
        shown_mm = float(cell(table, 0, 1 + column).split("±")[0].replace("−", "-"))
        assert shown_mm == pytest.approx(1e3 * results.eyes[eye].shift_m[0], abs=0.005)


@pytest.mark.parametrize(
    ("name", "word"),
    [
        ("accept", "✓ Accept"),
        ("repeat", "↻ Repeat"),
        ("keep", "↩ Keep offline"),
        ("implausible", "✕ Implausible"),
        ("contradicted", "✕ Contradicted"),
    ],
)
def test_a_verdict_is_a_sign_a_word_and_a_reason(
    qtbot: QtBot, results: Results, name: VerdictName, word: str
) -> None:
    card = VerdictCard("left")
    qtbot.addWidget(card)
    height = card.sizeHint().height()
    given = replace(results, verdicts={"left": Verdict(name, "because of this")}, advice={})
    card.show_verdict(given)
    texts = [label.text() for label in card.findChildren(QLabel)]
    assert texts == ["Left eye", word, "Because of this"]
    assert card.sizeHint().height() == height


def test_an_eye_without_part_is_not_judged(
    panel: ResultsPanel, alignments: Sequence[Alignment], rig: Rig
) -> None:
    one = replace(alignments[0], eyes=("right",))
    panel.show_results(solve_session({3: one}, rig, SolveSettings()), {3: one})
    card = child(panel, VerdictCard, "verdict-left")
    texts = [label.text() for label in card.findChildren(QLabel)]
    assert "– Not solved" in texts
    choices = child(panel, QComboBox, "residuals-choice")
    assert [choices.itemText(i) for i in range(choices.count())] == ["Alignment 3, right eye"]


def test_convergence_has_a_line_for_each_alignment_and_eye(
    solved: ResultsPanel, results: Results
) -> None:
    lines = child(solved, ConvergencePlot).item.listDataItems()
    assert len(lines) == 4
    iterations, rms_mm = lines[2].getData()
    history_m2 = results.alignments[2]["left"].history_m2
    np.testing.assert_array_equal(iterations, np.arange(1, len(history_m2) + 1))
    np.testing.assert_allclose((rms_mm / 1e3) ** 2, history_m2)


def test_the_measures_of_fit_have_different_names(solved: ResultsPanel, results: Results) -> None:
    plot = child(solved, ConvergencePlot)
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


def test_lines_that_end_together_share_one_name(solved: ResultsPanel, results: Results) -> None:
    plot = child(solved, ConvergencePlot)

    def names() -> set[str]:
        return {one.toPlainText() for one in plot.item.items if isinstance(one, pg.TextItem)}

    assert names() == {"Alignments 1, 2"}  # 6 % apart
    eyes = results.alignments[1]
    plot.show_results(replace(results, alignments={1: eyes, 2: eyes, 5: eyes}))
    assert names() == {"Alignments 1, 2, 5"}
    plot.show_results(replace(results, alignments={2: eyes, 3: eyes, 4: eyes}))
    assert names() == {"Alignments 2–4"}
    exact = replace(eyes["left"], history_m2=np.zeros(2))
    plot.show_results(replace(results, alignments={1: {"left": exact}, 3: {"left": exact}}))
    assert names() == {"Alignments 1, 3"}
    apart = replace(eyes["left"], history_m2=np.array([4e-6, 1e-6]))
    plot.show_results(replace(results, alignments={1: {"left": exact}, 2: {"left": apart}}))
    assert names() == {"Alignment 1", "Alignment 2"}


@pytest.mark.parametrize("width_px", [360, 900])
def test_the_names_of_lines_fit_into_the_plot(solved: ResultsPanel, width_px: int) -> None:
    solved.resize(width_px, 320)
    child(solved, QTabWidget).setCurrentIndex(1)
    child(solved, QComboBox, "plots-choice").setCurrentIndex(1)
    QApplication.processEvents()
    item = child(solved, ConvergencePlot).item
    frame = item.vb.mapRectToScene(item.vb.boundingRect())
    texts = [one for one in item.items if isinstance(one, pg.TextItem)]
    assert texts
    assert all(frame.contains(one.mapRectToScene(one.boundingRect())) for one in texts)


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


def test_an_alignment_whose_cloud_is_missing_has_no_map(
    panel: ResultsPanel, results: Results, alignments: Sequence[Alignment], rig: Rig
) -> None:
    panel.show_results(results, numbered(alignments[:1]))
    child(panel, QTabWidget).setCurrentIndex(2)
    assert child(panel, QComboBox, "residuals-choice").count() == 2
    assert len(child(panel, ResidualMap).scatters[0].getData()[0])
    panel.show_results(results, {})
    assert child(panel, QComboBox, "residuals-choice").count() == 0
    assert not len(child(panel, ResidualMap).scatters[0].getData()[0])


def test_an_alignment_added_since_is_not_among_the_results(
    panel: ResultsPanel, results: Results, alignments: Sequence[Alignment], rig: Rig
) -> None:
    panel.show_results(results, numbered([*alignments, alignments[0]]))
    table = child(panel, Table, "each-alignment-alone")
    labels = [line.split("\t")[0] for line in table.as_text().splitlines()[1:]]
    assert labels == ["1 left", "1 right", "2 left", "2 right"]
    assert child(panel, QComboBox, "residuals-choice").count() == 4


def test_a_comparison_is_asked_for_and_shown(
    solved: ResultsPanel, results: Results, other: Results, qtbot: QtBot
) -> None:
    methods = child(solved, QComboBox, "comparison-method")
    offered = [methods.itemText(i) for i in range(methods.count())]
    assert offered == ["paper", "linear", "icp", "icp-open3d"]
    methods.setCurrentText("icp")
    assert status(solved).startswith("icp: rigid")
    with qtbot.waitSignal(solved.compare_requested) as asked:
        button(solved, "start").click()
    assert asked.args == ["icp"]
    assert not button(solved, "start").isEnabled()
    assert button(solved, "cancel").isEnabled()
    solved.show_comparison(other)
    assert button(solved, "start").isEnabled()
    table = child(solved, CompareTab).table
    assert table.as_text().startswith("\tconsistent\ticp\tΔ\n")
    apart_mm = 1e3 * (other.eyes["left"].shift_m - results.eyes["left"].shift_m)[0]
    shown_mm = float(cell(table, 1, 3).replace("−", "-"))
    assert shown_mm == pytest.approx(apart_mm, abs=0.005)


def test_a_comparison_can_be_cancelled_and_can_fail(solved: ResultsPanel, qtbot: QtBot) -> None:
    button(solved, "start").click()
    with qtbot.waitSignal(solved.compare_cancelled):
        button(solved, "cancel").click()
    assert button(solved, "start").isEnabled()
    assert status(solved) == "Cancelled."
    button(solved, "start").click()
    solved.comparison_failed("the disk is full")
    assert button(solved, "start").isEnabled()
    assert status(solved) == "the disk is full"


def test_other_results_cancel_a_comparison_under_way(
    solved: ResultsPanel, results: Results, rig: Rig, qtbot: QtBot
) -> None:
    button(solved, "start").click()
    with qtbot.waitSignal(solved.compare_cancelled):
        solved.show_results(replace(results), {})
    assert button(solved, "start").isEnabled()


def test_only_other_results_end_a_comparison(
    panel: ResultsPanel, snapshot: Make, other: Results, results: Results
) -> None:
    table = child(panel, CompareTab).table
    panel.show_snapshot(snapshot(State.SOLVED))
    panel.show_comparison(other)
    panel.show_snapshot(snapshot(State.SOLVED, number=2))
    assert table.keys
    panel.show_snapshot(snapshot(State.SOLVED, procedure={"results": replace(results)}))
    assert not table.keys


def test_everything_is_copied_as_text(
    solved: ResultsPanel, results: Results, other: Results, qtbot: QtBot
) -> None:
    solved.show_comparison(other)
    solved.activateWindow()
    table = child(solved, Table, "numbers-of-both-eyes")
    table.setFocus()
    qtbot.waitUntil(table.hasFocus)
    QTest.keyClick(table, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    text = QGuiApplication.clipboard().text()
    assert results.verdicts["left"].reason[1:] in text
    assert "\nφ1 (mm)\t" in text
    assert "\n2 right\t" in text
    assert "\tconsistent\ticp\tΔ\n" in text


def test_it_fits_a_small_dock(solved: ResultsPanel) -> None:
    smallest = solved.minimumSizeHint()
    assert smallest.width() <= 300
    assert smallest.height() <= 260


def test_the_points_of_a_large_residual_map_are_large(qtbot: QtBot) -> None:
    shown = show(qtbot, ResidualMap(), 300, 300)
    inliers, _ = shown.scatters
    assert inliers.opts["size"] == 4
    shown.resize(1300, 1300)
    assert inliers.opts["size"] == 10
