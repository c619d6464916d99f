"""The panels of the main window, in docks around its page: their arrangement, titles and tabs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Protocol

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QHelpEvent, QIcon, QKeySequence, QShortcutEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QDockWidget,
    QLabel,
    QMainWindow,
    QTabBar,
    QTabWidget,
    QToolTip,
    QWidget,
)

from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import native
from handcal_gui.app.theme import SPACING_PX, icon, set_style
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.camera.panel import CameraPanel
from handcal_gui.calibrate.cloud.panel import CloudPanel
from handcal_gui.calibrate.fine_tune.panel import FineTunePanel
from handcal_gui.calibrate.results.panel import ResultsPanel
from handcal_gui.calibrate.rotation.panel import RotationPanel
from handcal_gui.calibrate.session.panel import SessionPanel
from handcal_gui.calibrate.trials.panel import TrialsPanel
from handcal_gui.calibrate.wearer_view.panel import WearerViewPanel
from handcal_gui.connect.link_panel import LinkPanel

TITLES = {
    "camera": tr("Camera"),
    "cloud": tr("Hand cloud"),
    "wearer_view": tr("Wearer's view"),
    "rotation": tr("Rotation"),
    "results": tr("Results"),
    "fine_tune": tr("Fine-tune"),
    "trials": tr("Trials"),
    "session": tr("Session"),
    "link": tr("Link"),
}
_NARROWEST_PX, _WIDEST_PX = 360, 720
"""Limits of the initial width of a column of docks."""
_LEFT_COLUMN, _RIGHT_COLUMN = ("camera", "cloud", "rotation"), ("results", "fine_tune")
_LEFT, _RIGHT = Qt.DockWidgetArea.LeftDockWidgetArea, Qt.DockWidgetArea.RightDockWidgetArea
_CHILDREN_ONLY = Qt.FindChildOption.FindDirectChildrenOnly
_TITLE_BUTTONS = {"qt_dockwidget_closebutton": "close", "qt_dockwidget_floatbutton": "float"}
"""Icons of a dock's buttons, by the names that Qt gives the buttons."""
_ICON_TABS = """
    QTabBar::tab { padding: 5px 9px; width: 20px; border: 0; font-size: 1px; color: transparent; }
    QTabBar::tab:hover { background: palette(midlight); }
    QTabBar::tab:selected { background: palette(base); }
    QTabBar::tab:selected { border-bottom: 2px solid palette(highlight); }
"""
"""Tabs without texts, which stay for screen readers and tooltips."""
_TEXT_TABS = "QTabBar::tab { height: 2em; }"
"""Tabs with the height of their text: Qt cuts the lowest pixels of those not in front."""

Docks = Mapping[str, QDockWidget]
"""Docks by the names of their panels."""


class Panel(Protocol):
    """The interface of every panel."""

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the panel's part of a snapshot."""


@dataclass(frozen=True, slots=True)
class Panels:
    """All panels of the window."""

    camera: CameraPanel
    cloud: CloudPanel
    wearer_view: WearerViewPanel
    rotation: RotationPanel
    results: ResultsPanel
    fine_tune: FineTunePanel
    trials: TrialsPanel
    session: SessionPanel
    link: LinkPanel

    def all(self) -> Iterator[Panel]:
        """Return an iterator over all panels."""
        return (getattr(self, field.name) for field in fields(self))


def make_docks(window: QMainWindow, panels: Panels) -> Docks:
    """Return a dock for each panel, and let the window nest and tab them."""
    # GroupedDragging: a dock without title can be undocked by its tab.
    options = QMainWindow.DockOption
    window.setDockOptions(
        options.AnimatedDocks
        | options.AllowNestedDocks
        | options.AllowTabbedDocks
        | options.GroupedDragging
    )
    window.setCorner(Qt.Corner.BottomLeftCorner, _LEFT)
    window.setCorner(Qt.Corner.BottomRightCorner, _RIGHT)
    docks = {}
    for name, title in TITLES.items():
        dock = QDockWidget(title, window)
        dock.setObjectName(f"{name}Dock")
        dock.setWidget(getattr(panels, name))
        docks[name] = dock
    return docks


