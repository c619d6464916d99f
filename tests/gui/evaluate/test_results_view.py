"""The results of an evaluation."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QDialog, QPushButton
from pytestqt.qtbot import QtBot

from handcal.report.document import Column, Figure, Report, Section
from handcal.report.document import Table as ReportTable
from handcal_gui.evaluate.results_view import ResultsView
from handcal_gui.evaluate.work import Outcome
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.table import Table
from tests.gui.helpers import child, show, text


def titles_of(view: ResultsView) -> list[str]:
    choice = child(view, QComboBox, "figures")
    return [choice.itemText(place) for place in range(choice.count())]


@pytest.mark.parametrize(
    ("names", "titles"),
    [
        (("Offline", "Solved"), ["Offline", "Solved"]),
        (("", "In space"), ["Numbers 1", "In space"]),
        (("Offline",), ["Numbers"]),
    ],
)
def test_a_tab_says_what_its_numbers_are_of(
    qtbot: QtBot, names: tuple[str, ...], titles: list[str]
) -> None:
    tables = [ReportTable([Column("a"), Column("b")], [("1", "2")], name=one) for one in names]
    view = show(qtbot, ResultsView(), 500, 400)
    view.show_outcome(Outcome(Path(), Report("", "", "", [Section("", tables)]), []))
    assert titles_of(view) == titles


def test_the_numbers_of_a_user_test_fit_beside_the_list_of_a_small_screen(qtbot: QtBot) -> None:
    titles = ["wearer", "calibrations", "corners", "mean ± SD, px", "mean ± SD, arcmin"]
    titles += ["95 % interval, arcmin", "median (quartiles), arcmin", "min–max, arcmin"]
    numbers = ("10", "120", "8.12 ± 4.33", "10.79 ± 3.21", "6.33 to 14.12", "9.83 (7.12–12.45)")
    table = ReportTable([Column(title) for title in titles], [("wearer-1", *numbers, "2.13–23.44")])
    view = show(qtbot, ResultsView(), 719, 300)  # in a window of 960 x 540
    view.show_outcome(Outcome(Path(), Report("", "", "", [Section("", [table])]), []))
    shown = child(view, Table)
    assert not shown.horizontalScrollBar().isVisible()
    hidden = [title.replace("\n", ", ") for title in shown.hidden]
    assert hidden == titles[-len(hidden) :], "the last ones"
    tooltip = shown.model().index(0, 0).data(Qt.ItemDataRole.ToolTipRole)
    assert "min–max arcmin: 2.13–23.44" in tooltip
    assert f"no room for: {'; '.join(hidden)}. View large" in text(view, "caption")
    child(view, QPushButton, "enlarge").click()
    large = child(view, QDialog, "large")
    large.resize(960, 540)
    QApplication.processEvents()
    assert not child(large, Table).hidden
    assert text(large, "caption") == ""


def test_a_figure_is_a_sheet_of_paper_that_says_which_file_it_is(qtbot: QtBot) -> None:
    figure = Figure("some-squares", "Grows.", lambda _: None, [])
    view = show(qtbot, ResultsView(), 500, 400)
    report = Report("", "", "", [Section("", [figure])])
    view.show_outcome(Outcome(Path(), report, [np.full((20, 90, 3), 255, np.uint8)]))
    assert "Grows. " in text(view, "caption")
    assert "figures/some-squares.png" in text(view, "caption")
    sheet = child(view, ImageView)
    qtbot.waitExposed(sheet)
    shown = sheet.grab().toImage()
    assert shown.pixelColor(shown.rect().center()) == Qt.GlobalColor.white
    assert shown.pixelColor(2, 2) == sheet.palette().window().color() != Qt.GlobalColor.white


def test_tabs_of_figures_are_numbered_only_where_there_are_several(qtbot: QtBot) -> None:
    view = show(qtbot, ResultsView(), 500, 400)
    figures = [Figure(name, "", lambda _: None, []) for name in ("wearers-1", "of-1", "of-2")]
    report = Report("", "", "", [Section("", ["icp: rigid.", *figures])])
    view.show_outcome(Outcome(Path(), report, 3 * [np.zeros((9, 9, 3), np.uint8)]))
    assert titles_of(view) == ["Terms and methods", "Wearers", "Of 1", "Of 2"]
    assert text(view, "terms") == "icp: rigid."


def test_a_figure_fills_the_screen_by_click_and_by_key_and_goes_back(qtbot: QtBot) -> None:
    view = show(qtbot, ResultsView(), 740, 240)
    figures = [Figure(name, "", lambda _: None, []) for name in ("first", "second")]
    report = Report("", "", "", [Section("", figures)])
    pictures = [np.full((40, 90, 3), grey, np.uint8) for grey in (100, 200)]
    view.show_outcome(Outcome(Path(), report, pictures))
    child(view, QComboBox, "figures").setCurrentIndex(1)
    QApplication.processEvents()
    [sheet] = [one for one in view.findChildren(ImageView) if one.isVisible()]
    assert "&" in child(view, QPushButton, "enlarge").text()

    def back_and_forth(opens: Callable[[], object], closes: Callable[[QDialog], object]) -> None:
        opens()
        large = child(view, QDialog, "large")
        assert large.windowTitle() == "Second"
        picture = child(large, ImageView)
        qtbot.waitUntil(lambda: picture.width() >= large.screen().size().width() - 2 * 8)
        shown = picture.grab().toImage()
        assert shown.pixelColor(shown.rect().center()).red() == 200
        closes(large)
        qtbot.waitUntil(lambda: not view.findChildren(QDialog))

    back_and_forth(
        lambda: QTest.mouseClick(sheet, Qt.MouseButton.LeftButton),
        lambda large: QTest.keyClick(large, Qt.Key.Key_Escape),
    )
    back_and_forth(
        lambda: QTest.keyClick(child(view, QPushButton, "enlarge"), Qt.Key.Key_Space),
        lambda large: QTest.mouseClick(child(large, ImageView), Qt.MouseButton.LeftButton),
    )
