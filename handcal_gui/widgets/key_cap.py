"""A label that shows a key."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel

from handcal_gui.app.keys import native
from handcal_gui.app.theme import SPACING_PX, scale_font, set_style
from handcal_gui.widgets.fields import with_name


class KeyCap(QLabel):
    """Shows one of several keys, drawn like a key, always as wide as the widest.

    Parameters
    ----------
    name : str
    keys : str
        The first is shown at first.
    """

    def __init__(self, name: str, *keys: str) -> None:
        super().__init__(alignment=Qt.AlignmentFlag.AlignCenter)
        with_name(self, name)
        set_style(
            self,
            "color: palette(placeholder-text); border: 1px solid palette(placeholder-text);"
            " border-bottom-width: 3px; border-radius: 4px; padding: 0;",
        )
        scale_font(self, 0.9)
        widest = max(self.fontMetrics().horizontalAdvance(native(one)) for one in keys)
        self.setFixedSize(widest + 2 * SPACING_PX, 3 * SPACING_PX)
        self.show_key(keys[0])

    def show_key(self, keys: str) -> None:
        """Show another key."""
        self.setText(native(keys))
