"""A list of the findings about a rig, with a sign for each that was judged or is not known."""

from __future__ import annotations

import re
from collections.abc import Sequence

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QRect, QSize, Qt
from PySide6.QtGui import QIcon, QPixmap, QResizeEvent
from PySide6.QtWidgets import (
    QHeaderView,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

from handcal.rig.report import RigFinding
from handcal_gui.app.theme import SPACING_PX, colors, flat_header, follow_theme, icon
from handcal_gui.app.translation import tr
from handcal_gui.widgets.sentence import sentence
from handcal_gui.widgets.times import local_time

_ITEM, _FOUND, _EXPECTED = range(3)
_TIME = re.compile(r"\d{4}-\d\d-\d\dT[\d:.]+(\+\d\d:\d\d|Z)?")
"""ISO 8601."""


class FindingList(QTreeWidget):
    """Lists findings, and the expected value of doubtful ones.

    Parameters
    ----------
    name : str
        For screen readers.
    """

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("rigFindings")
        self.setAccessibleName(name)
        self.setRootIsDecorated(False)
        self.setAlternatingRowColors(True)
        self.setWordWrap(True)
        self.setIconSize(QSize(2 * SPACING_PX, 2 * SPACING_PX))
        self.setHeaderLabels([tr("Item"), tr("Found"), tr("Expected")])
        flat_header(self.header())
        self.header().setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        self.header().setSectionResizeMode(_FOUND, QHeaderView.ResizeMode.Stretch)
        for column in (_ITEM, _FOUND, _EXPECTED):
            self.setItemDelegateForColumn(column, _Wrapped(self))
        self.header().setStretchLastSection(False)
        self.header().sectionResized.connect(self.scheduleDelayedItemsLayout)
        self._findings: tuple[RigFinding, ...] = ()
        follow_theme(self, self._refresh)

    def show_findings(self, findings: Sequence[RigFinding]) -> None:
        """Replace the list; failed and doubtful findings come first, then what is not known."""
        self._findings = tuple(sorted(findings, key=_urgency))
        self._refresh()

    def _refresh(self) -> None:
        self.clear()
        good, doubtful = icon("check", colors().good), icon("warning", colors().warning)
        unknown, failed = icon("wait", colors().muted), icon("cross", colors().red)
        blank = QPixmap(self.iconSize())  # or the texts of rows without an icon stand apart
        blank.fill(Qt.GlobalColor.transparent)
        for one in self._findings:
            expected = "" if one.is_fine else one.expected
            found = _TIME.sub(lambda time: local_time(time[0]), one.found)
            item = QTreeWidgetItem([sentence(text) for text in (one.what, found, expected)])
            judged = (doubtful, tr("Doubtful")), (good, tr("Good"))
            sign, word = judged[one.is_fine] if one.is_judged else (QIcon(blank), "")
            if not one.is_known:
                sign, word = unknown, tr("Not known")
            if one.has_failed:
                sign, word = failed, tr("Failed")
            item.setIcon(0, sign)
            for column in range(3):
                item.setToolTip(column, item.text(column))
            item.setData(0, Qt.ItemDataRole.AccessibleDescriptionRole, word)
            self.addTopLevelItem(item)
        self.setColumnHidden(_EXPECTED, all(one.is_fine for one in self._findings))
        self._fit_columns()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Leave to what was found the width that the other columns do not need."""
        super().resizeEvent(event)
        self._fit_columns()

    def _fit_columns(self) -> None:
        doubtful = [one.expected for one in self._findings if not one.is_fine]
        for column, texts in (_ITEM, [one.what for one in self._findings]), (_EXPECTED, doubtful):
            longest_px = max(map(self.fontMetrics().horizontalAdvance, texts), default=0)
            icon_px = self.iconSize().width() * (column == _ITEM)
            most_px = self.viewport().width() // (2 if column == _ITEM else 4)
            needed_px = min(longest_px + icon_px + 2 * SPACING_PX, most_px)
            self.header().resizeSection(
                column, max(needed_px, self.header().sectionSizeHint(column))
            )


def _urgency(finding: RigFinding) -> tuple[bool, ...]:
    return not finding.has_failed, finding.is_fine, finding.is_known


class _Wrapped(QStyledItemDelegate):
    """Makes a row as high as its texts are when wrapped; Qt's trees do so for one line only."""

    def __init__(self, shown: FindingList) -> None:
        super().__init__(shown)
        self._list = shown

    def sizeHint(
        self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> QSize:
        option.rect = QRect(0, 0, self._list.columnWidth(index.column()), 1)
        return super().sizeHint(option, index)
