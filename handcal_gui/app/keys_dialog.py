"""The dialog with all keys, by the place where they work."""

from __future__ import annotations

from html import escape

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QPagedPaintDevice, QTextDocument
from PySide6.QtWidgets import (
    QDialog,
    QHeaderView,
    QLineEdit,
    QMainWindow,
    QTreeWidget,
    QTreeWidgetItem,
)

from handcal_gui.app.keys import KeyGroup, add_action, keys_by_group
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import button, paragraph, with_name
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.printing import ask_printer

_FIRST_SIZE = QSize(80 * SPACING_PX, 60 * SPACING_PX)
_KEYS, _MEANING = range(2)


class KeysDialog(QDialog):
    """Lists the keys of a window; those that contain the words typed, if there are any.

    Parameters
    ----------
    window : QMainWindow
    """

    def __init__(self, window: QMainWindow) -> None:
        super().__init__(window)
        self.setObjectName("keysDialog")
        self.setWindowTitle(tr("Keys"))
        self._groups = keys_by_group(window)
        search = with_name(
            QLineEdit(placeholderText=tr("Search (Ctrl+F)"), clearButtonEnabled=True),
            "keysSearch",
            tr("Search the keys"),
        )
        self._none = paragraph("noKeys", tr("No key contains these words."))
        self._none.hide()
        self._list = _list(self._groups)
        ask = button(
            "printKeys", tr("&Print…"), help_text=tr("Print all keys, or save them as PDF")
        )
        close = button("close", tr("&Close"))
        close.setDefault(True)
        search.textChanged.connect(self._search)
        ask.clicked.connect(lambda: ask_printer(self, self.print_to))
        close.clicked.connect(self.accept)
        add_action(self, tr("Search the keys"), "Ctrl+F", search.setFocus)
        vbox(
            paragraph("keysMeaning", tr("All keys, grouped by where they work.")),
            search,
            (self._list, 1),
            (self._none, 1),
            hbox(ask, 0, close, spacing=SPACING_PX),
            on=self,
            margins=2 * SPACING_PX,
            spacing=SPACING_PX,
        )
        self.resize(self.screen().availableSize().boundedTo(_FIRST_SIZE))

    def print_to(self, printer: QPagedPaintDevice) -> None:
        """Print all keys."""
        document = QTextDocument()
        document.setHtml(keys_html(self._groups))
        document.print_(printer)

    def _search(self, typed: str) -> None:
        words = typed.casefold().split()
        is_any = False
        for i in range(self._list.topLevelItemCount()):
            group = self._list.topLevelItem(i)
            assert group is not None
            rows = [row for k in range(group.childCount()) if (row := group.child(k)) is not None]
            for row in rows:
                text = f"{group.text(_KEYS)} {row.text(_KEYS)} {row.text(_MEANING)}".casefold()
                row.setHidden(not all(word in text for word in words))
            group.setHidden(all(row.isHidden() for row in rows))
            is_any |= not group.isHidden()
        self._list.setVisible(is_any)
        self._none.setVisible(not is_any)


def _list(groups: dict[str, KeyGroup]) -> QTreeWidget:
    tree = with_name(QTreeWidget(), "keys", tr("Keys"))
    tree.setHeaderLabels([tr("Key"), tr("Effect")])
    tree.setRootIsDecorated(False)
    tree.setItemsExpandable(False)
    tree.setIndentation(0)
    tree.header().setSectionResizeMode(_KEYS, QHeaderView.ResizeMode.ResizeToContents)
    bold = tree.font()
    bold.setBold(True)
    for name, group in groups.items():
        heading = QTreeWidgetItem(tree, [f"{name}: {group.where}"])
        heading.setFont(_KEYS, bold)
        heading.setFlags(Qt.ItemFlag.ItemIsEnabled)
        heading.setFirstColumnSpanned(True)
        heading.setExpanded(True)
        for row in group.rows:
            QTreeWidgetItem(heading, list(row))
    return tree


def keys_html(groups: dict[str, KeyGroup]) -> str:
    """Return the keys as tables, one for each group."""
    tables = []
    for name, group in groups.items():
        rows = "".join(
            f"<tr><td width='35%'><b>{escape(keys)}</b></td><td>{escape(meaning)}</td></tr>"
            for keys, meaning in group.rows
        )
        heading = f"<h4>{escape(name)}: {escape(group.where)}</h4>"
        tables.append(f"{heading}<table width='100%'>{rows}</table>")
    return f"<h2>handcal: {tr('Keys')}</h2>{''.join(tables)}"
