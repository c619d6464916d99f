"""The strip at the bottom of a window or dialog, with the main button at its right and the key."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QSizePolicy, QStackedWidget, QWidget

from handcal_gui.app.keys import add_action
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import MainButton
from handcal_gui.widgets.job_bar import JobBar
from handcal_gui.widgets.key_cap import KeyCap
from handcal_gui.widgets.layouts import hbox

_KEYS = "Ctrl+Return Ctrl+Enter"


def action_strip(
    main: MainButton, *others: QWidget, bar: JobBar | None = None, keys: str = _KEYS
) -> QWidget:
    """Lay out other widgets at the left, the progress of jobs, and the main button with its key.

    Parameters
    ----------
    main : MainButton
    *others : QWidget
    bar : JobBar, optional
    keys : str
        Press the main button from anywhere in the window; the first one is shown.
    """
    strip = _Strip(main)
    window = Qt.ShortcutContext.WindowShortcut
    meaning = tr("Press the large button")
    add_action(strip, meaning, keys, main.click, context=window).setAutoRepeat(False)
    key = KeyCap("mainKey", keys.split()[0])
    middle = [1] if bar is None else [(bar, 1)]
    hbox(*others, *middle, key, main, on=strip, margins=0, spacing=SPACING_PX)
    return strip


def one_of_strips(*mains: MainButton, keys: str) -> QStackedWidget:
    """Return main buttons with their key in one place, for one of them to be shown at a time."""
    strips = QStackedWidget()
    strips.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
    width_px = max(main.sizeHint().width() for main in mains)
    for main in mains:
        main.setMinimumWidth(width_px)
        strips.addWidget(action_strip(main, keys=keys))
    return strips


class _Strip(QWidget):
    """Makes the main button the dialog's default: Qt forgets what was set outside a dialog."""

    def __init__(self, main: MainButton) -> None:
        super().__init__()
        self._main = main

    def showEvent(self, event: QShowEvent) -> None:
        """Set the default before the dialog takes its first button instead."""
        super().showEvent(event)
        self._main.setDefault(False)
        self._main.setDefault(True)
