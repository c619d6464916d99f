"""The table: rows of texts under columns, sorted, chosen, copied, and fitted to the room."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

from PySide6.QtCore import (
    QAbstractTableModel,
    QItemSelection,
    QItemSelectionModel,
    QModelIndex,
    QModelRoleData,
    QPersistentModelIndex,
    Qt,
    Signal,
)
from PySide6.QtGui import QAction, QFontMetrics, QKeyEvent, QPixmap, QResizeEvent
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView, QWidget

from handcal_gui.app.keys import add_action
from handcal_gui.app.theme import SPACING_PX, flat_header, number_font
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import paragraph, plain_tooltip, with_name
from handcal_gui.widgets.layouts import vbox

_Index: TypeAlias = QModelIndex | QPersistentModelIndex
_NO_INDEX = QModelIndex()
_MOST_PX = 300
"""Width of a column at most; a longer text is cut, and whole in the tooltip."""
_LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
_CENTRE = Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignVCenter
_RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter


@dataclass(frozen=True, slots=True)
class Column:
    """A column; numbers are right-aligned."""

    title: str
    tooltip: str = ""
    is_number: bool = True
    rank: int = 0
    """Columns of the highest rank are left out first if not all fit; those of rank 0 never."""
    is_rest: bool = False
    """It takes all the room that the others leave, be it more or less than its texts need."""


@dataclass(frozen=True, slots=True)
class Row:
    """A row of a table."""

    label: str
    """Stands before the cells; there is no column for it if no row has one."""
    cells: tuple[str, ...]
    """If cells are missing, the last one spans the rest."""
    tooltip: str = ""
    key: Hashable = None
    """By which a chosen row is found again after a change."""
    sort_keys: tuple[Any, ...] = ()
    """By which each column is sorted; by default the cells."""
    picture: Callable[[], QPixmap] | None = None
    picture_text: str = ""
    """Stands before the first cell, and says the same for screen readers."""
    is_ticked: bool | None = None
    """Of a box before the first cell; None if there is none."""


class _Model(QAbstractTableModel):
    def __init__(self) -> None:
        super().__init__()
        self.columns: tuple[Column, ...] = ()
        self._given: Sequence[Column] = ()
        self.rows: list[Row] = []
        self.texts: list[tuple[str, ...]] = []
        self.hidden: list[int] = []
        self.order: tuple[int, Qt.SortOrder] | None = None
        self.tick: Callable[[Any, bool], object] = lambda _key, _is_ticked: None
        self._font = number_font()

    def replace(self, columns: Sequence[Column], rows: Iterable[Row]) -> None:
        self.beginResetModel()
        self._given, self.rows = columns, list(rows)
        has_labels = any(row.label for row in self.rows)
        self.columns = (*(Column("", is_number=False),) * has_labels, *columns)

        def texts(row: Row) -> tuple[str, ...]:
            return (row.label, *row.cells) if has_labels else row.cells

        if self.order is not None and self.order[0] < len(self.columns):
            column, order = self.order
            self.rows.sort(
                key=lambda row: (row.sort_keys or texts(row))[column],
                reverse=order == Qt.SortOrder.DescendingOrder,
            )
        self.texts = [texts(row) for row in self.rows]
        self.endResetModel()

    def sort(self, column: int, order: Qt.SortOrder = Qt.SortOrder.AscendingOrder) -> None:
        self.order = column, order
        self.replace(self._given, self.rows)

    def rowCount(self, parent: _Index = _NO_INDEX) -> int:
        return 0 if parent.isValid() else len(self.rows)

    def columnCount(self, parent: _Index = _NO_INDEX) -> int:
        return 0 if parent.isValid() else len(self.columns)

    def multiData(self, index: _Index, wanted: Iterable[QModelRoleData]) -> None:  # type: ignore[override]
        # All that is drawn of a cell at once: while a job runs, each call waits for Python.
        for one in wanted:  # a span, of which PySide does not declare that it is iterable
            one.setData(self.data(index, one.role()))

    def data(self, index: _Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        row, place = self.rows[index.row()], index.column()
        texts, column = self.texts[index.row()], self.columns[place]
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return texts[place] if place < len(texts) else ""
            case Qt.ItemDataRole.DecorationRole if place == 0 and row.picture:
                return row.picture()
            case Qt.ItemDataRole.CheckStateRole if place == 0 and row.is_ticked is not None:
                return Qt.CheckState.Checked if row.is_ticked else Qt.CheckState.Unchecked
            case Qt.ItemDataRole.AccessibleDescriptionRole if place == 0:
                return row.picture_text
            case Qt.ItemDataRole.ToolTipRole:
                titles = ((i, self.columns[i].title.replace("\n", " ")) for i in self.hidden)
                hidden = (f"{title}: {texts[i]}" for i, title in titles)
                text = texts[place] if place < len(texts) and row.key is not None else ""
                lines = text, row.tooltip or column.tooltip, *hidden
                return plain_tooltip("\n".join(filter(None, lines)))
            case Qt.ItemDataRole.FontRole if column.is_number:
                return self._font
            case Qt.ItemDataRole.TextAlignmentRole:
                return self._alignment(place)
        return None

    def flags(self, index: _Index) -> Qt.ItemFlag:
        has_box = index.column() == 0 and self.rows[index.row()].is_ticked is not None
        boxes = Qt.ItemFlag.ItemIsUserCheckable if has_box else Qt.ItemFlag.NoItemFlags
        return super().flags(index) | boxes

    def setData(self, index: _Index, value: Any, role: int = Qt.ItemDataRole.EditRole) -> bool:
        if role != Qt.ItemDataRole.CheckStateRole:
            return False
        is_ticked = Qt.CheckState(value) == Qt.CheckState.Checked
        row = self.rows[index.row()] = replace(self.rows[index.row()], is_ticked=is_ticked)
        self.dataChanged.emit(index, index)
        self.tick(row.key, is_ticked)
        return True

    def _alignment(self, place: int) -> Qt.AlignmentFlag:
        if not self.columns[place].is_number:
            return _LEFT
        # On the right, a number would run into the text of the next column.
        shown = (i for i in range(place + 1, len(self.columns)) if i not in self.hidden)
        following = next(shown, place)
        return _RIGHT if self.columns[following].is_number else _CENTRE

    def headerData(
        self,
        section: int,
        orientation: Qt.Orientation,
        role: int = Qt.ItemDataRole.DisplayRole,
    ) -> object:
        if orientation == Qt.Orientation.Vertical or section >= len(self.columns):
            return None
        column = self.columns[section]
        texts = {
            Qt.ItemDataRole.DisplayRole: column.title,
            Qt.ItemDataRole.ToolTipRole: column.tooltip,
            Qt.ItemDataRole.TextAlignmentRole: self._alignment(section),
        }
        return texts.get(Qt.ItemDataRole(role))


class Table(QTableView):
    """Shows rows; where not all columns fit, it leaves some out and has them in the tooltips.

    Parameters
    ----------
    name : str
        Object name, the same in every language.
    label : str
        For screen readers.
    empty_text : str
        Hint shown while the table is empty.
    chooses : {"none", "one", "several"}
        How many rows can be selected. With *several*, one always is, as long as there are any.
    is_sorted : bool
        A click on a heading sorts by it, and F6 by the next column (Shift+F6: in reverse).
    wraps : bool
        Long texts have several lines instead of being cut.

    Attributes
    ----------
    chosen_changed : Signal()
        Other rows are selected.
    hidden_changed : Signal()
        Other columns are left out.
    delete_action : QAction or None
        Of `offer_delete`.
    """

    chosen_changed = Signal()
    hidden_changed = Signal()

    def __init__(
        self,
        name: str,
        label: str,
        empty_text: str = "",
        chooses: Literal["none", "one", "several"] = "none",
        *,
        is_sorted: bool = False,
        wraps: bool = False,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        with_name(self, name, label)
        self._chooses = chooses
        self._kept: tuple[Hashable, ...] = ()
        self._first_row = 0
        self._is_read_only = False
        self.delete_action: QAction | None = None
        self._model = _Model()
        self.setModel(self._model)
        modes = QAbstractItemView.SelectionMode
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(
            {"none": modes.NoSelection, "one": modes.SingleSelection}.get(
                chooses, modes.ExtendedSelection
            )
        )
        self.setHorizontalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setTabKeyNavigation(False)
        self.setWordWrap(wraps)
        if wraps:
            self.verticalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.setShowGrid(False)
        self.setAlternatingRowColors(True)
        self.verticalHeader().hide()
        across = self.horizontalHeader()
        flat_header(across)
        across.setHighlightSections(False)
        # Of its own and empty, or the header asks for all cells whenever it is drawn.
        across.setSelectionModel(QItemSelectionModel(self._model, self))
        across.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        self._hint = paragraph(f"{name}-empty", empty_text)
        self._hint.setAlignment(Qt.AlignmentFlag.AlignCenter)
        vbox((self._hint, 1), on=self.viewport(), margins=2 * SPACING_PX)
        self._model.modelReset.connect(self._keep_chosen)
        self.selectionModel().selectionChanged.connect(self._note_chosen)
        self.setSortingEnabled(is_sorted)

    def show_rows(self, columns: Sequence[Column | str], rows: Sequence[Row]) -> None:
        """Replace the contents; a new last row is scrolled into view, chosen rows stay chosen."""
        before = {row.key for row in self._model.rows}
        self._model.replace([Column(one) if isinstance(one, str) else one for one in columns], rows)
        self.clearSpans()
        for number, (row, texts) in enumerate(
            zip(self._model.rows, self._model.texts, strict=True)
        ):
            missing = len(self._model.columns) - len(texts)
            if missing:
                self.setSpan(number, len(texts) - 1, 1, 1 + missing)
            lines = 1 + max((text.count("\n") for text in texts), default=0)
            height_px = lines * (QFontMetrics(number_font()).lineSpacing() + 1)
            if row.picture is not None:
                height_px = max(height_px, self.iconSize().height())
            self.setRowHeight(number, height_px + SPACING_PX // 2)
        self._hint.setVisible(not self._model.rows)
        if before and rows and rows[-1].key is not None and rows[-1].key not in before:
            self.scrollToBottom()
        self._fit_columns()

    def show_hint(self, text: str) -> None:
        """Show another hint while the table is empty."""
        self._hint.setText(text)

    @property
    def keys(self) -> list[Hashable]:
        """The keys of all rows, in the order shown."""
        return [row.key for row in self._model.rows]

    @property
    def chosen(self) -> list[Any]:
        """The keys of the selected rows, in the order shown."""
        # By ranges: Qt's list of rows asks the model for every cell.
        selection = self.selectionModel().selection()
        ranges = (selection.at(i) for i in range(selection.size()))
        rows = sorted({row for one in ranges for row in range(one.top(), one.bottom() + 1)})
        return [self._model.rows[row].key for row in rows]

    def choose(self, keys: Collection[Hashable]) -> None:
        """Select rows by their keys; where none is there, the one in the place of the first."""
        rows = [number for number, key in enumerate(self.keys) if key in keys]
        if not rows and self._model.rows and (keys or self._chooses == "several"):
            rows = [min(self._first_row, len(self._model.rows) - 1)]
        wanted = QItemSelection()
        for row in rows:
            index = self._model.index(row, 0)
            wanted.select(index, index)
        flags = QItemSelectionModel.SelectionFlag
        self.selectionModel().select(wanted, flags.ClearAndSelect | flags.Rows)
        if rows:
            first = self._model.index(rows[0], 0)
            self.selectionModel().setCurrentIndex(first, flags.NoUpdate)

    @property
    def hidden(self) -> dict[str, dict[Hashable, str]]:
        """The columns left out, by title, with the texts of each row by its key."""
        keyed = list(zip(self.keys, self._model.texts, strict=True))
        return {
            self._model.columns[i].title: {key: texts[i] for key, texts in keyed}
            for i in self._model.hidden
        }

    def offer_ticks(self, tick: Callable[[Any, bool], object]) -> None:
        """Call `tick` with the key of a row whose box was ticked or not, and which of the two."""
        self._model.tick = tick

    def offer_delete(self, delete: Callable[[Any], object]) -> None:
        """Call `delete` with the key of the chosen row when Del or the menu asks for it."""
        self.delete_action = add_action(
            self,
            tr("Delete"),
            "Del",
            lambda: [delete(key) for key in self.chosen],
            tooltip=tr("Delete the selected row (Del); can be undone"),
            context=Qt.ShortcutContext.WidgetShortcut,
        )
        self.delete_action.setObjectName("delete")
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)
        self._note_chosen()

    def set_read_only(self, is_read_only: bool) -> None:
        """Allow or forbid deleting."""
        self._is_read_only = is_read_only
        self._note_chosen()

    def as_text(self) -> str:
        """Return the table as tab-separated lines, with a line of headings first."""
        lines = [[column.title for column in self._model.columns], *self._model.texts]
        return "\n".join("\t".join(line) for line in lines)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Give the columns the room there is."""
        super().resizeEvent(event)
        self._fit_columns()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Sort by the next column in sight (F6), or in reverse (Shift+F6)."""
        if event.key() != Qt.Key.Key_F6 or not self.isSortingEnabled():
            super().keyPressEvent(event)
            return
        header, count = self.horizontalHeader(), len(self._model.columns)
        column, order = header.sortIndicatorSection(), header.sortIndicatorOrder()
        if event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
            order = Qt.SortOrder(1 - order.value)
        else:
            others = (*range(column + 1, count), *range(column + 1))
            column = next(one for one in others if not header.isSectionHidden(one))
        self.sortByColumn(column, order)

    def _fit_columns(self) -> None:
        """Show the columns that fit, each as wide as its contents, and share out the rest."""
        columns = self._model.columns
        if not columns:
            return
        wanted_px = [self._width_px(number) for number in range(len(columns))]
        room_px, shown = self.viewport().width(), list(range(len(columns)))
        for number in sorted(shown, key=lambda n: -columns[n].rank):
            if columns[number].rank and sum(wanted_px[one] for one in shown) > room_px:
                shown.remove(number)
        spare_px = max(0, room_px - sum(wanted_px[number] for number in shown))
        rest = [number for number in shown if columns[number].is_rest] or shown
        for number in range(len(columns)):
            self.setColumnHidden(number, number not in shown)
            more_px = spare_px // len(rest) if number in rest else 0
            self.setColumnWidth(number, wanted_px[number] + more_px)
        hidden = [number for number in range(len(columns)) if number not in shown]
        if hidden != self._model.hidden:
            self._model.hidden = hidden
            self.hidden_changed.emit()

    def _width_px(self, number: int) -> int:
        """Return the width of a column by its longest text: Qt would measure every cell."""
        column = self._model.columns[number]
        font = QFontMetrics(number_font() if column.is_number else self.font())
        cells = (
            texts[number]
            for texts in self._model.texts
            if number < len(texts) - (len(texts) < len(self._model.columns))  # none that spans
        )
        lines = (line for text in cells for line in text.split("\n"))
        text_px = font.horizontalAdvance(max(lines, key=len, default=""))
        if number == 0 and any(row.picture for row in self._model.rows):
            text_px += self.iconSize().width() + SPACING_PX
        if number == 0 and any(row.is_ticked is not None for row in self._model.rows):
            text_px += 3 * SPACING_PX
        title = self.horizontalHeader().fontMetrics()
        title_px = max(map(title.horizontalAdvance, column.title.split("\n")))
        arrow_px = 2 * SPACING_PX if self.isSortingEnabled() else 0
        needed_px = 0 if column.is_rest else text_px
        return min(max(needed_px, title_px + arrow_px), _MOST_PX) + 2 * SPACING_PX

    def _note_chosen(self) -> None:
        if self.delete_action is not None:
            self.delete_action.setEnabled(bool(self.chosen) and not self._is_read_only)
        chosen = self.chosen
        if chosen:
            self._first_row = self.keys.index(chosen[0])
        if chosen or self._model.rows or self._chooses == "one":  # else until rows are found again
            self._kept = tuple(chosen)
        self.chosen_changed.emit()

    def _keep_chosen(self) -> None:
        """Choose again, after a change, what was chosen."""
        if self._chooses != "none":
            self.choose(self._kept)
            self._note_chosen()


def rows_as_text(columns: Sequence[str], rows: Sequence[Row]) -> str:
    """Return rows as tab-separated lines, with a line of headings first."""
    lines = [("", *columns), *((row.label, *row.cells) for row in rows)]
    return "\n".join("\t".join(line) for line in lines)