def is_in_sight(dock: QDockWidget) -> bool:
    """Return whether no tab hides a dock: Qt moves it out of the window then."""
    window = dock.parentWidget()
    return window is None or dock.isFloating() or dock.geometry().intersects(window.rect())


class PanelLetters(QObject):
    """Leads letters to panels in sight: Qt takes those behind tabs for visible, too.

    Parameters
    ----------
    docks : mapping of str to QDockWidget
        With the panels, whose letters can be those of other panels in the same tabs.
    """

    def __init__(self, docks: Docks, parent: QObject) -> None:
        super().__init__(parent)
        self._docks: dict[QAbstractButton | QLabel, QDockWidget] = {}
        for dock in docks.values():
            parts: list[QAbstractButton | QLabel] = [*dock.findChildren(QAbstractButton)]
            parts += [label for label in dock.findChildren(QLabel) if label.buddy()]
            self._docks |= {part: dock for part in parts if "&" in part.text()}
        for part in self._docks:
            part.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Press the button, or go to the field, whose letter it is."""
        if not isinstance(event, QShortcutEvent):
            return super().eventFilter(watched, event)
        found = [
            part
            for part, dock in self._docks.items()
            if QKeySequence.mnemonic(part.text()) == event.key()
            and part.isVisible()
            and part.isEnabled()
            and is_in_sight(dock)
        ]
        if len(found) > 1:  # side by side by the user: each has the focus in turn
            return False
        for part in found:
            if isinstance(part, QLabel):
                part.buddy().setFocus(Qt.FocusReason.ShortcutFocusReason)
            else:
                part.animateClick()
        return True


class _TabTips(QObject):
    """Shows the tooltips of a tab bar of docks: Qt shows them only where the tabs do not fit."""

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Show the tooltip of the tab below the mouse."""
        if isinstance(watched, QTabBar) and isinstance(event, QHelpEvent):
            text = watched.tabToolTip(watched.tabAt(event.pos()))
            QToolTip.showText(event.globalPos(), text, watched)
            return True
        return super().eventFilter(watched, event)


def arrange_docks(window: QMainWindow, docks: Docks, *, is_small: bool) -> None:
    """Arrange the docks around the page, in a small window as tabs beside it."""
    across = Qt.Orientation.Vertical
    for dock in docks.values():
        dock.hide()  # or the window grows while they stand below one another
    for name in _LEFT_COLUMN:
        window.addDockWidget(_LEFT, docks[name])
    for name in _RIGHT_COLUMN:
        window.addDockWidget(_LEFT if is_small else _RIGHT, docks[name])
    behind: dict[str, tuple[str, ...]] = {"results": ("wearer_view", "trials", "session", "link")}
    if is_small:
        behind = {"camera": tuple(name for name in docks if name != "camera")}
    else:
        for above, below in (*pairwise(_LEFT_COLUMN), *pairwise(_RIGHT_COLUMN)):
            window.splitDockWidget(docks[above], docks[below], across)
    for front, others in behind.items():
        for name in others:
            window.tabifyDockWidget(docks[front], docks[name])
    window.setTabPosition(Qt.DockWidgetArea.AllDockWidgetAreas, QTabWidget.TabPosition.North)


