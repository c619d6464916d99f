"""The manual: the pages that are shipped with the program, with their links and a search."""

from __future__ import annotations

import re
from pathlib import Path

from PySide6.QtCore import QSignalBlocker, QSize, Qt, QUrl
from PySide6.QtGui import QDesktopServices, QImage, QTextCursor, QTextDocument
from PySide6.QtWidgets import (
    QApplication,
    QDialog,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QSplitter,
    QTextBrowser,
    QWidget,
)

from handcal.io.resources import resource_path
from handcal_gui.app.keys import add_action, native
from handcal_gui.app.theme import SPACING_PX, follow_theme
from handcal_gui.app.translation import tr
from handcal_gui.widgets.drawing import themed_drawing
from handcal_gui.widgets.fields import tool_button, with_name
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.opening import open_path

_FIRST_SIZE = QSize(1000, 750)
_CONTENTS_PX = 240
_BESIDE_PX = 50
"""Room beside the widest picture."""
_PAGES = (".md", ".py", ".proto")
_LINK = re.compile(r"\]\(([\w-]+\.md)")
_DIRECTIVE = re.compile(r"^::: (\S+)$", re.MULTILINE)
"""Place of a function's description in a web page."""


class ManualPage(QTextBrowser):
    """Shows a page in Markdown; other files and pages of the web open in the system's program."""

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("manualPage")
        self.setOpenLinks(False)
        self.anchorClicked.connect(self._open)
        follow_theme(self, self.reload)  # drawings have the colours of the theme

    def doSetSource(
        self,
        name: QUrl | str,
        /,
        type: QTextDocument.ResourceType = QTextDocument.ResourceType.UnknownResource,  # noqa: A002
    ) -> None:
        """Show a page, from the heading that the link names, as GitHub writes it."""
        super().doSetSource(name, type)
        wanted = QUrl(name).fragment(QUrl.ComponentFormattingOption.FullyDecoded)
        block = self.document().begin()
        while wanted and block.isValid():
            if block.blockFormat().headingLevel() and _anchor(block.text()) == wanted:
                self.moveCursor(QTextCursor.MoveOperation.End)
                self.setTextCursor(QTextCursor(block))
                return
            block = block.next()

    def loadResource(self, kind: int, name: QUrl | str) -> object:
        """Return a page, or a picture that is no wider than the page."""
        path = Path(self.source().resolved(QUrl(name)).toLocalFile())
        if kind == QTextDocument.ResourceType.MarkdownResource.value and path.is_file():
            described = r"`\1`, described by `help(\1)` in Python"
            return _DIRECTIVE.sub(described, path.read_text("utf-8"))
        if kind != QTextDocument.ResourceType.ImageResource.value or not path.is_file():
            return super().loadResource(kind, name)
        is_drawing = path.suffix == ".svg"
        image = QImage.fromData(themed_drawing(path)) if is_drawing else QImage(str(path))
        most_px = self.width() - _BESIDE_PX
        if image.width() > most_px:
            image = image.scaledToWidth(most_px, Qt.TransformationMode.SmoothTransformation)
        return image

    def _open(self, link: QUrl) -> None:
        target = self.source().resolved(link)
        if target.isLocalFile() and target.path().endswith(_PAGES):
            self.setSource(target)
        elif target.isLocalFile():
            open_path(self, Path(target.toLocalFile()))
        else:
            QDesktopServices.openUrl(target)


