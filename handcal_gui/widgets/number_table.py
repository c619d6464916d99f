"""A read-only table of numbers that can be copied as text."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import QRect, Qt, Signal
from PySide6.QtGui import QFontMetrics, QPainter, QResizeEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QHeaderView,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from handcal_gui.app.theme import SPACING_PX, flat_header, number_font, set_style

_PARTS = re.compile(" (?=±|mm)")
"""Between the parts of a cell that can have their own lines."""
_ALIGNMENT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter


@dataclass(frozen=True, slots=True)
class Row:
    """A row: label, cells and explanation; if cells are missing, the last one spans the rest."""

    label: str
    cells: tuple[str, ...]
    tooltip: str = ""


class NumberTable(QTableWidget):
    """Shows rows of numbers, right-aligned.

    Parameters
    ----------
    name : str
        Object name, the same in every language.
    label : str
        For screen readers.
    parent : QWidget or None
    hides : bool
        Where not all columns fit, the last ones are hidden and are in the tooltips; otherwise the
        table scrolls.
    wraps : bool
        Where not all columns fit with a gap before each, uncertainties, units and parts of headings
        have their own lines; without it, only the units of headings.

    Attributes
    ----------
    hidden_changed : Signal(str)
        The headings of the hidden columns, separated by semicolons.
    """

    hidden_changed = Signal(str)

    def __init__(
        self,
        name: str,
        label: str,
        parent: QWidget | None = None,
        *,
        hides: bool = False,
        wraps: bool = False,
    ) -> None:
        super().__init__(parent)
        self._hides, self._wraps = hides, wraps
        self.setObjectName(name)
        self.setAccessibleName(label)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.setTabKeyNavigation(False)
        self.setWordWrap(False)
        self.setShowGrid(False)
        self.setAlternatingRowColors(True)
        self.setVerticalHeader(_Labels(self))
        self.setHorizontalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        self.horizontalHeader().setSectionsClickable(False)
        self.horizontalHeader().setDefaultAlignment(_ALIGNMENT)
        self.verticalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        self.verticalHeader().setDefaultSectionSize(self.verticalHeader().minimumSectionSize())
        self.verticalHeader().setSectionsClickable(False)
        flat_header(self.horizontalHeader())
        flat_header(self.verticalHeader())
        for corner in self.findChildren(QAbstractButton):
            set_style(
                corner, "QTableCornerButton::section { background: palette(base); border: 0; }"
            )
        self._columns: tuple[str, ...] = ()
        self._rows: tuple[Row, ...] = ()
        self._hidden = ""

    def show_rows(self, columns: Sequence[str], rows: Sequence[Row]) -> None:
        """Replace the contents."""
        self._columns, self._rows = tuple(columns), tuple(rows)
        self.clearSpans()
        self.setColumnCount(len(columns))
        self.setRowCount(len(rows))
        self.setHorizontalHeaderLabels(columns)
        for number, row in enumerate(rows):
            self.setVerticalHeaderItem(number, QTableWidgetItem(row.label))
            for column, text in enumerate(row.cells):
                self.setItem(number, column, _number_item(text))
            if len(row.cells) < len(columns):
                self.setSpan(number, len(row.cells) - 1, 1, len(columns) - len(row.cells) + 1)
        self._fit_columns()

    @property
    def whole_height_px(self) -> int:
        """The height at which no row needs scrolling."""
        rows_px = self.verticalHeader().length() + self.horizontalHeader().sizeHint().height()
        return rows_px + 2 * self.frameWidth()

    def as_text(self) -> str:
        """Return the table as tab-separated lines."""
        return rows_as_text(self._columns, self._rows)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Distribute the available width."""
        super().resizeEvent(event)
        self._fit_columns()

    def _fit_columns(self) -> None:
        """Give each column the width of its contents, and an equal share of the rest."""
        columns, room_px = range(self.columnCount()), self.viewport().width()
        for column in columns:
            self.showColumn(column)  # a hidden one has no width
        gaps_px = SPACING_PX * len(columns) if self._wraps else 0  # or numbers run together
        for breaks in range(3 if self._wraps else 2):
            self._break_lines(breaks)
            needed_px = self._needed_px()
            if sum(needed_px) + gaps_px <= room_px:
                break
        fits = [c == 0 or sum(needed_px[: c + 1]) <= room_px for c in columns]
        shown = [column for column in columns if fits[column] or not self._hides]
        spare_px = max(0, room_px - sum(needed_px[column] for column in shown))
        for column in columns:
            self.setColumnWidth(column, needed_px[column] + spare_px // len(shown))
            self.setColumnHidden(column, column not in shown)
        self._explain(hidden=range(len(shown), len(columns)))
        hidden = "; ".join(self._columns[len(shown) :])
        if hidden != self._hidden:
            self._hidden = hidden
            self.hidden_changed.emit(hidden)

    def _needed_px(self) -> list[int]:
        header = self.horizontalHeader()
        return [
            max(self.sizeHintForColumn(column), header.sectionSizeHint(column))
            for column in range(self.columnCount())
        ]

    def _break_lines(self, breaks: int) -> None:
        """Break no lines (0), headings before their units (1), or all that can be broken (2)."""
        line_px = QFontMetrics(number_font()).lineSpacing()
        for column, title in enumerate(self._columns):
            if (heading := self.horizontalHeaderItem(column)) is not None:
                text = title.replace(", ", "\n") if breaks else title
                heading.setText(text.replace("-", "-\n") if breaks > 1 else text)
        for number, row in enumerate(self._rows):
            texts = [_PARTS.sub("\n", cell) if breaks > 1 else cell for cell in row.cells]
            for column, text in enumerate(texts):
                if (item := self.item(number, column)) is not None:
                    item.setText(text)
            more_px = line_px * any("\n" in text for text in texts)
            self.setRowHeight(number, self.verticalHeader().defaultSectionSize() + more_px)

    def _explain(self, hidden: Sequence[int]) -> None:
        """Set the tooltips, with the cells of hidden columns."""
        for number, row in enumerate(self._rows):
            more = [f"{self._columns[i]}: {row.cells[i]}" for i in hidden if i < len(row.cells)]
            tooltip = "\n".join([*filter(None, (row.tooltip,)), *more])
            items = (self.item(number, column) for column in range(len(row.cells)))
            for item in (self.verticalHeaderItem(number), *items):
                if item is not None:  # resized while the contents are replaced
                    item.setToolTip(tooltip)


class _Labels(QHeaderView):
    """Labels of rows, striped like the rows: a number may be far from its label."""

    def __init__(self, table: NumberTable) -> None:
        super().__init__(Qt.Orientation.Vertical, table)

    def paintSection(self, painter: QPainter, rect: QRect, row: int) -> None:
        if row % 2:
            painter.fillRect(rect, self.palette().alternateBase())
        super().paintSection(painter, rect, row)


def rows_as_text(columns: Sequence[str], rows: Sequence[Row]) -> str:
    """Return rows as tab-separated lines, with a line of headings first."""
    lines = [("", *columns), *((row.label, *row.cells) for row in rows)]
    return "\n".join("\t".join(line) for line in lines)


def _number_item(text: str) -> QTableWidgetItem:
    item = QTableWidgetItem(text)
    item.setFont(number_font())
    item.setTextAlignment(_ALIGNMENT)
    return item
