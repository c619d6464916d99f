"""The manual: the pages of documentation that are shipped with the program, without a network."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QModelIndex, QSize, Qt, QTimer, QUrl
from PySide6.QtGui import QAction, QKeyEvent, QTextBlock, QTextCursor, QTextDocument
from PySide6.QtWidgets import (
    QLabel,
    QLineEdit,
    QSplitter,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

from handcal.io.resources import resource_path
from handcal_gui.app.keys import add_action, native
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.manual.excerpts import Excerpts, pattern_of
from handcal_gui.manual.page import FULL_SIZE, ManualPage, markdown_of
from handcal_gui.widgets.fields import button, tool_button, with_name
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.placement import keep_on_screen

_FIRST_SIZE = QSize(1000, 750)
_CONTENTS_PX, _PAGE_PX = 220, 660
"""Least widths; wider contents show the titles whole."""
_BESIDE_TITLES_PX = 4 * SPACING_PX
"""Room for the edges of the contents and their scroll bar."""
_FOUND_PX = 230
_PAGE_CHARACTERS, _SECTION_CHARACTERS = 24, 40
"""That fit in a line of the lines found, beside their text."""
_SETTLE_MS = 300
"""From the last letter typed until the first line found is shown: a page takes 0.1 to 0.3 s."""
_MOST_FOUND = 200
_GUIDE = "guide.md"
_CHOOSE = tr("Choose a page, or search all")
_NOTHING = tr("Nothing found: search for fewer or other words")
_LINK = re.compile(r"\]\(([\w-]+\.md)")


@dataclass(frozen=True, slots=True)
class Line:
    """A line of the manual: a paragraph, an item of a list, or a row of a table."""

    page: Path
    title: str
    """First heading of the page."""
    section: str
    """Heading above the line."""
    text: str
    block: int
    """Number of the line's first block in the page's document."""
    level: int
    """Level of a heading, 1 for the page's title; 0 for other lines."""


def read_lines(folder: Path) -> list[Line]:
    """Return all lines of the pages in a folder."""
    return [line for page in sorted(folder.glob("*.md")) for line in _lines(page)]


def find_lines(lines: Iterable[Line], words: str) -> list[Line]:
    """Return the lines that contain all words; none without words.

    Headings come first, then the user guide, then the others in their order.
    """
    wanted = words.casefold().split()
    found = [one for one in lines if wanted and all(word in one.text.casefold() for word in wanted)]
    return sorted(found, key=lambda line: (line.text != line.section, line.page.name != _GUIDE))


def in_reading_order(lines: Iterable[Line], start: Path) -> list[Line]:
    """Return the lines of a page, then of the pages that it links to in order, then all others.

    Parameters
    ----------
    lines : iterable of Line
    start : Path
        The page with the links.
    """
    names = [start.name, *_LINK.findall(start.read_text("utf-8"))]
    return sorted(lines, key=lambda line: [*names, line.page.name].index(line.page.name))


