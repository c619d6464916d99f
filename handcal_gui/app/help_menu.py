"""The Help menu: the manual, examples, keys, licences, and what the program is."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.metadata import version

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMessageBox

from handcal.core.errors import FileError
from handcal.io.resources import resource_path
from handcal_gui.app.keys_dialog import KeysDialog
from handcal_gui.app.manual import show_manual
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.window import MainWindow
from handcal_gui.widgets.opening import open_path
from handcal_gui.widgets.placement import keep_on_screen


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
    add("Help", tr("&Keys"), "F1", lambda: _show_keys(window))
    add("Help", tr("&Licences"), "", lambda: read("THIRD-PARTY.md"))
    add("Help", tr("&About handcal"), "", lambda: _show_about(window))


def _show_keys(window: MainWindow) -> None:
    for one in window.findChildren(KeysDialog):
        one.accept()
    dialog = KeysDialog(window)  # not modal: to be read while the keys are used
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    dialog.show()
    keep_on_screen(dialog)


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
