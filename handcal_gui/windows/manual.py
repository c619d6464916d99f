"""The manual: the pages of documentation that are shipped with the program, without a network."""

from __future__ import annotations

import re

from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QImage, QTextCursor, QTextDocument
from PySide6.QtWidgets import QTextBrowser, QWidget

from handcal.io.resources import resource_path

_SIZE_PX = 900, 750
_WIDEST_PX = 820
"""Width to which wider pictures are reduced."""
_PAGES = (".md", ".py", ".proto")


class Manual(QTextBrowser):
    """A window that shows pages in Markdown, with their links and pictures.

    Backspace and Alt+Left go back. Pages of the web open in the web browser.
    """

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setWindowFlag(Qt.WindowType.Window)
        self.setWindowTitle("Manual")
        self.setObjectName("manual")
        self.setOpenExternalLinks(True)
        self.resize(*_SIZE_PX)

    def open(self, page: str) -> None:
        """Show a shipped page, such as ``docs/guide.md``.

        Raises
        ------
        FileError
            If the installation is damaged.
        """
        self.setSource(QUrl.fromLocalFile(str(resource_path(page))))
        self.show()
        self.raise_()
        self.activateWindow()

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
        heading = url.fragment(QUrl.ComponentFormattingOption.FullyDecoded)
        block = self.document().begin()
        while heading and block.isValid():
            if block.blockFormat().headingLevel() and _anchor(block.text()) == heading:
                self.setTextCursor(QTextCursor(self.document().lastBlock()))
                self.setTextCursor(QTextCursor(block))
                return
            block = block.next()

    def loadResource(self, kind: int, name: QUrl | str) -> object:
        """Return a page or a picture; a wide picture is reduced."""
        if kind != QTextDocument.ResourceType.ImageResource.value:
            return super().loadResource(kind, name)
        image = QImage(self.source().resolved(QUrl(name)).toLocalFile())
        if image.width() <= _WIDEST_PX:
            return image
        return image.scaledToWidth(_WIDEST_PX, Qt.TransformationMode.SmoothTransformation)


def _anchor(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
