"""The guide, read offline from the pages that are installed with the program."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QDesktopServices, QImage, QTextDocument
from PySide6.QtWidgets import QDialog, QLineEdit, QTextBrowser, QWidget

from handcal.io.resources import documentation_path
from handcal_gui.theme import SPACING_PX
from handcal_gui.widgets.fields import button, with_name
from handcal_gui.widgets.layouts import hbox, vbox

_WEB = ("http", "https", "mailto")
_PICTURE_PX = 620


class GuideDialog(QDialog):
    """Shows the guide, follows its links to other pages, and searches the page shown.

    Raises
    ------
    FileError
        If the guide is not installed.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("guideDialog")
        self.setWindowTitle("Guide")
        self._home = QUrl.fromLocalFile(str(documentation_path("guide.md")))
        self._page = _Page(self._home)
        self._search = with_name(QLineEdit(), "searchGuide", "Search this page")
        self._search.setPlaceholderText("Search this page")
        self._search.setClearButtonEnabled(True)
        self._search.returnPressed.connect(self._find)
        back = button("back", "Back")
        home = button("guide", "Guide", "The first page of the guide")
        close = button("close", "Close")
        for one in (back, home, close):
            one.setAutoDefault(False)
        back.setEnabled(False)
        self._page.backwardAvailable.connect(back.setEnabled)
        back.clicked.connect(self._page.backward)
        home.clicked.connect(lambda: self._page.go(self._home))
        close.clicked.connect(self.accept)
        vbox(
            hbox(back, home, (self._search, 1), spacing=SPACING_PX),
            (self._page, 1),
            hbox(1, close),
            on=self,
            margins=2 * SPACING_PX,
            spacing=SPACING_PX,
        )
        self.resize(90 * SPACING_PX, 80 * SPACING_PX)

    def _find(self) -> None:
        """Go to the next place that has the text, from the top after the last."""
        text = self._search.text()
        if text and not self._page.find(text):
            self._page.moveCursor(self._page.textCursor().MoveOperation.Start)
            self._page.find(text)


class _Page(QTextBrowser):
    """A page of the documentation; links to the web are left to the browser."""

    def __init__(self, home: QUrl) -> None:
        super().__init__()
        self.setObjectName("guidePage")
        self.setAccessibleName("Guide")
        self.setOpenLinks(False)
        self.anchorClicked.connect(self._follow)
        self.go(home)

    def go(self, page: QUrl) -> None:
        """Show a page."""
        self.setSource(page, QTextDocument.ResourceType.MarkdownResource)

    def loadResource(self, kind: int, name: QUrl | str) -> object:
        """Return a picture no wider than the window, or a page."""
        if kind != QTextDocument.ResourceType.ImageResource.value:
            return super().loadResource(kind, name)
        image = QImage(self.source().resolved(QUrl(name)).toLocalFile())
        if image.width() <= _PICTURE_PX:
            return image
        ratio = self.devicePixelRatioF()
        width = min(image.width(), round(ratio * _PICTURE_PX))
        scaled = image.scaledToWidth(width, Qt.TransformationMode.SmoothTransformation)
        scaled.setDevicePixelRatio(width / _PICTURE_PX)
        return scaled

    def _follow(self, link: QUrl) -> None:
        target = self.source().resolved(link)
        file = Path(target.toLocalFile())
        if target.scheme() in _WEB:
            QDesktopServices.openUrl(target)
        elif file.suffix == ".md" and file.is_file():
            self.go(QUrl.fromLocalFile(str(file)))
