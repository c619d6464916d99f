"""The Edit menu: undo, redo, copy and delete, each by the action of the panel that it concerns."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QApplication, QMenu, QWidget

from handcal_gui.app.keys import panel_title
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.window import MainWindow

_TITLES = {
    "undo": tr("&Undo"),
    "redo": tr("&Redo"),
    "copy": tr("&Copy"),
    "delete": tr("&Delete"),
}
"""Entries by the object names of the actions that they trigger."""
_OWN = Qt.FindChildOption.FindDirectChildrenOnly
_OTHERS = {
    "undo": ("wizard", "session", "fineTune"),
    "redo": ("fineTune",),
    "copy": ("results-panel",),
    "delete": (),
}
"""Panels, by object names, whose action an entry triggers if the widget with the focus has none."""

_AGAIN_MS = 100
"""Period at which an open menu is brought up to date."""


def add_edit_menu(window: MainWindow, find: Callable[[], object]) -> None:
    """Fill the Edit menu of a window.

    Parameters
    ----------
    window : MainWindow
    find : callable
        Searches the stored sessions.
    """
    menu = window.menus["Edit"]
    again = QTimer(menu, interval=_AGAIN_MS)  # a wearer's nudge can be undone while it is open
    menu.aboutToShow.connect(again.start)
    menu.aboutToHide.connect(again.stop)
    for name in _TITLES:
        entry = window.add_action("Edit", _TITLES[name], "", partial(_trigger, window, name))
        entry.setObjectName(f"edit-{name}")
        for due in (menu.aboutToShow, again.timeout):
            due.connect(partial(_show_target, window, entry, name))
    menu.addSeparator()
    found = window.add_action("Edit", tr("&Find in sessions…"), "Ctrl+F", find)
    found.setWhatsThis(tr("Find in sessions, or go to the search field of the window in front"))


def _trigger(window: MainWindow, name: str) -> None:
    action, _ = _target(window, name)
    if action is not None:
        action.trigger()


def _show_target(window: MainWindow, entry: QAction, name: str) -> None:
    """Name the panel that an entry concerns, and its key where that works."""
    action, has_focus = _target(window, name)
    entry.setEnabled(action is not None)
    text = _TITLES[name]
    if action is not None:
        text = f"{text}: {panel_title(action) or action.text()}"
        if has_focus:  # after a tab, so that it is shown only
            native = QKeySequence.SequenceFormat.NativeText
            text = f"{text}\t{action.shortcut().toString(native)}"
    entry.setText(text)


def _target(window: MainWindow, name: str) -> tuple[QAction | None, bool]:
    """Return the action to trigger, None if there is none, and whether its panel has the focus."""
    for action in _actions_around(_focus_of(window)):
        if action.objectName() == name and action.isEnabled():
            return action, True
    for panel in _OTHERS[name]:
        owner = window.findChild(QWidget, panel)
        own = owner.findChild(QAction, name, _OWN) if owner is not None else None
        if own is None or not own.isEnabled():
            continue
        # The guide alone hides every panel, not what was deleted by one of its buttons.
        if window.page != "start":
            return own, False
    return None, False


def _focus_of(window: MainWindow) -> QWidget | None:
    """Return the widget that has the focus, or had it before the menu was opened."""
    focus = QApplication.focusWidget()
    return window.focusWidget() if focus is None or isinstance(focus, QMenu) else focus


def _actions_around(widget: QWidget | None) -> Iterator[QAction]:
    while widget is not None:
        yield from widget.actions()
        widget = widget.parentWidget()