def share_room(window: QMainWindow, docks: Docks, page_px: int | None) -> None:
    """Divide the window among the docks of a page as in its default layout.

    `page_px` is the width of a page that needs little space; None leaves it a share of the window.
    """
    across, down = Qt.Orientation.Horizontal, Qt.Orientation.Vertical
    width, height = window.width(), window.height()
    left, right = (
        min(max(width * percent // 100, _NARROWEST_PX), _WIDEST_PX) for percent in (26, 30)
    )
    if page_px is not None:
        has_right = has_columns(window, docks)
        rest_px = max(width - page_px, 2)
        left = rest_px * 45 // 100 if has_right else rest_px
        right = rest_px - left if has_right else rest_px  # or all docks are tabs of one column
    window.resizeDocks([docks["camera"], docks["results"]], [left, right], across)
    column = [docks[name] for name in _LEFT_COLUMN]
    window.resizeDocks(column, [height * percent // 100 for percent in (38, 33, 29)], down)
    results = height * 53 // 100  # with its tabs
    window.resizeDocks([docks["results"], docks["fine_tune"]], [results, height - results], down)


def widen_page(window: QMainWindow, docks: Docks, by_px: float) -> None:
    """Take a width from the columns of docks beside the page, in proportion to theirs."""
    in_sight = [dock for dock in docks.values() if dock.isVisible() and is_in_sight(dock)]
    of_areas = {window.dockWidgetArea(dock): dock for dock in in_sight if not dock.isFloating()}
    columns = [of_areas[area] for area in (_LEFT, _RIGHT) if area in of_areas]
    share = by_px / max(sum(dock.width() for dock in columns), 1)
    widths = [int(dock.width() * (1.0 - share)) for dock in columns]
    window.resizeDocks(columns, widths, Qt.Orientation.Horizontal)


def has_columns(window: QMainWindow, docks: Docks) -> bool:
    """Return whether docks are on both sides of the page; in a small window all are tabs."""
    return window.dockWidgetArea(docks["results"]) is _RIGHT


def draw_title_buttons(docks: Docks) -> None:
    """Draw the buttons of docks like other icons: Qt's own are dark in the dark theme, too."""
    for dock in docks.values():
        for name, drawing in _TITLE_BUTTONS.items():
            button = dock.findChild(QAbstractButton, name)
            if button is not None:
                button.setIcon(icon(drawing))


def hide_tabs(window: QMainWindow) -> None:
    """Hide the tabs of all docks before a layout is restored.

    Qt makes and shows other tab bars for it, and leaves the former ones where they were.
    """
    for bar in window.findChildren(QTabBar, options=_CHILDREN_ONLY):
        bar.hide()


def leave_titles_to_tabs(window: QMainWindow, docks: Docks) -> None:
    """Hide the titles of docks whose tabs show the same text."""
    bars = window.findChildren(QTabBar, options=_CHILDREN_ONLY)
    without_text = {name for bar in bars for name in _fit_tabs(bar, docks)}
    for name, dock in docks.items():
        shared = any(not other.isHidden() for other in window.tabifiedDockWidgets(dock))
        is_said = shared and name not in without_text
        title = dock.titleBarWidget()
        if is_said and title is None:
            dock.setTitleBarWidget(QWidget(dock))
        elif not is_said and title is not None:
            dock.setTitleBarWidget(None)  # type: ignore[arg-type]  # PySide's stub is wrong
            title.deleteLater()
    draw_title_buttons(docks)  # Qt recreates them with the titles


def _fit_tabs(bar: QTabBar, docks: Docks) -> list[str]:
    """Show icons in place of texts that do not fit; return the names of those docks."""
    bar.setElideMode(Qt.TextElideMode.ElideNone)
    if not bar.findChildren(_TabTips):
        bar.installEventFilter(_TabTips(bar))
    named = {dock.windowTitle(): name for name, dock in docks.items()}
    names = [named[bar.tabText(i)] for i in range(bar.count()) if bar.tabText(i) in named]
    texts_px = sum(bar.fontMetrics().horizontalAdvance(docks[name].windowTitle()) for name in names)
    room_px = max((docks[name].width() for name in names), default=0)
    has_icons = texts_px + 3 * SPACING_PX * len(names) > room_px
    set_style(bar, _ICON_TABS if has_icons else _TEXT_TABS)
    for i, name in enumerate(names):
        keys = native(f"Ctrl+{list(docks).index(name) + 1}")
        bar.setTabToolTip(i, f"{docks[name].windowTitle()} ({keys})")
        bar.setTabIcon(i, icon(name.replace("_", "-")) if has_icons else QIcon())
    return names if has_icons else []
