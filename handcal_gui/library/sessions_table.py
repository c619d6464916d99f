"""The view of the library's table: its columns fit, and sessions are chosen in it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from PySide6.QtCore import QItemSelection, QItemSelectionModel, Qt
from PySide6.QtGui import QFontMetrics, QKeyEvent, QResizeEvent
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView

from handcal.session.library import LibraryEntry
from handcal_gui.app.theme import SPACING_PX, flat_header, number_font
from handcal_gui.app.translation import tr
from handcal_gui.library.sessions_model import (
    COLUMNS,
    NAMES,
    SPARED,
    SessionRow,
    SessionsModel,
)
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.error_bars import PICTURE_PX
from handcal_gui.widgets.fields import paragraph, with_name
from handcal_gui.widgets.layouts import vbox
from handcal_gui.widgets.result_rows import NOTHING

_MOST_SHOWN_PX = 300
_TRIALS = 8
_LEAST_CHARACTERS = 7
"""That are shown of a name that is cut."""


class SessionsTable(QTableView):
    """Shows the sessions of a model; as long as there are any, one is selected.

    Parameters
    ----------
    sessions : SessionsModel

    Attributes
    ----------
    left_out : ElidedLabel
        Shows what has no room: the values of a single selected session, else the names of columns.
    """

    def __init__(self, sessions: SessionsModel) -> None:
        super().__init__()
        self._sessions = sessions
        self._kept: set[Path] = set()
        self._first_row = 0
        self._hidden: list[int] = []
        self.left_out = with_name(ElidedLabel(), "leftOut")
        self.left_out.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        with_name(self, "sessionTable", tr("Sessions"))
        self.setModel(sessions)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.setHorizontalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setTabKeyNavigation(False)
        self.setWordWrap(False)
        self.setShowGrid(False)
        self.setAlternatingRowColors(True)
        self.setSortingEnabled(True)
        self.sortByColumn(1, Qt.SortOrder.DescendingOrder)
        self.setMinimumHeight(12 * SPACING_PX)
        self.verticalHeader().hide()
        self.setIconSize(PICTURE_PX)
        row_px = max(self.fontMetrics().height(), PICTURE_PX.height()) + SPACING_PX // 2
        self.verticalHeader().setDefaultSectionSize(row_px)
        across = self.horizontalHeader()
        flat_header(across)
        across.setHighlightSections(False)
        # Of its own and empty, or the header asks for all cells whenever it is drawn.
        across.setSelectionModel(QItemSelectionModel(sessions, self))
        across.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        across.setStretchLastSection(True)
        self._reason = paragraph("noSessions")
        self._reason.setAlignment(Qt.AlignmentFlag.AlignCenter)
        vbox((self._reason, 1), on=self.viewport(), margins=2 * SPACING_PX)
        self.selectionModel().selectionChanged.connect(self._show_left_out)
        sessions.modelAboutToBeReset.connect(self._keep_chosen)
        sessions.modelReset.connect(lambda: self.choose(self._kept))

    @property
    def chosen(self) -> list[LibraryEntry]:
        """The sessions that are selected, in the order shown."""
        return [one.entry for one in self._chosen_rows]

    @property
    def _chosen_rows(self) -> list[SessionRow]:
        # By ranges: Qt's list of rows asks the model for every cell of every session.
        selection = self.selectionModel().selection()
        ranges = (selection.at(i) for i in range(selection.size()))
        rows = sorted({row for one in ranges for row in range(one.top(), one.bottom() + 1)})
        return [self._sessions.shown[row] for row in rows]

    def choose(self, paths: Collection[Path]) -> None:
        """Select sessions by their folders; if none is shown, the one in the place of the first."""
        shown = self._sessions.shown
        rows = [row for row, one in enumerate(shown) if one.entry.path in paths]
        if not rows and shown:
            rows = [min(self._first_row, len(shown) - 1)]
        wanted = QItemSelection()
        for first, last in _runs(rows):
            wanted.select(self._sessions.index(first, 0), self._sessions.index(last, 0))
        flags = QItemSelectionModel.SelectionFlag
        self.selectionModel().select(wanted, flags.ClearAndSelect | flags.Rows)
        if rows:
            current = self._sessions.index(rows[0], 0)
            self.selectionModel().setCurrentIndex(current, flags.NoUpdate)
        self._show_left_out()  # a reset, after which none is shown, emits nothing

    def show_reason(self, is_missing: bool) -> None:
        """Show why there is no session, and what to do; nothing if there is one."""
        reason = ""
        if is_missing:
            reason = tr(
                "This folder does not exist. Calibrate a wearer, which creates it, or choose "
                "another session folder on the start page."
            )
        elif not self._sessions.rows:
            reason = tr(
                "No session is in this folder yet. Calibrate a wearer, or choose another session "
                "folder on the start page."
            )
        elif not self._sessions.shown:
            reason = tr("No session matches. Search for something else, or choose All sessions.")
        self._reason.setText(reason)
        self._reason.setVisible(bool(reason))

    def fit_columns(self) -> None:
        """Show columns whole, as many as fit; names that are long are cut."""
        for number in SPARED:
            self.showColumn(number)  # a hidden title has no width
        wanted_px = {
            number: min(self._width_px(number), _MOST_SHOWN_PX) for number in range(len(COLUMNS))
        }
        spare_px = {number: max(wanted_px[number] - self._least_px(number), 0) for number in NAMES}
        excess_px = sum(wanted_px.values()) - self.viewport().width()
        hidden = []
        for number in SPARED:
            is_empty = self._sessions.longest_text(number) == NOTHING
            if excess_px > (0 if is_empty else sum(spare_px.values())):
                self.hideColumn(number)
                hidden.append(number)
                excess_px -= wanted_px[number]
                spare_px.pop(number, None)
        for number in filter(spare_px.get, NAMES):
            cut_px = min(max(excess_px, 0), spare_px[number])
            wanted_px[number] -= cut_px
            excess_px -= cut_px
        for number, width_px in wanted_px.items():
            self.setColumnWidth(number, width_px)
        self._hidden = sorted(hidden)
        self._show_left_out()

    def _show_left_out(self) -> None:
        """Show the values of a single selected session that have no column, or their names."""
        titles = [COLUMNS[number].title.split("\n")[0] for number in self._hidden]
        text = tr("A wider window also shows: {}").format(", ".join(titles))
        if len(rows := self._chosen_rows) == 1:
            values = (rows[0].texts[number] for number in self._hidden)
            text = "; ".join(map("{}: {}".format, titles, values))
        self.left_out.setText(text if self._hidden else "")

    def _keep_chosen(self) -> None:
        chosen = self.chosen
        self._kept = {entry.path for entry in chosen}
        if chosen:
            rows = (row for row, one in enumerate(self._sessions.shown) if one.entry is chosen[0])
            self._first_row = next(rows)

    def _least_px(self, column: int) -> int:
        """Return the least width of a column of names."""
        name_px = self.fontMetrics().averageCharWidth() * _LEAST_CHARACTERS
        return name_px + _picture_px(column) + 2 * SPACING_PX

    def _width_px(self, column: int) -> int:
        """Return the width of a column by its longest text: Qt would measure every cell."""
        font = number_font() if COLUMNS[column].is_number else self.font()
        text_px = QFontMetrics(font).horizontalAdvance(self._sessions.longest_text(column))
        # Qt's hint for a title in two lines is wider by 40 pixels.
        across = self.horizontalHeader().fontMetrics()
        lines = COLUMNS[column].title.split("\n")
        title_px = max(map(across.horizontalAdvance, lines)) + 3 * SPACING_PX  # with the arrow
        # The trials fill their column, and the text of the next one would touch them.
        apart_px = (3 if column == _TRIALS else 2) * SPACING_PX
        return max(text_px + _picture_px(column) + apart_px, title_px)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Sort by the next column in sight (F6), or in reverse (Shift+F6)."""
        if event.key() != Qt.Key.Key_F6:
            super().keyPressEvent(event)
            return
        header = self.horizontalHeader()
        column, order = header.sortIndicatorSection(), header.sortIndicatorOrder()
        if event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
            order = Qt.SortOrder(1 - order.value)
        else:
            others = (*range(column + 1, len(COLUMNS)), *range(column + 1))
            column = next(one for one in others if not header.isSectionHidden(one))
        self.sortByColumn(column, order)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Give the columns the room there is."""
        super().resizeEvent(event)
        self.fit_columns()


def _picture_px(column: int) -> int:
    return PICTURE_PX.width() + SPACING_PX if column == 0 else 0


def _runs(rows: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Yield the first and last of each run of consecutive numbers."""
    first = 0
    for i, row in enumerate(rows):
        if i + 1 == len(rows) or rows[i + 1] > row + 1:
            yield rows[first], row
            first = i + 1
