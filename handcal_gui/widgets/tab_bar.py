"""A tab bar that cuts no letters."""

from __future__ import annotations

from PySide6.QtCore import QSize
from PySide6.QtWidgets import QTabBar

from handcal_gui.theme import font_px


class TabBar(QTabBar):
    """A tab bar with the height of its text: Qt cuts the lowest pixels of tabs not in front.

    A style sheet would do so, too, but keep the colours of the tabs' pages after a change of theme.
    """

    def tabSizeHint(self, index: int) -> QSize:
        """Return Qt's size of a tab, made higher."""
        return super().tabSizeHint(index).expandedTo(QSize(0, 2 * font_px()))
