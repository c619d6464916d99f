"""A table of numbered items, one of which can be selected and deleted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from PySide6.QtCore import (
    QAbstractTableModel,
    QMargins,
    QModelIndex,
    QPersistentModelIndex,
    Qt,
    Signal,
)
from PySide6.QtGui import QColor, QFontMetrics, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView, QWidget

from handcal_gui.app.keys import add_action
from handcal_gui.app.theme import SPACING_PX, colors, flat_header, number_font
from handcal_gui.app.translation import tr

_EMPTY_MARGINS = QMargins(*4 * (2 * SPACING_PX,))
_NO_INDEX = QModelIndex()
_MEASURED_ROWS = 20
_LINES = " / "
"""Between the lines of a cell where they are in one line."""


@dataclass(frozen=True, slots=True)
class RecordColumn:
    """A column; numbers are right-aligned."""

    title: str
    tooltip: str
    is_number: bool = True
    rank: int = 0
    """Columns of the highest rank are hidden first if not all fit."""


class RecordTable(QTableView):
    """Shows one item per row; what is in columns that do not fit is in the row's tooltip.

    Parameters
    ----------
    name : str
        Object name, the same in every language.
    label : str
        For screen readers.
    columns : sequence of RecordColumn
    empty_text : str
        Hint shown while the table is empty.

    Attributes
    ----------
    delete_requested : Signal(int)
        Del was pressed or chosen from the context menu: the number of the selected item.
    """

    delete_requested = Signal(int)

    def __init__(
        self,
        name: str,
        label: str,
        columns: Sequence[RecordColumn],
        empty_text: str,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName(name)
        self.setAccessibleName(label)
        self._empty_text = empty_text
        self._is_read_only = False
        self._records = _Records(columns)
        self._widths_px: list[int] = []
        self.setModel(self._records)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setHorizontalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setTabKeyNavigation(False)
        self.setWordWrap(False)
        self.setShowGrid(False)
        self.setAlternatingRowColors(True)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(self.fontMetrics().height() + SPACING_PX // 2)
        across = self.horizontalHeader()
        flat_header(across)
        across.setHighlightSections(False)
        across.setResizeContentsPrecision(_MEASURED_ROWS)
        across.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.delete_action = add_action(
            self,
            tr("Delete"),
            "Del",
            self._delete,
            tooltip=tr("Delete the selected row (Del); can be undone"),
            context=Qt.ShortcutContext.WidgetShortcut,
        )
        self.delete_action.setObjectName("delete")
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)
        self.selectionModel().selectionChanged.connect(self._refresh)
        self._refresh()

    def show_rows(self, rows: Mapping[int, tuple[str, ...]]) -> None:
        """Show cells by number, in order; a new last row is scrolled into view."""
        before, numbers = self._records.numbers, list(rows)
        chosen, row = self.chosen_number(), self.currentIndex().row()
        self._records.replace(rows)
        line_px = QFontMetrics(number_font()).lineSpacing() + 1  # rounded up: else it is elided
        least_px = self.verticalHeader().defaultSectionSize()
        for place, cells in enumerate(rows.values()):
            more = max(cell.count("\n") for cell in cells)
            self.setRowHeight(place, least_px + more * line_px)
        if chosen is not None and numbers:
            is_there = chosen in rows
            self.selectRow(numbers.index(chosen) if is_there else min(row, len(numbers) - 1))
        if max(numbers, default=0) > max(before, default=0):
            self.scrollToBottom()
        self._measure_columns()
        self._refresh()

    def set_read_only(self, is_read_only: bool) -> None:
        """Allow or forbid deleting."""
        self._is_read_only = is_read_only
        self._refresh()

    def chosen_number(self) -> int | None:
        """Return the number of the selected item; None if none is selected."""
        rows = self.selectionModel().selectedRows()
        return self._records.numbers[rows[0].row()] if rows else None

    def sizeHintForColumn(self, column: int) -> int:
        """Keep cells apart that are wider than the title of their column."""
        return super().sizeHintForColumn(column) + SPACING_PX

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Show the columns that fit."""
        super().resizeEvent(event)
        self._show_fitting_columns()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the hint while the table is empty."""
        super().paintEvent(event)
        if not self._records.numbers:
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

    def _measure_columns(self) -> None:
        header, columns = self.horizontalHeader(), range(self._records.columnCount())
        for column in columns:
            self.showColumn(column)  # a hidden one has no width
        self._widths_px = [
            max(self.sizeHintForColumn(column), header.sectionSizeHint(column))
            for column in columns
        ]
        self._show_fitting_columns()

    def _show_fitting_columns(self) -> None:
        """Hide the columns that do not fit, those of the highest rank first."""
        room_px, hidden = self.viewport().width(), set()
        for column in self._records.by_rank if self._widths_px else ():
            room_px -= self._widths_px[column]
            if room_px < 0:
                hidden.add(column)
        self._records.hidden = frozenset(hidden)
        for column in range(self._records.columnCount()):
            self.setColumnHidden(column, column in hidden)

    def _refresh(self) -> None:
        has_choice = self.chosen_number() is not None
        self.delete_action.setEnabled(has_choice and not self._is_read_only)


class _Records(QAbstractTableModel):
    """Model of the rows; a QTableWidgetItem per cell would take 0.5 s for a thousand rows."""

    def __init__(self, columns: Sequence[RecordColumn]) -> None:
        super().__init__()
        self.numbers: list[int] = []
        self.hidden: frozenset[int] = frozenset()
        self._columns = tuple(columns)
        self.by_rank = sorted(range(len(columns)), key=lambda column: columns[column].rank)
        self._cells: list[tuple[str, ...]] = []
        self._font = number_font()

    def replace(self, rows: Mapping[int, tuple[str, ...]]) -> None:
        self.beginResetModel()
        self.numbers, self._cells = list(rows), list(rows.values())
        self.endResetModel()

    def rowCount(self, _parent: QModelIndex | QPersistentModelIndex = _NO_INDEX) -> int:
        return len(self._cells)

    def columnCount(self, _parent: QModelIndex | QPersistentModelIndex = _NO_INDEX) -> int:
        return len(self._columns)

    def data(
        self,
        index: QModelIndex | QPersistentModelIndex,
        role: int = Qt.ItemDataRole.DisplayRole,
    ) -> object:
        column = self._columns[index.column()]
        if role == Qt.ItemDataRole.DisplayRole:
            return self._cells[index.row()][index.column()]
        if role == Qt.ItemDataRole.FontRole and column.is_number:
            return self._font
        if role == Qt.ItemDataRole.ToolTipRole and self.hidden:
            cells = self._cells[index.row()]
            hidden = ((self._columns[i].title, cells[i]) for i in sorted(self.hidden))
            lines = (f"{title}: {_LINES.join(cell.splitlines())}" for title, cell in hidden)
            return "\n".join((column.tooltip, "", *lines))
        return _look(column, role)

    def headerData(
        self,
        section: int,
        orientation: Qt.Orientation,
        role: int = Qt.ItemDataRole.DisplayRole,
    ) -> object:
        if orientation == Qt.Orientation.Vertical:
            return None
        column = self._columns[section]
        return column.title if role == Qt.ItemDataRole.DisplayRole else _look(column, role)


def _look(column: RecordColumn, role: int) -> object:
    if role == Qt.ItemDataRole.ToolTipRole:
        return column.tooltip
    if role == Qt.ItemDataRole.TextAlignmentRole:
        side = Qt.AlignmentFlag.AlignRight if column.is_number else Qt.AlignmentFlag.AlignLeft
        return side | Qt.AlignmentFlag.AlignVCenter
    return None
