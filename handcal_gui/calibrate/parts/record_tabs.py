"""Tabs of tables, with a button that deletes the selected row of the visible one."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QTabWidget, QToolButton, QWidget

from handcal_gui.widgets.record_table import RecordTable


class RecordTabs(QTabWidget):
    """Tabs with a Delete button in the corner while a `RecordTable` is visible."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._delete = QToolButton()
        self._delete.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the table handles Del
        self.setCornerWidget(self._delete)
        self.setUsesScrollButtons(False)  # a long title is shortened instead
        self.setElideMode(Qt.TextElideMode.ElideRight)
        self.currentChanged.connect(self._refresh)

    def _refresh(self) -> None:
        page = self.currentWidget()
        if isinstance(page, RecordTable):
            for former in self._delete.actions():  # else both are a menu, with an arrow
                self._delete.removeAction(former)
            self._delete.setDefaultAction(page.delete_action)
        self._delete.setVisible(isinstance(page, RecordTable))
