"""A label for a changing number that does not move what is beside it."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel

from handcal_gui.theme import number_font

UNKNOWN = "–"


class NumberLabel(QLabel):
    """Right-aligned, in digits of one width, as wide as its widest text; a dash at first.

    Parameters
    ----------
    name : str
        Object name.
    widest : str
        The widest text it is made for, with its unit.
    tooltip : str
        What the number means.
    scale : float
        Size of the digits, relative to text.
    """

    def __init__(self, name: str, widest: str, tooltip: str, scale: float = 1.0) -> None:
        super().__init__(UNKNOWN)
        self.setObjectName(name)
        self.setToolTip(tooltip)
        self.setFont(number_font(scale))
        self.setMinimumWidth(self.fontMetrics().horizontalAdvance(widest))
        self.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