class Manual(QDialog):
    """A window with the pages of the manual, and a search over all of them.

    Attributes
    ----------
    page : ManualPage
    contents : QListWidget
        The pages; with a search, those that contain all its words.
    search : QLineEdit
    """

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("manual")
        self.setWindowTitle(tr("Manual"))
        self.resize(self.screen().availableSize().boundedTo(_FIRST_SIZE))
        self.page = ManualPage()
        self.contents = with_name(QListWidget(), "manualContents", tr("Contents"))
        self.search = with_name(
            QLineEdit(placeholderText=tr("Search all pages (Ctrl+F)"), clearButtonEnabled=True),
            "manualSearch",
            tr("Search all pages"),
        )
        for path in in_reading_order(resource_path("docs/index.md")):
            text = path.read_text("utf-8")
            item = QListWidgetItem(text.partition("\n")[0].removeprefix("# "), self.contents)
            item.setData(Qt.ItemDataRole.UserRole, path)
            item.setData(Qt.ItemDataRole.UserRole + 1, text.casefold())
        turns = []
        for text, sign, keys, do, is_possible in (
            (tr("Back"), "←", "Alt+Left", self.page.backward, self.page.backwardAvailable),
            (tr("Forward"), "→", "Alt+Right", self.page.forward, self.page.forwardAvailable),
        ):
            action = add_action(self, text, keys, do, tooltip=f"{text} ({native(keys)})")
            action.setIconText(sign)
            action.setEnabled(False)
            is_possible.connect(action.setEnabled)
            turns.append(tool_button(action))
        parts = QSplitter()
        parts.addWidget(self.contents)
        parts.addWidget(self.page)
        parts.setSizes([_CONTENTS_PX, self.width() - _CONTENTS_PX])
        top = hbox(*turns, (self.search, 1), spacing=SPACING_PX)
        vbox(top, (parts, 1), on=self, margins=SPACING_PX, spacing=SPACING_PX)
        self.search.textChanged.connect(self._list_found)
        self.search.returnPressed.connect(self.find_next)
        self.contents.currentItemChanged.connect(self._show_chosen)
        self.page.sourceChanged.connect(self._mark_page)
        add_action(self, tr("Search all pages"), "Ctrl+F", self.search.setFocus)

    def open_page(self, page: str) -> None:
        """Show a shipped page, such as ``docs/guide.md``, or ``docs/guide.md#keys`` of it.

        Raises
        ------
        FileError
            If the installation is damaged.
        """
        self.show()  # first, as pictures are no wider than the page
        file, _, heading = page.partition("#")
        url = QUrl.fromLocalFile(str(resource_path(file)))
        url.setFragment(heading)
        self.page.setSource(url)
        self.raise_()
        self.activateWindow()
        self.page.setFocus()

    def find_next(self) -> None:
        """Select the next place with the words searched for, in this page or in those after it."""
        words = self.search.text().strip()
        if not words or self.page.find(words):
            return
        rows = [row for row in range(self.contents.count()) if not self._item(row).isHidden()]
        if rows:
            here = self.contents.currentRow()
            self.contents.setCurrentRow(next((row for row in rows if row > here), rows[0]))
            self.page.moveCursor(QTextCursor.MoveOperation.Start)
            self.page.find(words)

    def _list_found(self, typed: str) -> None:
        words = typed.casefold().split()
        for row in range(self.contents.count()):
            text = self._item(row).data(Qt.ItemDataRole.UserRole + 1)
            self._item(row).setHidden(not all(word in text for word in words))

    def _show_chosen(self, item: QListWidgetItem | None) -> None:
        if item is not None:
            path = item.data(Qt.ItemDataRole.UserRole)
            self.page.setSource(QUrl.fromLocalFile(str(path)))

    def _mark_page(self, url: QUrl) -> None:
        """Mark the page shown in the contents."""
        shown = Path(self.page.source().resolved(url).toLocalFile())
        with QSignalBlocker(self.contents):
            for row in range(self.contents.count()):
                if self._item(row).data(Qt.ItemDataRole.UserRole) == shown:
                    self.contents.setCurrentRow(row)

    def _item(self, row: int) -> QListWidgetItem:
        return self.contents.item(row)


def show_manual(window: QWidget, page: str) -> Manual:
    """Show a page of the manual over a window.

    Over a window that blocks others, the manual is a part of that window, so that it can be used.

    Raises
    ------
    FileError
        If the installation is damaged.
    """
    parent = QApplication.activeModalWidget() or window
    manual = parent.findChild(Manual)
    if not isinstance(manual, Manual):
        manual = Manual(parent)
    manual.open_page(page)
    return manual


def in_reading_order(index: Path) -> list[Path]:
    """Return a page, those that it links to in order, then the others of its folder."""
    names = [index.name, *_LINK.findall(index.read_text("utf-8"))]
    pages = sorted(index.parent.glob("*.md"))
    return sorted(pages, key=lambda page: [*names, page.name].index(page.name))


def _anchor(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
