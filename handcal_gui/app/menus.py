"""The menus Edit and Help."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from html import escape
from importlib.metadata import version

from PySide6.QtCore import QSize
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QDialog, QMessageBox, QTextBrowser, QWidget

from handcal.core.errors import FileError
from handcal.io.resources import resource_path
from handcal_gui.app.keys import keys_by_group, panel_title
from handcal_gui.app.manual import show_manual
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.window import MainWindow
from handcal_gui.widgets.layouts import vbox
from handcal_gui.widgets.opening import open_path

_EDITS = {
    "undo": tr("&Undo"),
    "redo": tr("&Redo"),
    "copy": tr("&Copy"),
    "delete": tr("&Delete"),
}
"""Entries of Edit, by the object names of the panels' actions."""
_KEYS_SIZE = QSize(80 * SPACING_PX, 60 * SPACING_PX)


def add_edit_menu(window: MainWindow, find: Callable[[], object]) -> None:
    """Let the Edit menu offer what can be undone, copied or deleted in the panels in sight.

    Parameters
    ----------
    window : MainWindow
    find : callable
        Searches the stored sessions.
    """
    menu = window.menus["Edit"]
    search = window.add_action("Edit", tr("&Find in sessions…"), "Ctrl+F", find)
    search.setWhatsThis(tr("Find in sessions, or go to the search field of the window in front"))

    def offer() -> None:
        menu.clear()
        for action in window.findChildren(QAction):
            owner = action.parent()
            is_offered = action.objectName() in _EDITS and action.isEnabled()
            if is_offered and isinstance(owner, QWidget) and owner.isVisible():
                menu.addAction(_edit_text(action), action.trigger)
        menu.addSeparator()
        menu.addAction(search)

    menu.aboutToShow.connect(offer)


def _edit_text(action: QAction) -> str:
    """Return what an action does, in which panel, and its key there."""
    where = panel_title(action) or action.text()
    key = action.shortcut().toString(QKeySequence.SequenceFormat.NativeText)
    return f"{_EDITS[action.objectName()]}: {where}\t{key}"  # after a tab, it is only shown


def add_help_menu(window: MainWindow, support: Callable[[], object]) -> None:
    """Fill the Help menu of a window.

    Parameters
    ----------
    window : MainWindow
    support : callable
        Opens the dialog that writes a support bundle.
    """
    add, read = window.add_action, partial(read_manual, window)
    add("Help", tr("&Guide"), "Shift+F1", lambda: read("docs/guide.md"))
    add("Help", tr("&Manual"), "", lambda: read("docs/index.md"))
    add("Help", tr("Headset &protocol"), "", lambda: read("docs/protocol.md"))
    add("Help", tr("&Examples in Python"), "", lambda: _show_folder(window, "examples"))
    add("Help", tr("&Unity package"), "", lambda: _show_folder(window, "unity"))
    add("Help", tr("&Support bundle…"), "", support)
    add("Help", tr("&Keys"), "F1", lambda: show_keys(window))
    add("Help", tr("&Licences"), "", lambda: read("THIRD-PARTY.md"))
    add("Help", tr("&About handcal"), "", lambda: _show_about(window))


def show_keys(window: MainWindow) -> QDialog:
    """List all keys beside the window, which stays usable."""
    dialog = window.findChild(QDialog, "keysDialog")
    if not isinstance(dialog, QDialog):
        dialog = QDialog(window)
        dialog.setObjectName("keysDialog")
        dialog.setWindowTitle(tr("Keys"))
        dialog.resize(window.screen().availableSize().boundedTo(_KEYS_SIZE))
        vbox(QTextBrowser(), on=dialog, margins=SPACING_PX)
    text = dialog.findChild(QTextBrowser)
    assert isinstance(text, QTextBrowser)
    text.setHtml(keys_html(window))
    dialog.show()
    return dialog


def keys_html(window: MainWindow) -> str:
    """Return the keys of a window as tables, one for each place where they work."""
    tables = []
    for name, group in keys_by_group(window).items():
        rows = "".join(
            f"<tr><td width='35%'><b>{escape(keys)}</b></td><td>{escape(meaning)}</td></tr>"
            for keys, meaning in group.rows
        )
        heading = f"<h4>{escape(name)}: {escape(group.where)}</h4>"
        tables.append(f"{heading}<table width='100%'>{rows}</table>")
    return "".join(tables)


def read_manual(window: MainWindow, page: str) -> None:
    """Show a page of the manual, or the reason why it cannot be shown."""
    try:
        show_manual(window, page)
    except FileError as error:
        window.banner.show_message(str(error))


def _show_folder(window: MainWindow, name: str) -> None:
    try:
        folder = resource_path(name)
    except FileError as error:
        window.banner.show_message(str(error))
        return
    open_path(window, folder)


def _show_about(window: MainWindow) -> None:
    QMessageBox.about(
        window,
        tr("About handcal"),
        tr(
            "<b>handcal {}</b><p>Calibrates an optical see-through headset with the "
            "wearer's bare hand, after X. Hu, F. Rodriguez y Baena and F. Cutolo, ISMAR "
            "2021.<p>Apache-2.0"
        ).format(version("handcal")),
    )
