"""Actions with keys, and the keys of the window collected from them."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QDockWidget, QMainWindow, QMenu, QWidget

from handcal_gui.translation import tr

_WINDOW = tr("Window")
_NOT_ACTIONS = {
    _WINDOW: (
        (tr("Return"), tr("Press the button, or open the list, that has the focus")),
        (tr("Alt+underlined letter"), tr("Press a button at the lower left")),
        (tr("Esc"), tr("Close the message at the top")),
        (tr("Tab"), tr("Move to the next button or field")),
    ),
    tr("Fine-tune"): (
        (tr("Arrows, PgUp, PgDown"), tr("Move what the chosen eye sees in the key's direction")),
    ),
}
"""Keys that widgets handle themselves, as their meaning depends on the focus."""


def add_action(
    widget: QWidget,
    text: str,
    keys: str,
    do: Callable[[], object] | None = None,
    *,
    tooltip: str = "",
    context: Qt.ShortcutContext = Qt.ShortcutContext.WidgetWithChildrenShortcut,
) -> QAction:
    """Add an action to a widget and return it.

    Parameters
    ----------
    widget : QWidget
    text : str
    keys : str
        Shortcuts, separated by spaces; may be empty.
    do : callable, optional
        Called when the action is triggered.
    tooltip : str
        By default the text.
    context : Qt.ShortcutContext
        Focus with which the keys work: by default that of the widget and its children.
    """
    action = QAction(text, widget)
    action.setShortcuts([QKeySequence(key) for key in keys.split()])
    action.setShortcutContext(context)
    if tooltip:
        action.setToolTip(tooltip)
    if do is not None:
        action.triggered.connect(lambda _checked=False: do())
    widget.addAction(action)
    return action


def keys_by_group(window: QMainWindow) -> dict[str, list[tuple[str, str]]]:
    """Return the keys and their meanings: by menu, for the whole window, and by panel."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for action in window.findChildren(QAction):
        keys = ", ".join(_native(shortcut) for shortcut in action.shortcuts())
        if keys and not _is_of_another_window(action, window):
            meaning = action.whatsThis() or action.text().replace("&", "").rstrip("…")
            row = keys, meaning
            rows = groups.setdefault(_group(action), [])
            if row not in rows:
                rows.append(row)
    for group, others in _NOT_ACTIONS.items():
        groups.setdefault(group, []).extend(others)
    return groups


def keys_html(window: QMainWindow) -> str:
    """Return the keys as a table, one row for each group."""
    rows = (
        f"<tr><td style='padding: 4px 16px 4px 0'>{group}</td><td style='padding: 4px 0'>"
        + " · ".join(f"<b>{keys}</b>&nbsp;{meaning}" for keys, meaning in keys_of_group)
        + "</td></tr>"
        for group, keys_of_group in keys_by_group(window).items()
    )
    return f"<table width='640'>{''.join(rows)}</table>"


def _is_of_another_window(action: QAction, window: QMainWindow) -> bool:
    """Return whether an action belongs to a dialog or another window, such as the manual."""
    owner = action.parent()
    while isinstance(owner, QWidget) and owner is not window:
        if owner.isWindow() and not isinstance(owner, QMenu | QDockWidget):
            return True
        owner = owner.parent()
    return False


def _group(action: QAction) -> str:
    for owner in action.associatedObjects():
        if isinstance(owner, QMenu):
            return owner.title().replace("&", "")
    parent = action.parent()
    while isinstance(parent, QWidget):
        if isinstance(parent, QDockWidget):
            return parent.windowTitle()
        parent = parent.parent()
    return _WINDOW


def _native(shortcut: QKeySequence) -> str:
    return shortcut.toString(QKeySequence.SequenceFormat.NativeText)
