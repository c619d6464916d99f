"""A tab bar that cuts no letters."""

from __future__ import annotations

from PySide6.QtCore import QMargins, QSize
from PySide6.QtWidgets import QStyle, QTabBar


class TabBar(QTabBar):
    """A tab bar with room for its texts: Qt lowers those not in front, and cuts their last pixels.

    A style sheet would do so, too, but keep the colours of the tabs' pages after a change of theme.
    """

    def tabSizeHint(self, index: int) -> QSize:
        """Return Qt's size of a tab, higher by as much as its text is lowered."""
        lowered_px = self.style().pixelMetric(QStyle.PixelMetric.PM_TabBarTabShiftVertical)
        return super().tabSizeHint(index).grownBy(QMargins(0, 0, 0, lowered_px))
