"""The list of a step's images, with corners found, residual, tilt and use."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QIcon, QImage, QPixmap
from PySide6.QtWidgets import QHeaderView, QTreeWidget, QTreeWidgetItem, QWidget

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
    tr("Note"): tr("Why no board was found, or what is wrong with the worst image."),
}
_IMAGE, _CORNERS, _OFF, _TILT, _NOTE = range(5)


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
        self.setIconSize(QSize(6 * SPACING_PX, 4 * SPACING_PX))
        self.setHeaderLabels(list(_COLUMNS))
        for column, tooltip in enumerate(_COLUMNS.values()):
            self.headerItem().setToolTip(column, tooltip)
        flat_header(self.header())
        self.header().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.header().setSectionResizeMode(_NOTE, QHeaderView.ResizeMode.Stretch)
        self.setMinimumSize(34 * SPACING_PX, 12 * SPACING_PX)
        self._shots: tuple[Shot, ...] = ()
        self.currentItemChanged.connect(lambda: self.chosen.emit(self.currentIndex().row()))
        self.itemChanged.connect(self._on_item_changed)
        follow_theme(self, self._mark_all)

    @property
    def dropped(self) -> tuple[str, ...]:
        """Names of the unticked shots."""
        unchecked = Qt.CheckState.Unchecked
        return tuple(
            shot.name for item, shot in self._rows() if item.checkState(_IMAGE) is unchecked
        )

    def show_shots(self, shots: Sequence[Shot], dropped: Iterable[str]) -> None:
        """Replace the list."""
        out = frozenset(dropped)
        self._shots = tuple(shots)
        self.blockSignals(True)
        self.clear()
        self.addTopLevelItems([_item(shot, shot.name in out) for shot in shots])
        self._mark_all()
        self.blockSignals(False)
        if (first := self.topLevelItem(0)) is not None:
            self.setCurrentItem(first)

    def show_results(
        self,
        residuals_px: Mapping[str, float],
        tilts_rad: Mapping[str, float],
        worst: tuple[str, str] = ("", ""),
    ) -> None:
        """Show residual and tilt of each, and mark the worst with the reason."""
        self.blockSignals(True)
        for item, shot in self._rows():
            off, tilt = residuals_px.get(shot.name), tilts_rad.get(shot.name)
            item.setText(_OFF, UNKNOWN if off is None else f"{off:.2f}")
            item.setText(_TILT, UNKNOWN if tilt is None else f"{np.degrees(tilt):.0f}°")
            # Of a pair, the worst is named after one image: "headset camera's of NAME".
            is_worst = worst[0].endswith(shot.name)
            _note(item, shot.problem or (tr("worst: {}").format(worst[1]) if is_worst else ""))
        self.blockSignals(False)

    def sizeHint(self) -> QSize:
        """Return the size at which there is room for notes."""
        return QSize(60 * SPACING_PX, super().sizeHint().height())

    def _on_item_changed(self, _item: QTreeWidgetItem, column: int) -> None:
        if column == _IMAGE:
            self.dropped_changed.emit()

    def _mark_all(self) -> None:
        for item, shot in self._rows():
            if shot.problem:
                item.setIcon(_NOTE, QIcon(icon("warning").pixmap(2 * SPACING_PX)))

    def _rows(self) -> list[tuple[QTreeWidgetItem, Shot]]:
        items = (self.topLevelItem(row) for row in range(self.topLevelItemCount()))
        return [(item, shot) for item, shot in zip(items, self._shots, strict=False) if item]


def _item(shot: Shot, is_dropped: bool) -> QTreeWidgetItem:
    counts = (str(len(view.found.ids)) if view.found else UNKNOWN for view in shot.views)
    item = QTreeWidgetItem([shot.name, " · ".join(counts), UNKNOWN, UNKNOWN])
    checked = Qt.CheckState.Unchecked if is_dropped else Qt.CheckState.Checked
    item.setCheckState(_IMAGE, checked)
    item.setToolTip(_IMAGE, shot.name)
    if shot.small is not None:
        item.setIcon(_IMAGE, _picture(shot.small))
    for column in (_CORNERS, _OFF, _TILT):
        item.setTextAlignment(column, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        item.setFont(column, number_font())
    _note(item, shot.problem)
    return item


def _note(item: QTreeWidgetItem, note: str) -> None:
    item.setText(_NOTE, sentence(note))
    item.setToolTip(_NOTE, sentence(note))


def _picture(image: UInt8) -> QIcon:
    height, width = image.shape[:2]
    shown = QImage(image.data, width, height, 3 * width, QImage.Format.Format_RGB888)
    return QIcon(QPixmap.fromImage(shown.copy()))
