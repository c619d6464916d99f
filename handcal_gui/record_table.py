"""A table of things with numbers, one of which can be chosen and deleted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from PySide6.QtCore import QMargins, Qt, Signal
from PySide6.QtGui import QAction, QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from handcal_gui.theme import SPACING_PX, colors, number_font

_EMPTY_MARGINS = QMargins(*4 * (2 * SPACING_PX,))


@dataclass(frozen=True, slots=True)
class Column:
    """One column; numbers stand on its right."""

    title: str
    tooltip: str
    is_number: bool = True


class RecordTable(QTableWidget):
    """Shows one thing a row.

    Parameters
    ----------
    name : str
        For screen readers and, with dashes, as object name.
    columns : sequence of Column
    empty_text : str
        Shown while there is nothing: what will be here, and how it gets there.

    Attributes
    ----------
    delete_requested : Signal(int)
        Del was pressed, or chosen from the context menu: the number of the row's thing.
    """

    delete_requested = Signal(int)

    def __init__(
        self,
        name: str,
        columns: Sequence[Column],
        empty_text: str,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(0, len(columns), parent)
        self.setObjectName(name.lower().replace(" ", "-"))
        self.setAccessibleName(name)
        self._columns = tuple(columns)
        self._empty_text = empty_text
        self._rows: dict[int, tuple[str, ...]] = {}
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setHorizontalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setTabKeyNavigation(False)
        self.setWordWrap(False)
        self.verticalHeader().hide()
        self.verticalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.horizontalHeader().setHighlightSections(False)
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        for index, column in enumerate(columns):
            header = QTableWidgetItem(column.title)
            header.setToolTip(column.tooltip)
            header.setTextAlignment(_alignment(column))
            self.setHorizontalHeaderItem(index, header)
        self.delete_action = QAction("Delete", self)
        self.delete_action.setToolTip("Delete the chosen row (Del); it can be undone")
        self.delete_action.setShortcut(Qt.Key.Key_Delete)
        self.delete_action.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
        self.delete_action.triggered.connect(self._delete)
        self.addAction(self.delete_action)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)
        self.itemSelectionChanged.connect(self._refresh)
        self._is_read_only = False
        self._refresh()

    def show_rows(self, rows: Mapping[int, tuple[str, ...]]) -> None:
        """Show cells by number, in order; a new last one is brought into view."""
        if dict(rows) == self._rows:
            return
        chosen, had_last = self.currentRow(), max(self._rows, default=0)
        number = self.chosen_number()
        self._rows = dict(rows)
        self.setRowCount(len(rows))
        for row, cells in enumerate(rows.values()):
            for index, (text, column) in enumerate(zip(cells, self._columns, strict=True)):
                self.setItem(row, index, _item(text, column))
        if number in self._rows:
            chosen = list(self._rows).index(number)
        if number is not None and self._rows:
            self.selectRow(min(chosen, len(self._rows) - 1))
        if max(self._rows, default=0) > had_last:
            self.scrollToBottom()
        self._refresh()

    def set_read_only(self, is_read_only: bool) -> None:
        """Let nothing be deleted."""
        self._is_read_only = is_read_only
        self._refresh()

    def chosen_number(self) -> int | None:
        """Return the number in the chosen row; None if none is chosen."""
        rows = self.selectionModel().selectedRows()
        return list(self._rows)[rows[0].row()] if rows else None

    def paintEvent(self, event: QPaintEvent) -> None:
        """Say what will be here while there is nothing."""
        super().paintEvent(event)
        if not self._rows:
            painter = QPainter(self.viewport())
            painter.setPen(QColor(colors().muted))
            room = self.viewport().rect().marginsRemoved(_EMPTY_MARGINS)
            flags = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
            painter.drawText(room, flags, self._empty_text)
            painter.end()

    def _delete(self) -> None:
        number = self.chosen_number()
        if number is not None:
            self.delete_requested.emit(number)

    def _refresh(self) -> None:
        has_choice = bool(self.selectionModel().selectedRows())
        self.delete_action.setEnabled(has_choice and not self._is_read_only)


def _item(text: str, column: Column) -> QTableWidgetItem:
    item = QTableWidgetItem(text)
    item.setToolTip(column.tooltip)
    item.setTextAlignment(_alignment(column))
    if column.is_number:
        item.setFont(number_font())
    return item


def _alignment(column: Column) -> Qt.AlignmentFlag:
    side = Qt.AlignmentFlag.AlignRight if column.is_number else Qt.AlignmentFlag.AlignLeft
    return side | Qt.AlignmentFlag.AlignVCenter
