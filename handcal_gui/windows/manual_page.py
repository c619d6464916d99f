"""A page of the manual, with its links and pictures."""

from __future__ import annotations

import re
from pathlib import Path

from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import (
    QColor,
    QImage,
    QPainter,
    QTextBlock,
    QTextCharFormat,
    QTextCursor,
    QTextDocument,
)
from PySide6.QtWidgets import QTextBrowser, QTextEdit, QWidget

from handcal_gui.theme import colors, follow_theme, is_dark
from handcal_gui.widgets.drawing import themed_drawing

_BESIDE_PX = 50
"""Room beside the widest picture."""
_DIMMED = 0.25
"""Share of the light that a picture of the light window loses on a dark page."""
_MARKED = 0.3
"""Opacity of the ground of the words searched for."""
_PAGES = (".md", ".py", ".proto")
_DIRECTIVE = re.compile(r"^::: (\S+)$", re.MULTILINE)
"""Place of a function's description in a web page."""


class ManualPage(QTextBrowser):
    """Shows pages in Markdown, with their links and pictures.

    Backspace and Alt+Left go back. Pages of the web open in the web browser.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("manualPage")
        self.setOpenExternalLinks(True)
        self._words: re.Pattern[str] | None = None
        follow_theme(self, self._load_again)

    def mark(self, words: re.Pattern[str] | None) -> None:
        """Mark words wherever they are, in this page and in those shown later."""
        self._words = words
        marked, shade = [], QTextCharFormat()
        ground = QColor(colors().live)
        ground.setAlphaF(_MARKED)
        shade.setBackground(ground)
        block = self.document().begin()
        while words is not None and block.isValid():
            for match in words.finditer(block.text()):
                one = QTextEdit.ExtraSelection()
                one.cursor, one.format = _cursor(block, match), shade
                marked.append(one)
            block = block.next()
        self.setExtraSelections(marked)

    def go_to_mark(self) -> None:
        """Select the first word marked from the text cursor on."""
        block = self.textCursor().block()
        while self._words is not None and block.isValid():
            if match := self._words.search(block.text()):
                self.setTextCursor(_cursor(block, match))
                return
            block = block.next()

    def go_to(self, block: QTextBlock) -> None:
        """Scroll until a block is at the top."""
        self.setTextCursor(QTextCursor(self.document().lastBlock()))
        self.setTextCursor(QTextCursor(block))

    def doSetSource(
        self,
        name: QUrl | str,
        /,
        type: QTextDocument.ResourceType = QTextDocument.ResourceType.UnknownResource,  # noqa: A002
    ) -> None:
        """Show a page, from the heading that the link names, as GitHub writes it."""
        url = QUrl(name)
        target = self.source().resolved(url)
        if target.isLocalFile() and not target.path().endswith(_PAGES):
            return  # a picture or a folder would replace the page
        super().doSetSource(url, type)
        self.mark(self._words)
        heading = url.fragment(QUrl.ComponentFormattingOption.FullyDecoded)
        block = self.document().begin()
        while heading and block.isValid():
            if block.blockFormat().headingLevel() and _anchor(block.text()) == heading:
                self.go_to(block)
                return
            block = block.next()

    def loadResource(self, kind: int, name: QUrl | str) -> object:
        """Return a page or a picture; a wide picture is reduced, a drawing has the theme's colours.

        In dark themes, photographs and pictures of the light window are dimmed and framed.
        """
        path = Path(self.source().resolved(QUrl(name)).toLocalFile())
        if kind == QTextDocument.ResourceType.MarkdownResource.value and path.is_file():
            return markdown_of(path)
        if kind != QTextDocument.ResourceType.ImageResource.value:
            return super().loadResource(kind, name)
        is_drawing = path.suffix == ".svg" and path.is_file()
        image = QImage.fromData(themed_drawing(path)) if is_drawing else QImage(str(path))
        widest_px = self.width() - _BESIDE_PX
        if image.width() > widest_px:
            image = image.scaledToWidth(widest_px, Qt.TransformationMode.SmoothTransformation)
        is_light = not is_drawing and not image.isNull()
        return _dimmed(image) if is_light and is_dark() else image

    def _load_again(self) -> None:
        """Load the page with its pictures in the colours of the theme."""
        if self.source().isEmpty():
            return
        place = self.verticalScrollBar().value()
        self.reload()
        self.verticalScrollBar().setValue(place)


def _cursor(block: QTextBlock, match: re.Match[str]) -> QTextCursor:
    """Return a cursor that selects what matches in a block."""
    cursor = QTextCursor(block)
    cursor.setPosition(block.position() + match.start())
    cursor.setPosition(block.position() + match.end(), QTextCursor.MoveMode.KeepAnchor)
    return cursor


def _dimmed(image: QImage) -> QImage:
    """Return a light picture for a dark page: with less glare, and an edge where it is dark."""
    image = image.convertToFormat(QImage.Format.Format_RGB32)
    painter = QPainter(image)
    painter.fillRect(image.rect(), QColor(0, 0, 0, round(255 * _DIMMED)))
    painter.setPen(QColor(colors().muted))
    painter.drawRect(image.rect().adjusted(0, 0, -1, -1))
    painter.end()
    return image


def markdown_of(page: Path) -> str:
    """Return the text of a page; Python's own help has what only the web page describes."""
    text = page.read_text("utf-8")
    return _DIRECTIVE.sub(r"`\1`, described by `help(\1)` in Python", text)


def _anchor(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
