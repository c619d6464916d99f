"""The view of the library's table: its columns fit, and sessions are chosen in it."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from PySide6.QtCore import QItemSelection, QItemSelectionModel, Qt
from PySide6.QtGui import QFontMetrics, QResizeEvent
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView

from handcal.session.library import LibraryEntry
from handcal_gui.theme import SPACING_PX, flat_header, number_font
from handcal_gui.translation import tr
from handcal_gui.widgets.error_bars import PICTURE_PX
from handcal_gui.widgets.fields import paragraph, with_name
from handcal_gui.widgets.layouts import vbox
from handcal_gui.windows.library.sessions_model import COLUMNS, SessionsFilter, SessionsModel

_MOST_SHOWN_PX = 300
_LONG_NAMES_PX = {tr("Rig"): 60, tr("Headset"): 60, tr("Wearer"): 120}
"""Widths that remain of columns with long texts, in the order in which they are cut."""


class SessionsTable(QTableView):
    """Shows the sessions of a model that pass its filter.

    Parameters
    ----------
    sessions : SessionsModel
    shown : SessionsFilter
        Of these sessions.
    """

    def __init__(self, sessions: SessionsModel, shown: SessionsFilter) -> None:
        super().__init__()
        self._sessions, self._shown = sessions, shown
        with_name(self, "sessionTable", tr("Sessions"))
        self.setModel(shown)
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
        across.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        across.setStretchLastSection(True)
        self._reason = paragraph("noSessions")
        self._reason.setAlignment(Qt.AlignmentFlag.AlignCenter)
        vbox((self._reason, 1), on=self.viewport(), margins=2 * SPACING_PX)

    @property
    def chosen(self) -> list[LibraryEntry]:
        """The sessions that are selected, in the order shown."""
        rows = sorted(self.selectionModel().selectedRows(), key=lambda index: index.row())
        return [self._sessions.entries[self._shown.mapToSource(one).row()] for one in rows]

    def choose(self, paths: Collection[Path]) -> None:
        """Select sessions too, by their folders."""
        wanted = QItemSelection()
        for row, entry in enumerate(self._sessions.entries):
            place = self._shown.mapFromSource(self._sessions.index(row, 0))
            if entry.path in paths and place.isValid():
                wanted.select(place, place)
        flags = QItemSelectionModel.SelectionFlag
        self.selectionModel().select(wanted, flags.Select | flags.Rows)

    def show_reason(self, reason: str) -> None:
        """Show the reason why the table is empty; an empty one if it is not."""
        self._reason.setText(reason)
        self._reason.setVisible(bool(reason))

    def fit_columns(self) -> None:
        """Show every column's contents; long names are cut as far as the room demands."""
        wanted_px = {
            column.title: min(self._width_px(number), _MOST_SHOWN_PX)
            for number, column in enumerate(COLUMNS)
        }
        excess_px = sum(wanted_px.values()) - self.viewport().width()
        for title, least_px in _LONG_NAMES_PX.items():
            cut_px = max(min(excess_px, wanted_px[title] - least_px), 0)
            wanted_px[title] -= cut_px
            excess_px -= cut_px
        for number, width_px in enumerate(wanted_px.values()):
            self.setColumnWidth(number, width_px)

    def _width_px(self, column: int) -> int:
        """Return the width of a column by its longest text: Qt would measure every cell."""
        font = number_font() if COLUMNS[column].is_number else self.font()
        text_px = QFontMetrics(font).horizontalAdvance(self._sessions.longest_text(column))
        picture_px = PICTURE_PX.width() + SPACING_PX if column == 0 else 0
        title_px = self.horizontalHeader().sectionSizeHint(column)
        return max(text_px + picture_px + 2 * SPACING_PX, title_px)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Give the columns the room there is."""
        super().resizeEvent(event)
        self.fit_columns()
