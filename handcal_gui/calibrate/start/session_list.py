"""A list from which one session is chosen."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import (
    QHBoxLayout,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QSizePolicy,
    QWidget,
)

from handcal_gui.app.theme import SPACING_PX, follow_theme, icon
from handcal_gui.calibrate.start.session_entries import Entry
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.error_bars import (
    PICTURE_HELP,
    PICTURE_LEGEND,
    PICTURE_PX,
    error_bars,
    has_bars,
    picture_text,
)
from handcal_gui.widgets.fields import button, paragraph, plain_tooltip, with_name
from handcal_gui.widgets.layouts import vbox


class SessionList(QWidget):
    """Lists sessions; a double click, Enter, or the button below chooses one.

    Parameters
    ----------
    name : str
        For screen readers, such as "Unfinished sessions".
    verb : str
        Label of the button.
    empty : str
        Text shown if the list is empty.

    Attributes
    ----------
    chosen : Signal(Path)
    """

    chosen = Signal(object)

    def __init__(
        self, name: str, verb: str, empty: str = "", parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._list = with_name(QListWidget(), "sessions", name)
        self._list.setWordWrap(True)
        # As tall as the available space, not as the items need.
        self._list.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)
        self._list.setMinimumHeight(6 * SPACING_PX)  # two rows, or one of two lines
        self._list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._list.setAlternatingRowColors(True)
        self._list.setIconSize(PICTURE_PX)
        self._button = button("choose", verb)
        self._list.itemActivated.connect(self._choose)
        self._list.currentItemChanged.connect(self._refresh)
        self._button.clicked.connect(self._choose)
        self._empty = paragraph("empty", empty)
        self._empty.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._layout = vbox(
            (self._empty, 1), (self._list, 1), on=self, margins=0, spacing=SPACING_PX // 2
        )
        self._legend = with_name(ElidedLabel(), "legend")
        self._legend.setText(PICTURE_LEGEND)
        self._legend.setToolTip(PICTURE_HELP)
        self._buttons = QHBoxLayout()
        self._buttons.addWidget(self._legend, 1)
        self._buttons.addStretch()
        self._buttons.addWidget(self._button)
        self._layout.addLayout(self._buttons)
        self._entries: Sequence[Entry] = ()
        follow_theme(self, lambda: self.show_entries(self._entries))

    def show_entries(self, entries: Sequence[Entry]) -> None:
        """Replace the entries, keeping the selection if it is still listed and none is newer."""
        before, self._entries = {entry.path for entry in self._entries}, entries
        has_pictures = any(has_bars(entry.eyes) for entry in entries)
        kept = self._list.currentItem()
        kept_path = kept.data(Qt.ItemDataRole.UserRole) if kept is not None else None
        newest = next((entry.path for entry in entries if entry.is_enabled), None)
        if newest not in before:
            kept_path = newest
        self._list.clear()
        self._list.setVisible(bool(entries))
        self._empty.setVisible(not entries)
        self._legend.setVisible(has_pictures)
        for entry in entries:
            item = QListWidgetItem(entry.text)
            item.setData(Qt.ItemDataRole.UserRole, entry.path)
            why = "" if entry.is_enabled else entry.text  # of which a small list shows a part
            about = "\n".join(filter(None, (str(entry.path), why, picture_text(entry.eyes))))
            item.setToolTip(plain_tooltip(about))
            item.setData(Qt.ItemDataRole.AccessibleDescriptionRole, picture_text(entry.eyes))
            if has_pictures:
                item.setIcon(QIcon(error_bars(entry.eyes)))
            if not entry.is_enabled:
                item.setFlags(Qt.ItemFlag.ItemIsEnabled)
                item.setIcon(icon("warning"))
            self._list.addItem(item)
            if entry.is_enabled and (self._list.currentItem() is None or entry.path == kept_path):
                self._list.setCurrentItem(item)
        self._refresh()

    def add_button(self, added: QPushButton) -> None:
        """Add a button before the list's own; the legend then has a line of its own."""
        self._layout.insertWidget(2, self._legend)
        self._buttons.insertWidget(1, added)

    def _choose(self) -> None:
        item = self._list.currentItem()
        if _may_be_chosen(item):
            self.chosen.emit(item.data(Qt.ItemDataRole.UserRole))

    def _refresh(self) -> None:
        self._button.setEnabled(_may_be_chosen(self._list.currentItem()))


def _may_be_chosen(item: QListWidgetItem | None) -> bool:
    return item is not None and bool(item.flags() & Qt.ItemFlag.ItemIsSelectable)
