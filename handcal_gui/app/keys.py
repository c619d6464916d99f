"""Actions with keys, and the keys of the window collected from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import (
    QAbstractButton,
    QComboBox,
    QMainWindow,
    QMenu,
    QWidget,
)

from handcal_gui.app.translation import tr

_WINDOW = tr("Window")
_EVERYWHERE = tr("works everywhere")
_IN_CALIBRATION = tr("works during a calibration")
_IN_MENU = tr("a menu; works everywhere")
_IN_PANEL = tr("a panel; works while it has the keyboard focus")
_NOT_ACTIONS = {
    _WINDOW: (
        (tr("Return"), tr("Press the button, or open the list, that has the focus")),
        (tr("Return on the start page"), tr("Start the calibration, from one of its fields")),
        (tr("Alt+underlined letter"), tr("Press its button, or go to its field")),
        (tr("F4"), tr("Open the list, or choose the file or folder, of the field")),
        (tr("Shift+F4"), tr("Choose a folder for a field that takes files, too")),
        (tr("Esc"), tr("Close the message, or a dialog or window opened from here")),
        (tr("Tab"), tr("Move to the next button or field")),
        (tr("Alt+Left, Alt+Right"), tr("In the manual: go back or forward")),
        (tr("F6, Shift+F6"), tr("In the list of Sessions: sort by the next column, or in reverse")),
        (tr("Ctrl+Tab"), tr("Show the next tab of the panel that has the focus")),
    ),
    tr("Fine-tune"): (
        (tr("Arrows, PgUp, PgDown"), tr("Move what the chosen eye sees in the key's direction")),
    ),
}
"""Keys that widgets handle themselves, as their meaning depends on the focus."""


@dataclass(frozen=True, slots=True)
class KeyGroup:
    """Keys that work at the same place."""

    where: str
    rows: list[tuple[str, str]]
    """Keys and their meaning."""


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


def press(widget: QWidget | None) -> None:
    """Press a button, or open a list."""
    if isinstance(widget, QAbstractButton):
        widget.click()
    elif isinstance(widget, QComboBox) and not widget.isEditable():
        widget.showPopup()


def keep_focus_off_clicked_buttons(window: QWidget) -> None:
    """Keep the keyboard focus where it is when a button of a window is clicked."""
    for button in window.findChildren(QAbstractButton):
        if button.focusPolicy() == Qt.FocusPolicy.StrongFocus:
            button.setFocusPolicy(Qt.FocusPolicy.TabFocus)


def keys_by_group(window: QMainWindow) -> dict[str, KeyGroup]:
    """Return the keys of the whole window, of the guide, of menus and of panels, by their names."""
    groups = {_WINDOW: KeyGroup(_EVERYWHERE, [])}
    for action in window.findChildren(QAction):
        keys = ", ".join(native(shortcut) for shortcut in action.shortcuts())
        if keys and not _is_of_another_window(action, window):
            meaning = action.whatsThis() or action.text().replace("&", "").rstrip("…")
            row = keys, meaning
            name, where = _group(action)
            rows = groups.setdefault(name, KeyGroup(where, [])).rows
            if row not in rows:
                rows.append(row)
    for name, others in _NOT_ACTIONS.items():
        groups[name].rows.extend(others)
    places = [_EVERYWHERE, _IN_CALIBRATION, _IN_MENU, _IN_PANEL]
    return dict(sorted(groups.items(), key=lambda group: places.index(group[1].where)))


def _is_of_another_window(action: QAction, window: QMainWindow) -> bool:
    """Return whether an action belongs to a dialog or another window, such as the manual."""
    owner = action.parent()
    while isinstance(owner, QWidget) and owner is not window:
        if owner.isWindow() and not (isinstance(owner, QMenu) or owner.property("panel")):
            return True
        owner = owner.parent()
    return False


def _group(action: QAction) -> tuple[str, str]:
    """Return the name of the group of an action, and where its keys work."""
    for owner in action.associatedObjects():
        if isinstance(owner, QMenu):
            return owner.title().replace("&", ""), _IN_MENU
    if title := panel_title(action):
        if action.shortcutContext() is Qt.ShortcutContext.WindowShortcut:
            return tr("Guide"), _IN_CALIBRATION
        return title, _IN_PANEL
    parent = action.parent()
    while isinstance(parent, QWidget):
        if parent.objectName() == "wizard":
            return tr("Guide"), _IN_CALIBRATION
        parent = parent.parent()
    return _WINDOW, _EVERYWHERE


def panel_title(action: QAction) -> str:
    """Return the title of the panel that an action belongs to; empty if it belongs to none."""
    owner = action.parent()
    while owner is not None and not owner.property("panel"):
        owner = owner.parent()
    return "" if owner is None else str(owner.property("panel"))


def native(keys: str | QKeySequence) -> str:
    """Return the name of keys on this system."""
    return QKeySequence(keys).toString(QKeySequence.SequenceFormat.NativeText)