class Manual(QWidget):
    """A window with the pages of the manual, their contents, and a search over all of them.

    Attributes
    ----------
    page : ManualPage
    contents : QTreeWidget
        The pages with their sections, those of the page shown unfolded.
    search : QLineEdit
    found : QTreeWidget
        The lines found; hidden without a search.
    """

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent, Qt.WindowType.Window)
        self.setWindowTitle(tr("Manual"))
        self.setObjectName("manual")
        self.resize(self.screen().availableSize().boundedTo(_FIRST_SIZE))
        self.page = ManualPage(self)
        self.search = with_name(
            QLineEdit(placeholderText=tr("Search all pages (Ctrl+F)"), clearButtonEnabled=True),
            "manualSearch",
            tr("Search all pages"),
        )
        self.found = with_name(QTreeWidget(), "manualFound", tr("Lines found"))
        self.found.setRootIsDecorated(False)
        self.found.setHeaderLabels([tr("Page"), tr("Section"), tr("Line")])
        self.found.setMaximumHeight(_FOUND_PX)
        self._excerpts = Excerpts(self.found)
        self.found.setItemDelegateForColumn(2, self._excerpts)
        self.found.hide()
        self.contents = with_name(QTreeWidget(), "manualContents", tr("Contents"))
        self.contents.setHeaderHidden(True)
        self._parts = QSplitter()
        self._pages: dict[Path, QTreeWidgetItem] = {}
        self._count = QLabel(_CHOOSE)
        self._lines: list[Line] = []
        self._shown: list[Line] = []
        self._settle = QTimer(self, interval=_SETTLE_MS, singleShot=True)
        self._settle.timeout.connect(self._show_next)
        back = self._turn(tr("Back"), "←", "Alt+Left", self.page.backward)
        forward = self._turn(tr("Forward"), "→", "Alt+Right", self.page.forward)
        self.page.backwardAvailable.connect(back.setEnabled)
        self.page.forwardAvailable.connect(forward.setEnabled)
        turns = tool_button(back), tool_button(forward)
        close = button("manualClose", tr("Cl&ose"))
        close.clicked.connect(self.close)
        row = *turns, (self.search, 1), self._count, close
        vbox(
            hbox(*row, spacing=SPACING_PX),
            self.found,
            (self._lay_out_pages(), 1),
            on=self,
            margins=SPACING_PX,
            spacing=SPACING_PX,
        )
        self.search.textChanged.connect(self._search)
        self.search.returnPressed.connect(self._show_next)
        self.found.itemClicked.connect(self._show_current)
        self.found.itemActivated.connect(self._show_current)
        self.contents.itemClicked.connect(self._show_chosen)
        self.contents.itemActivated.connect(self._show_chosen)
        self.page.sourceChanged.connect(self._mark_page)
        add_action(self, tr("Search all pages"), "Ctrl+F", self._begin_search)

    def open(self, page: str) -> None:
        """Show a shipped page, such as ``docs/guide.md``, or ``docs/guide.md#keys`` of it.

        Raises
        ------
        FileError
            If the installation is damaged.
        """
        if not self._lines:
            lines = read_lines(resource_path("docs"))
            self._lines = in_reading_order(lines, resource_path("docs/index.md"))
            self._list_pages()
            above = self.parentWidget() or self
            self.move(above.frameGeometry().center() - self.rect().center())
        self.show()  # first, as pictures are no wider than the page
        file, _, heading = page.partition("#")
        url = QUrl.fromLocalFile(str(resource_path(file)))
        url.setFragment(heading)
        self.page.setSource(url)
        keep_on_screen(self)
        self.raise_()
        self.activateWindow()
        self.page.setFocus()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """End the search with Esc, or close the window without one."""
        if event.key() == Qt.Key.Key_Escape and self.search.text():
            self.search.clear()
        elif event.key() == Qt.Key.Key_Escape:
            self.close()
        else:
            super().keyPressEvent(event)

    def _turn(self, text: str, sign: str, keys: str, do: Callable[[], None]) -> QAction:
        """Return an action that turns to a page shown before, or back."""
        action = add_action(self, text, keys, do, tooltip=f"{text} ({native(keys)})")
        action.setIconText(sign)
        action.setEnabled(False)
        return action

    def _lay_out_pages(self) -> QSplitter:
        label = QLabel(tr("&Contents"))
        label.setBuddy(self.contents)
        beside, parts = QWidget(), self._parts
        vbox(label, (self.contents, 1), on=beside, margins=0, spacing=SPACING_PX // 2)
        for part in (beside, self.page):
            parts.addWidget(part)
        parts.setStretchFactor(1, 1)
        return parts

    def _list_pages(self) -> None:
        """List the pages and their sections."""
        for line in self._lines:
            if line.level in (1, 2):
                parent = self.contents if line.level == 1 else self._pages[line.page]
                item = QTreeWidgetItem(parent, [line.text])
                item.setToolTip(0, line.text)
                item.setData(0, Qt.ItemDataRole.UserRole, line)
                self._pages.setdefault(line.page, item)
        titles_px = self.contents.sizeHintForColumn(0) + _BESIDE_TITLES_PX
        contents_px = max(_CONTENTS_PX, min(titles_px, self.width() - _PAGE_PX))
        self._parts.setSizes([contents_px, self.width() - contents_px])

    def _mark_page(self, url: QUrl) -> None:
        """Mark the page shown in the contents, and unfold its sections only."""
        shown = self._pages.get(Path(url.toLocalFile()))
        for item in self._pages.values():
            item.setExpanded(item is shown)
        current = self.contents.currentItem()
        if shown is None:
            self.contents.setCurrentIndex(QModelIndex())
        elif current is None or shown not in (current, current.parent()):
            self.contents.setCurrentItem(shown)

    def _show_chosen(self, item: QTreeWidgetItem) -> None:
        self._show_line(item.data(0, Qt.ItemDataRole.UserRole))
        self.page.setFocus()

    def _begin_search(self) -> None:
        self.search.setFocus()
        self.search.selectAll()

    def _search(self, words: str) -> None:
        """List the lines that contain the words typed."""
        found = find_lines(self._lines, words)
        self._shown = found[:_MOST_FOUND]
        self._excerpts.words = pattern_of(words)
        self.page.mark(self._excerpts.words)
        self.found.clear()
        for line in self._shown:
            title = textwrap.fill(line.title, _PAGE_CHARACTERS)
            section = textwrap.fill(line.section, _SECTION_CHARACTERS)
            item = QTreeWidgetItem(self.found, [title, section, line.text])
            item.setToolTip(2, line.text)
        for column in (0, 1):
            self.found.resizeColumnToContents(column)
        self.found.setVisible(bool(found))
        most = tr(", the first {} listed").format(_MOST_FOUND) if len(found) > _MOST_FOUND else ""
        count = pluralize(len(found), tr("line found"), tr("lines found")) if found else _NOTHING
        self._count.setText(f"{count}{most}" if words.split() else _CHOOSE)
        self._settle.start()

    def _show_next(self) -> None:
        """Show the next line found, after the last the first."""
        self._settle.stop()
        if self._shown:
            following = (self.found.currentIndex().row() + 1) % len(self._shown)
            self.found.setCurrentIndex(self.found.model().index(following, 0))
            self._show_current()

    def _show_current(self) -> None:
        self._show_line(self._shown[self.found.currentIndex().row()])
        self.page.go_to_mark()

    def _show_line(self, line: Line) -> None:
        url = QUrl.fromLocalFile(str(line.page))
        url.setFragment(f"line-{line.block}")  # or Back leads from a line past others of its page
        self.page.setSource(url)
        self.page.go_to(self.page.document().findBlockByNumber(line.block))


def _lines(page: Path) -> Iterator[Line]:
    """Yield the lines of a page; the cells of a table's row are one."""
    document = QTextDocument()
    document.setMarkdown(markdown_of(page))
    blocks: dict[object, list[QTextBlock]] = {}
    block = document.begin()
    while block.isValid():
        cursor = QTextCursor(block)
        table = cursor.currentTable()
        row = table and (table.firstPosition(), table.cellAt(cursor).row())
        blocks.setdefault(row or block.blockNumber(), []).append(block)
        block = block.next()
    title = section = ""
    for line in blocks.values():
        text = " · ".join(one.text() for one in line if one.text())
        if level := line[0].blockFormat().headingLevel():
            section = text
            title = title or text
        if text and text != FULL_SIZE:
            yield Line(page, title, section, text, line[0].blockNumber(), level)
