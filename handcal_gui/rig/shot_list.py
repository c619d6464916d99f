"""The list of a step's images, with corners found, residual, tilt and use."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from PySide6.QtCore import (
    QAbstractItemModel,
    QEvent,
    QModelIndex,
    QPersistentModelIndex,
    QRect,
    QSize,
    Qt,
    Signal,
)
from PySide6.QtGui import QIcon, QImage, QPainter, QPalette, QPixmap
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

from handcal.core.types import UInt8
from handcal_gui.app.theme import SPACING_PX, flat_header, follow_theme, icon, number_font
from handcal_gui.app.translation import tr
from handcal_gui.rig.shots import Shot
from handcal_gui.widgets.number_label import UNKNOWN
from handcal_gui.widgets.sentence import sentence

_COLUMNS = {
    tr("Image"): tr("Unticked images are excluded; tick them to include them again."),
    tr("Corners"): tr("Number of board corners found in each camera's image."),
    tr("RMS, px"): tr(
        "Root mean square distance between detected and expected corners, after solving."
    ),
    tr("Tilt"): tr("Angle between the board's normal and the line of sight, after solving."),
}
_IMAGE, _CORNERS, _OFF, _TILT = range(4)
_NAME, _PROBLEM = Qt.ItemDataRole.UserRole, Qt.ItemDataRole.UserRole + 1
_SMALL = QSize(6 * SPACING_PX, 4 * SPACING_PX)
_SIGN = QSize(2 * SPACING_PX, 2 * SPACING_PX)
_MARGIN_PX = SPACING_PX // 2
_NARROW_PX = 40 * SPACING_PX
"""Width of the list below which the thumbnails leave their room to the image beside it."""
_WRAPS = Qt.TextFlag.TextWordWrap.value


class ShotList(QTreeWidget):
    """Lists shots, each with a check box to use or exclude it.

    Attributes
    ----------
    chosen : Signal(int)
        Index of the newly selected shot.
    dropped_changed : Signal()
    """

    chosen = Signal(int)
    dropped_changed = Signal()

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("shots")
        self.setAccessibleName(name)
        self.setRootIsDecorated(False)
        self.setAlternatingRowColors(True)
        self.setIconSize(_SMALL)
        self.setColumnCount(len(_COLUMNS))
        self.setHeaderLabels(list(_COLUMNS))
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        for column, tooltip in enumerate(_COLUMNS.values()):
            self.headerItem().setToolTip(column, tooltip)
            if column != _IMAGE:
                self.headerItem().setTextAlignment(column, Qt.AlignmentFlag.AlignRight)
        flat_header(self.header())
        self.header().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.header().setSectionResizeMode(_IMAGE, QHeaderView.ResizeMode.Stretch)
        self.header().setStretchLastSection(False)
        self.header().sectionResized.connect(self.scheduleDelayedItemsLayout)
        self.setItemDelegate(_Rows(self))
        self.setMinimumSize(34 * SPACING_PX, 12 * SPACING_PX)
        self.currentItemChanged.connect(self._choose)
        self.itemChanged.connect(self._on_item_changed)
        follow_theme(self, self._mark_all)

    @property
    def dropped(self) -> tuple[str, ...]:
        """Names of the unticked shots."""
        return tuple(
            _name(item)
            for item in self._items()
            if item.checkState(_IMAGE) is Qt.CheckState.Unchecked
        )

    def show_shots(self, shots: Sequence[Shot], dropped: Iterable[str]) -> None:
        """Replace the list."""
        out = frozenset(dropped)
        self.blockSignals(True)
        self.clear()
        for shot in shots:
            self.addTopLevelItem(_item(shot, shot.name in out))
        self.blockSignals(False)
        if shots:
            self.setCurrentItem(self._items()[0])

    def show_results(
        self,
        residuals_px: Mapping[str, float],
        tilts_rad: Mapping[str, float],
        worst: tuple[str, str] = ("", ""),
    ) -> None:
        """Show residual and tilt of each, and mark the worst with the reason."""
        self.blockSignals(True)
        for item in self._items():
            name = _name(item)
            off, tilt = residuals_px.get(name), tilts_rad.get(name)
            item.setText(_OFF, UNKNOWN if off is None else f"{off:.2f}")
            item.setText(_TILT, UNKNOWN if tilt is None else f"{np.degrees(tilt):.0f}°")
            # Of a pair, the worst is named after one image: "headset camera's of NAME".
            note = tr("worst: {}").format(worst[1]) if worst[0].endswith(name) else ""
            _note(item, item.data(_IMAGE, _PROBLEM) or note)
        self.blockSignals(False)

    def sizeHint(self) -> QSize:
        """Return the size at which there is room for thumbnails."""
        return QSize(50 * SPACING_PX, super().sizeHint().height())

    def drawRow(
        self,
        painter: QPainter,
        option: QStyleOptionViewItem,
        index: QModelIndex | QPersistentModelIndex,
    ) -> None:
        """Draw a row, and its note under all columns."""
        super().drawRow(painter, option, index)
        note_px, room = _note_px(self, index), self.visualRect(index)
        if note_px:
            room = QRect(0, room.bottom() + 1 - note_px, self.viewport().width(), note_px)
            text = QPalette.ColorRole.Text
            if index.row() == self.currentIndex().row():
                painter.fillRect(room, self.palette().highlight())
                text = QPalette.ColorRole.HighlightedText
            painter.setPen(self.palette().color(text))
            painter.drawText(room.adjusted(_MARGIN_PX, 0, -_MARGIN_PX, 0), _WRAPS, _note_of(index))

    def _choose(self, item: QTreeWidgetItem | None) -> None:
        self.chosen.emit(-1 if item is None else self.indexOfTopLevelItem(item))

    def _on_item_changed(self, _item: QTreeWidgetItem, column: int) -> None:
        if column == _IMAGE:
            self.dropped_changed.emit()

    def _mark_all(self) -> None:
        for item in self._items():
            _mark(item)

    def _items(self) -> list[QTreeWidgetItem]:
        items = (self.topLevelItem(row) for row in range(self.topLevelItemCount()))
        return [item for item in items if item is not None]


class _Rows(QStyledItemDelegate):
    """Leaves room for a note below a row's cells."""

    def __init__(self, shown: ShotList) -> None:
        super().__init__(shown)
        self._list = shown

    def initStyleOption(
        self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> None:
        super().initStyleOption(option, index)
        option.text = str(index.data()).partition("\n")[0]
        if index.column() != _IMAGE:
            option.decorationSize = _SIGN
        elif self._list.width() < _NARROW_PX:
            option.features &= ~QStyleOptionViewItem.ViewItemFeature.HasDecoration

    def sizeHint(
        self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> QSize:
        return super().sizeHint(option, index) + QSize(0, _note_px(self._list, index))

    def paint(
        self,
        painter: QPainter,
        option: QStyleOptionViewItem,
        index: QModelIndex | QPersistentModelIndex,
    ) -> None:
        super().paint(painter, self._above_note(option, index), index)

    def editorEvent(
        self,
        event: QEvent,
        model: QAbstractItemModel,
        option: QStyleOptionViewItem,
        index: QModelIndex | QPersistentModelIndex,
    ) -> bool:
        return super().editorEvent(event, model, self._above_note(option, index), index)

    def _above_note(
        self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> QStyleOptionViewItem:
        option.rect = option.rect.adjusted(0, 0, 0, -_note_px(self._list, index))
        return option


def _note_of(index: QModelIndex | QPersistentModelIndex) -> str:
    return str(index.sibling(index.row(), _IMAGE).data()).partition("\n")[2]


def _note_px(shown: ShotList, index: QModelIndex | QPersistentModelIndex) -> int:
    """Return the height of a row's note, wrapped at the width of the list; 0 without one."""
    note, room = _note_of(index), QRect(0, 0, shown.viewport().width() - 2 * _MARGIN_PX, 9999)
    height_px = shown.fontMetrics().boundingRect(room, _WRAPS, note).height()
    return height_px + _MARGIN_PX if note else 0


def _item(shot: Shot, is_dropped: bool) -> QTreeWidgetItem:
    item = QTreeWidgetItem()
    item.setData(_IMAGE, _NAME, shot.name)
    item.setData(_IMAGE, _PROBLEM, shot.problem)
    checked = Qt.CheckState.Unchecked if is_dropped else Qt.CheckState.Checked
    item.setCheckState(_IMAGE, checked)
    if shot.small is not None:
        item.setIcon(_IMAGE, _picture(shot.small))
    counts = (str(len(view.found.ids)) if view.found else UNKNOWN for view in shot.views)
    item.setText(_CORNERS, " · ".join(counts))
    item.setText(_OFF, UNKNOWN)
    item.setText(_TILT, UNKNOWN)
    for column in (_CORNERS, _OFF, _TILT):
        item.setTextAlignment(column, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        item.setFont(column, number_font())
    _mark(item)
    _note(item, shot.problem)
    return item


def _mark(item: QTreeWidgetItem) -> None:
    if item.data(_IMAGE, _PROBLEM):
        item.setIcon(_CORNERS, icon("warning"))


def _name(item: QTreeWidgetItem) -> str:
    return str(item.data(_IMAGE, _NAME))


def _note(item: QTreeWidgetItem, note: str) -> None:
    """Show the image's name with a note below."""
    text = "\n".join(filter(None, (_name(item), sentence(note))))
    item.setText(_IMAGE, text)
    for column in range(len(_COLUMNS)):
        item.setToolTip(column, text)


def _picture(image: UInt8) -> QIcon:
    height, width = image.shape[:2]
    shown = QImage(image.data, width, height, 3 * width, QImage.Format.Format_RGB888)
    return QIcon(QPixmap.fromImage(shown.copy()))
