from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QToolButton
from pytestqt.qtbot import QtBot

from handcal_gui.calibrate.parts.record_tabs import RecordTabs
from handcal_gui.widgets.record_table import RecordColumn, RecordTable
from tests.gui.helpers import show

COLUMNS = (RecordColumn("No.", "Number"), RecordColumn("What", "Anything", is_number=False))


def rows_of(*numbers: int) -> dict[int, tuple[str, ...]]:
    return {number: (str(number), f"thing {number}") for number in numbers}


@pytest.fixture
def table(qtbot: QtBot) -> RecordTable:
    table = RecordTable("things", "Things", COLUMNS, "Things appear here")
    qtbot.addWidget(table)
    table.show()
    return table


def test_numbers_stand_on_the_right(table: RecordTable) -> None:
    table.show_rows(rows_of(1))
    number, what = (table.model().index(0, column) for column in range(2))
    role = Qt.ItemDataRole.TextAlignmentRole
    assert number.data(role) & Qt.AlignmentFlag.AlignRight
    assert what.data(role) & Qt.AlignmentFlag.AlignLeft
    assert number.data(Qt.ItemDataRole.ToolTipRole) == "Number"


def test_del_asks_for_the_chosen_thing_by_its_number(qtbot: QtBot, table: RecordTable) -> None:
    table.show_rows(rows_of(3, 7))
    table.setFocus()
    with qtbot.assertNotEmitted(table.delete_requested):
        QTest.keyClick(table, Qt.Key.Key_Delete)
    table.selectRow(1)
    with qtbot.waitSignal(table.delete_requested) as asked:
        QTest.keyClick(table, Qt.Key.Key_Delete)
    assert asked.args == [7]


def test_the_next_row_is_chosen_after_a_deletion(table: RecordTable) -> None:
    table.show_rows(rows_of(1, 2, 3, 4))
    table.selectRow(1)
    table.show_rows(rows_of(1, 3, 4))
    assert table.chosen_number() == 3
    table.show_rows(rows_of(1, 4))
    assert table.chosen_number() == 4
    table.show_rows(rows_of(1))
    assert table.chosen_number() == 1
    table.show_rows({})
    assert table.chosen_number() is None
    assert not table.delete_action.isEnabled()


def test_the_choice_stays_with_its_thing(table: RecordTable) -> None:
    table.show_rows(rows_of(1, 3))
    table.selectRow(1)
    table.show_rows(rows_of(1, 2, 3))
    assert table.chosen_number() == 3


def test_a_new_last_row_is_brought_into_view(table: RecordTable) -> None:
    table.resize(200, 120)
    table.show_rows(rows_of(*range(1, 50)))
    table.scrollToTop()
    table.show_rows(rows_of(*range(2, 50)))
    assert table.rowAt(0) == 0, "a deletion does not scroll"
    table.show_rows(rows_of(*range(2, 51)))
    assert table.rowAt(table.viewport().height() - 2) == 48


def test_nothing_is_deleted_from_what_is_only_read(table: RecordTable) -> None:
    table.show_rows(rows_of(1))
    table.selectRow(0)
    table.set_read_only(True)
    assert not table.delete_action.isEnabled()
    table.set_read_only(False)
    assert table.delete_action.isEnabled()


def test_columns_that_do_not_fit_are_in_the_tooltip_of_the_row(qtbot: QtBot) -> None:
    columns = (
        RecordColumn("No.", "Number"),
        RecordColumn("Size mm", "Its size", rank=2),
        RecordColumn("Name", "Its name", is_number=False, rank=1),
    )
    table = RecordTable("things", "Things", columns, "Things appear here")
    show(qtbot, table, 400, 200)  # all columns fit
    table.show_rows({7: ("7", "1.25", "a name of some length")})
    no, size, name = (table.columnWidth(column) for column in range(3))
    for width, hidden in (
        (no + size + name + 10, []),
        (no + name + 10, [1]),
        (no + 10, [1, 2]),
        (no + size + name + 10, []),
    ):
        table.resize(width, 200)
        qtbot.waitUntil(lambda: table.horizontalScrollBar().maximum() == 0)
        assert [column for column in range(3) if table.isColumnHidden(column)] == hidden
    table.resize(no + name + 10, 200)
    tooltip = table.model().index(0, 0).data(Qt.ItemDataRole.ToolTipRole)
    assert tooltip == "Number\n\nSize mm: 1.25"


def test_delete_in_the_corner_of_tabs_deletes_in_the_table_shown_and_has_no_menu(
    qtbot: QtBot,
) -> None:
    tabs = RecordTabs()
    qtbot.addWidget(tabs)
    tables = [RecordTable(name, name, COLUMNS, "") for name in ("things", "others")]
    for table in tables:
        tabs.addTab(table, table.objectName())
    delete = tabs.cornerWidget()
    assert isinstance(delete, QToolButton)
    for shown in (1, 0):
        tabs.setCurrentIndex(shown)
        assert delete.actions() == [tables[shown].delete_action]
        assert delete.defaultAction() is tables[shown].delete_action
