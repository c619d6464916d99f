"""A list of the planned captures of a cube test, with the state of each."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QIcon, QPixmap
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTreeWidget, QTreeWidgetItem, QWidget

from handcal.lab.evaluate.cube_folder import PlannedCapture
from handcal_gui.app.theme import SPACING_PX, colors, flat_header, follow_theme, icon
from handcal_gui.app.translation import tr

_IMAGE, _STATE = range(2)


class CaptureList(QTreeWidget):
    """Lists images in the order in which to take them, each with its state.

    Attributes
    ----------
    chosen_changed : Signal()
    """

    chosen_changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("captures")
        self.setAccessibleName(tr("Images to take"))
        self.setRootIsDecorated(False)
        self.setAlternatingRowColors(True)
        self.setUniformRowHeights(True)
        self.setIconSize(QSize(2 * SPACING_PX, 2 * SPACING_PX))
        self.setHeaderLabels([tr("Image"), tr("State")])
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        flat_header(self.header())
        self.header().setStretchLastSection(False)
        self.header().setSectionResizeMode(_IMAGE, QHeaderView.ResizeMode.Stretch)
        self.header().setSectionResizeMode(_STATE, QHeaderView.ResizeMode.ResizeToContents)
        self.setMinimumWidth(36 * SPACING_PX)
        self._items: list[QTreeWidgetItem] = []
        self._captures: tuple[PlannedCapture, ...] = ()
        self._missing: Collection[PlannedCapture] = ()
        self.currentItemChanged.connect(self.chosen_changed)
        follow_theme(self, self._show_states)

    @property
    def chosen(self) -> PlannedCapture | None:
        """The image to take next; None if none is listed or none is missing."""
        place = self.currentIndex().row()
        return self._captures[place] if place >= 0 else None

    @property
    def is_complete(self) -> bool:
        """True if images are listed and none is missing."""
        return bool(self._captures) and not self._missing

    @property
    def chosen_is_taken(self) -> bool:
        """True if the selected image has been taken and would be replaced."""
        return self.chosen is not None and self.chosen not in self._missing

    def show_captures(
        self, captures: Sequence[PlannedCapture], missing: Collection[PlannedCapture]
    ) -> None:
        """Replace the list, and select the next missing image after the selected one."""
        last = self.currentIndex().row()
        self._captures, self._missing = tuple(captures), missing
        self.blockSignals(True)
        self.clear()
        self._items = [QTreeWidgetItem([f"{one.where}/{one.name}"]) for one in captures]
        self.addTopLevelItems(self._items)
        self._show_states()
        places = [place for place, one in enumerate(captures) if one in missing]
        following = min(places, key=lambda place: (place < last, place), default=-1)
        self.setCurrentIndex(self.model().index(following, _IMAGE))
        self.blockSignals(False)
        self.chosen_changed.emit()

    def _show_states(self) -> None:
        blank = QPixmap(self.iconSize())  # keeps the sizes of rows and columns constant
        blank.fill(Qt.GlobalColor.transparent)
        icons = {True: QIcon(blank), False: icon("check", colors().good)}
        for item, capture in zip(self._items, self._captures, strict=True):
            is_missing = capture in self._missing
            item.setText(_STATE, tr("missing") if is_missing else tr("taken"))
            item.setIcon(_STATE, icons[is_missing])
