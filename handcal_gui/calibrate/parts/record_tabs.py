"""Tabs of tables, with a button that deletes the selected row of the visible one."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QTabWidget, QToolButton, QWidget

from handcal_gui.widgets.table import Table


class RecordTabs(QTabWidget):
    """Tabs with a Delete button in the corner while a table that offers to delete is visible."""

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
        action = page.delete_action if isinstance(page, Table) else None
        if action is not None:
            for former in self._delete.actions():  # else both are a menu, with an arrow
                self._delete.removeAction(former)
            self._delete.setDefaultAction(action)
        self._delete.setVisible(action is not None)
