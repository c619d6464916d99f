"""The table: rows shown, chosen, deleted, sorted and copied; columns fit the room."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QToolButton
from pytestqt.qtbot import QtBot

from handcal_gui.calibrate.parts.record_tabs import RecordTabs
from handcal_gui.widgets.table import Column, Row, Table
from tests.gui.helpers import show

EYES = ("Left eye", "Right eye")
NUMBERS = (Row("φ1", ("+1.00 mm", "−2.00 mm"), "how far right"), Row("Method", ("consistent",)))
THINGS = (Column("No.", "Number"), Column("Name", "Its name", is_number=False))


def rows_of(*numbers: int) -> list[Row]:
    return [Row("", (str(number), f"thing {number}"), key=number) for number in numbers]


@pytest.fixture
def table(qtbot: QtBot) -> Table:
    return show(qtbot, Table("things", "Things", "Things appear here", "one"), 400, 200)


def test_rows_with_labels_are_explained_and_copied(qtbot: QtBot) -> None:
    table = show(qtbot, Table("numbers", "Numbers"), 600, 200)
    table.show_rows(EYES, NUMBERS)
    cell = table.model().index(0, 2)
    assert cell.data() == "−2.00 mm"
    assert cell.data(Qt.ItemDataRole.TextAlignmentRole) & Qt.AlignmentFlag.AlignRight
    assert "how far right" in cell.data(Qt.ItemDataRole.ToolTipRole)
    assert (table.columnSpan(0, 1), table.columnSpan(1, 1)) == (1, 2), "one for both eyes"
    assert table.as_text() == "\tLeft eye\tRight eye\nφ1\t+1.00 mm\t−2.00 mm\nMethod\tconsistent"
    table.show_rows(("a", "b"), (Row("one", ("1", "2")), Row("two", ("3", "4"))))
    assert table.columnSpan(1, 1) == 1


def test_del_deletes_the_chosen_row_unless_it_is_only_read(qtbot: QtBot, table: Table) -> None:
    deleted: list[int] = []
    table.offer_delete(deleted.append)
    table.show_rows(THINGS, rows_of(3, 7))
    table.setFocus()
    QTest.keyClick(table, Qt.Key.Key_Delete)
    assert not deleted, "nothing is chosen"
    table.selectRow(1)
    table.set_read_only(True)
    QTest.keyClick(table, Qt.Key.Key_Delete)
    assert not deleted
    table.set_read_only(False)
    QTest.keyClick(table, Qt.Key.Key_Delete)
    assert deleted == [7]


def test_the_choice_stays_with_its_row_and_moves_on_after_a_deletion(table: Table) -> None:
    table.offer_delete(lambda _: None)
    table.show_rows(THINGS, rows_of(1, 3))
    table.selectRow(1)
    for numbers, chosen in (((1, 2, 3), [3]), ((1, 2), [2]), ((1,), [1]), ((), [])):
        table.show_rows(THINGS, rows_of(*numbers))
        assert table.chosen == chosen
    assert table.delete_action is not None
    assert not table.delete_action.isEnabled()
    table.show_rows(THINGS, rows_of(5))
    assert table.chosen == []


def test_of_several_one_is_always_chosen_and_sorting_keeps_the_choice(qtbot: QtBot) -> None:
    table = show(qtbot, Table("t", "T", chooses="several", is_sorted=True), 400, 200)
    table.sortByColumn(0, Qt.SortOrder.AscendingOrder)
    table.show_rows(THINGS, [Row("", (f"{n}", "x"), key=n, sort_keys=(n, "x")) for n in (10, 9, 2)])
    assert table.keys == [2, 9, 10], "by the number, not the text"
    assert table.chosen == [2]
    table.choose([9, 10])
    QTest.keyClick(table, Qt.Key.Key_F6, Qt.KeyboardModifier.ShiftModifier)
    assert table.keys == [10, 9, 2]
    assert table.chosen == [10, 9]
    table.show_rows(THINGS, [])
    assert table.chosen == []


def test_a_new_last_row_is_brought_into_view(table: Table) -> None:
    table.show_rows(THINGS, rows_of(*range(1, 50)))
    table.scrollToTop()
    table.show_rows(THINGS, rows_of(*range(2, 50)))
    assert table.rowAt(0) == 0, "a deletion does not scroll"
    table.show_rows(THINGS, rows_of(*range(2, 51)))
    assert table.rowAt(table.viewport().height() - 2) == 48


def test_columns_that_do_not_fit_are_left_out_by_rank_and_are_in_the_tooltip(
    qtbot: QtBot,
) -> None:
    columns = (
        Column("No.", "Number"),
        Column("Size mm", "Its size", rank=2),
        Column("Name", "Its name", is_number=False, rank=1),
    )
    table = show(qtbot, Table("things", "Things"), 900, 200)
    table.show_rows(columns, [Row("", ("7", "1.25", "a name of some length"), key=7)])
    told: list[list[str]] = []
    table.hidden_changed.connect(lambda: told.append(list(table.hidden)))
    for width_px in (250, 60, 900):
        table.resize(width_px, 200)
    assert told == [["Size mm"], ["Size mm", "Name"], []]
    table.resize(250, 200)
    assert table.hidden == {"Size mm": {7: "1.25"}}
    assert "Size mm: 1.25" in table.model().index(0, 0).data(Qt.ItemDataRole.ToolTipRole)


def test_a_row_is_ticked_by_the_space_bar(qtbot: QtBot, table: Table) -> None:
    ticked: list[tuple[int, bool]] = []
    table.offer_ticks(lambda key, is_ticked: ticked.append((key, is_ticked)))
    table.show_rows(THINGS, [Row("", ("1", "thing"), key=7, is_ticked=True), *rows_of(8)])
    table.choose([7])
    for _ in range(2):
        QTest.keyClick(table, Qt.Key.Key_Space)
    assert ticked == [(7, False), (7, True)]
    table.choose([8])
    QTest.keyClick(table, Qt.Key.Key_Space)
    assert len(ticked) == 2, "it has no box"


def test_one_column_takes_what_the_others_leave(table: Table) -> None:
    columns = (Column("Name"), Column("Note", is_number=False, is_rest=True))
    for note in ("short", 99 * "long "):
        table.show_rows(columns, [Row("", ("thing", note), key=1)])
        table.resize(400, 200)
        assert not table.horizontalScrollBar().isVisible()
        assert table.columnWidth(0) < table.columnWidth(1)


def test_no_number_is_cut_and_two_lines_have_their_room(table: Table) -> None:
    table.show_rows(THINGS, [*rows_of(1), Row("", ("12345.67", "left\nright"), key=2)])
    assert table.columnWidth(0) >= table.sizeHintForColumn(0)
    assert table.rowHeight(1) >= table.rowHeight(0) + table.fontMetrics().height()


def test_the_corner_of_tabs_deletes_in_the_table_shown(qtbot: QtBot) -> None:
    tabs = RecordTabs()
    qtbot.addWidget(tabs)
    tables = [Table(name, name, chooses="one") for name in ("things", "others")]
    for table in tables:
        table.offer_delete(lambda _: None)
        tabs.addTab(table, table.objectName())
    delete = tabs.cornerWidget()
    assert isinstance(delete, QToolButton)
    for shown in (1, 0):
        tabs.setCurrentIndex(shown)
        assert delete.defaultAction() is tables[shown].delete_action
