from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from handcal_gui.widgets.number_table import NumberTable, Row

ROWS = (
    Row("φ1", ("+1.00 mm", "−2.00 mm"), "how far right"),
    Row("Method", ("consistent",)),
)


def test_rows_are_shown_right_aligned_and_explained(qtbot: QtBot) -> None:
    table = NumberTable("some-numbers", "Some numbers")
    qtbot.addWidget(table)
    table.show_rows(("Left eye", "Right eye"), ROWS)
    item, label = table.item(0, 1), table.verticalHeaderItem(0)
    assert item is not None
    assert label is not None
    assert item.text() == "−2.00 mm"
    assert item.textAlignment() & Qt.AlignmentFlag.AlignRight
    assert table.horizontalHeader().defaultAlignment() == item.textAlignment()
    assert item.toolTip() == label.toolTip() == "how far right"
    assert (table.columnSpan(0, 0), table.columnSpan(1, 0)) == (1, 2)


def test_other_rows_leave_nothing_of_the_first(qtbot: QtBot) -> None:
    table = NumberTable("some-numbers", "Some numbers")
    qtbot.addWidget(table)
    table.show_rows(("Left eye", "Right eye"), ROWS)
    table.show_rows(("a", "b"), (Row("one", ("1", "2")), Row("two", ("3", "4"))))
    assert table.columnSpan(1, 0) == 1
    assert table.as_text() == "\ta\tb\none\t1\t2\ntwo\t3\t4"


def test_columns_share_the_room_and_cut_no_number_short(qtbot: QtBot) -> None:
    table = NumberTable("some-numbers", "Some numbers")
    qtbot.addWidget(table)
    table.show_rows(("Left eye", "Right eye"), ROWS)
    table.show()
    for width_px in (60, 600):
        table.resize(width_px, 120)
        widths_px = [table.columnWidth(column) for column in range(2)]
        for column, column_px in enumerate(widths_px):
            assert column_px >= table.sizeHintForColumn(column)
    assert sum(widths_px) == pytest.approx(table.viewport().width(), abs=1)


def test_last_columns_that_do_not_fit_may_be_in_the_tooltips(qtbot: QtBot) -> None:
    table = NumberTable("some-numbers", "Some numbers", hides=True)
    qtbot.addWidget(table)
    table.show_rows(("Mean ′", "Max ′"), (Row("All", ("2.5", "4.0"), "each counts once"),))
    table.show()
    table.resize(table.verticalHeader().width() + table.sizeHintForColumn(0) + 30, 120)
    assert [table.isColumnHidden(column) for column in range(2)] == [False, True]
    item = table.item(0, 0)
    assert item is not None
    assert item.toolTip() == "each counts once\nMax ′: 4.0"
    table.resize(900, 120)
    assert [table.isColumnHidden(column) for column in range(2)] == [False, False]
    assert item.toolTip() == "each counts once"


def test_parts_of_cells_and_headings_have_their_own_lines_where_not_all_columns_fit(
    qtbot: QtBot,
) -> None:
    table = NumberTable("some-numbers", "Some numbers", wraps=True)
    qtbot.addWidget(table)
    table.show_rows(("icp-open3d, mm",), (Row("φ1", ("−2.00 ± 0.10",)),))
    table.show()
    cell, heading = table.item(0, 0), table.horizontalHeaderItem(0)
    assert cell is not None
    assert heading is not None
    heights_px = []
    for width_px in (600, 60):
        table.resize(width_px, 120)
        heights_px.append(table.rowHeight(0))
        is_wide = width_px == 600
        assert cell.text() == ("−2.00 ± 0.10" if is_wide else "−2.00\n± 0.10")
        assert heading.text() == ("icp-open3d, mm" if is_wide else "icp-\nopen3d\nmm")
    assert heights_px[0] < heights_px[1]
    assert table.as_text() == "\ticp-open3d, mm\nφ1\t−2.00 ± 0.10"


def test_the_unit_of_a_heading_has_its_own_line_only_where_not_all_columns_fit(
    qtbot: QtBot,
) -> None:
    table = NumberTable("some-numbers", "Some numbers")
    qtbot.addWidget(table)
    table.show_rows(("Mean error, px", "Mean error, ′"), (Row("Left eye", ("7.2", "10.1")),))
    table.show()
    for width_px, between in ((600, ", "), (60, "\n")):
        table.resize(width_px, 120)
        titles = [table.model().headerData(i, Qt.Orientation.Horizontal) for i in range(2)]
        assert titles == [f"Mean error{between}px", f"Mean error{between}′"]
