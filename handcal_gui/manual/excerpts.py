"""The words searched for in the manual, bold in excerpts of the lines found."""

from __future__ import annotations

import re

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QPointF, Qt
from PySide6.QtGui import QFont, QFontMetricsF, QPainter, QPalette, QTextCharFormat, QTextLayout
from PySide6.QtWidgets import QStyle, QStyledItemDelegate, QStyleOptionViewItem, QWidget

_BEFORE = 25
"""Characters shown before the first word found, where a line is too long."""


def pattern_of(words: str) -> re.Pattern[str] | None:
    """Return what matches any of some words in a text; None without words."""
    any_of = "|".join(map(re.escape, words.split()))
    return re.compile(any_of, re.IGNORECASE) if any_of else None


def excerpt(text: str, words: re.Pattern[str] | None) -> str:
    """Return a text from some words before the first one that was searched for."""
    first = words.search(text) if words else None
    start = text.rfind(" ", 0, max(0, first.start() - _BEFORE)) + 1 if first else 0
    return f"… {text[start:]}" if start else text


class Excerpts(QStyledItemDelegate):
    """Draws a line where the words searched for are, and these bold.

    Attributes
    ----------
    words : re.Pattern or None
    """

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.words: re.Pattern[str] | None = None

    def paint(
        self,
        painter: QPainter,
        option: QStyleOptionViewItem,
        index: QModelIndex | QPersistentModelIndex,
    ) -> None:
        """Draw the ground of a cell as Qt does, and the text on it."""
        self.initStyleOption(option, index)
        text, option.text = option.text, ""
        style = option.widget.style()
        style.drawControl(QStyle.ControlElement.CE_ItemViewItem, option, painter, option.widget)
        margin_px = style.pixelMetric(QStyle.PixelMetric.PM_FocusFrameHMargin) + 1
        room = option.rect.adjusted(margin_px, 0, -margin_px, 0)
        bold = QFont(option.font)
        bold.setBold(True)
        plain, wide = QFontMetricsF(option.font), QFontMetricsF(bold)
        found = "".join(self.words.findall(text)) if self.words else ""
        room_px = room.width() - wide.horizontalAdvance(found) + plain.horizontalAdvance(found)
        if plain.horizontalAdvance(text) > room_px:
            text = excerpt(text, self.words)
        text = plain.elidedText(text, Qt.TextElideMode.ElideRight, room_px)
        is_selected = bool(option.state & QStyle.StateFlag.State_Selected)
        role = QPalette.ColorRole.HighlightedText if is_selected else QPalette.ColorRole.Text
        painter.save()
        painter.setPen(option.palette.color(role))
        layout = self._layout(text, bold)
        top = room.y() + (room.height() - layout.boundingRect().height()) / 2
        layout.draw(painter, QPointF(room.x(), top))
        painter.restore()

    def _layout(self, text: str, bold: QFont) -> QTextLayout:
        """Return a text in one line, with the words in bold."""
        plain = QFont(bold)
        plain.setBold(False)
        layout = QTextLayout(text, plain)
        ranges = []
        for match in self.words.finditer(text) if self.words else ():
            one = QTextLayout.FormatRange()
            one.start, one.length = match.start(), len(match[0])
            one.format = QTextCharFormat()
            one.format.setFont(bold)
            ranges.append(one)
        layout.setFormats(ranges)
        layout.beginLayout()
        layout.createLine()
        layout.endLayout()
        return layout
