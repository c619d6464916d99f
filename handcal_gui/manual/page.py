"""A page of the manual, with its links and pictures."""

from __future__ import annotations

import re
from pathlib import Path

from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import (
    QColor,
    QImage,
    QPainter,
    QResizeEvent,
    QTextBlock,
    QTextCharFormat,
    QTextCursor,
    QTextDocument,
)
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QTextBrowser, QTextEdit, QWidget

from handcal_gui.app.theme import colors, follow_theme, is_dark
from handcal_gui.app.translation import tr
from handcal_gui.widgets.drawing import themed_drawing
from handcal_gui.widgets.layouts import fit_soon
from handcal_gui.widgets.opening import open_path

FULL_SIZE = tr("Full size")
"""Link below a picture."""
_BESIDE_PX = 50
"""Room beside the widest picture."""
_DIMMED = 0.25
"""Share of the light that a picture of the light window loses on a dark page."""
_MARKED = 0.3
"""Opacity of the ground of the words searched for."""
_SETTLED_MS = 100
_PAGES = (".md", ".py", ".proto")
_PICTURE = re.compile(r"^!\[.+\]\((\S+\.png)\)$", re.MULTILINE)
_DIRECTIVE = re.compile(r"^::: (\S+)$", re.MULTILINE)
"""Place of a function's description in a web page."""


class ManualPage(QTextBrowser):
    """Shows pages in Markdown, with their links and pictures.

    Backspace and Alt+Left go back. Pages of the web open in the web browser, and the full size of a
    picture in the system's program for it.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("manualPage")
        self.setOpenExternalLinks(True)
        self._words: re.Pattern[str] | None = None
        self._pictures: dict[QUrl, tuple[float, float]] = {}  # full width, and that shown
        self._place = 0, 0  # block at the top, and where it was; 0 if none was asked for
        self._fit_soon = fit_soon(self._fit_pictures, self)
        self.anchorClicked.connect(self._open_picture)
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
        self._place = block.blockNumber(), self.verticalScrollBar().value()

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
                self._fit_soon.start(_SETTLED_MS)  # Qt lays out the pictures above it later
                return
            block = block.next()

    def loadResource(self, kind: int, name: QUrl | str) -> object:
        """Return a page or a picture; a wide picture is reduced, a drawing has the theme's colours.

        On screens of high resolution, a picture is reduced by as much less, so that it is sharp.
        In dark themes, photographs and pictures of the light window are dimmed and framed.
        """
        path = Path(self.source().resolved(QUrl(name)).toLocalFile())
        if kind == QTextDocument.ResourceType.MarkdownResource.value and path.is_file():
            self._pictures.clear()  # of the page before
            self._place = 0, 0
            return markdown_of(path)
        if kind != QTextDocument.ResourceType.ImageResource.value:
            return super().loadResource(kind, name)
        is_drawing = path.suffix == ".svg" and path.is_file()
        ratio = self.devicePixelRatioF()
        image = _drawn(path, ratio) if is_drawing else QImage(str(path))
        if image.isNull():
            return image
        full_px = image.deviceIndependentSize().width()
        width_px = self._shown_px(full_px)
        if image.width() > ratio * width_px:
            smooth = Qt.TransformationMode.SmoothTransformation
            image = image.scaledToWidth(round(ratio * width_px), smooth)
        if is_dark() and not is_drawing:
            image = _dimmed(image)
        image.setDevicePixelRatio(image.width() / width_px)
        self._pictures[QUrl(name)] = full_px, width_px
        return image

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Give the pictures the page's new width, once it has stopped changing."""
        super().resizeEvent(event)
        if event.size().width() != event.oldSize().width():
            self._fit_soon.start(_SETTLED_MS)

    def _shown_px(self, full_px: float) -> float:
        return min(full_px, self.width() - _BESIDE_PX)

    def _fit_pictures(self) -> None:
        """Load a picture that has a new width, then the next: all at once would take 0.2 s."""
        for name, (full_px, shown_px) in self._pictures.items():
            if shown_px != self._shown_px(full_px):
                kind = QTextDocument.ResourceType.ImageResource.value
                self.document().addResource(kind, name, self.loadResource(kind, name))
                self.document().markContentsDirty(0, self.document().characterCount())
                self._fit_soon.start(0)
                return
        block, place = self._place
        if block and self.verticalScrollBar().value() == place:  # not scrolled since
            self.go_to(self.document().findBlockByNumber(block))

    def _open_picture(self, link: QUrl) -> None:
        target = self.source().resolved(link)
        if target.isLocalFile() and target.path().endswith(".png"):
            open_path(self, Path(target.toLocalFile()))

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


def _drawn(path: Path, ratio: float) -> QImage:
    """Return a drawing with a number of pixels for each of the window's."""
    drawing = QSvgRenderer(themed_drawing(path))
    image = QImage(drawing.defaultSize() * ratio, QImage.Format.Format_RGB32)
    painter = QPainter(image)
    drawing.render(painter)
    painter.end()
    image.setDevicePixelRatio(ratio)
    return image


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
    """Return the text of a page, with a link to the full size below each picture.

    Python's own help has what only the web page describes.
    """
    text = _PICTURE.sub(rf"\g<0>\n\n[{FULL_SIZE}](\1)", page.read_text("utf-8"))
    return _DIRECTIVE.sub(r"`\1`, described by `help(\1)` in Python", text)


def _anchor(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
