"""The main window: pages in the middle, panels in docks around them, menus above, a bar below."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import partial
from itertools import pairwise
from typing import Literal, Protocol

from PySide6.QtCore import QByteArray, QEvent, QObject, Qt, QTimer, Signal
from PySide6.QtGui import (
    QAction,
    QCloseEvent,
    QColor,
    QIcon,
    QKeyEvent,
    QKeySequence,
    QPainter,
    QPaintEvent,
)
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QComboBox,
    QDockWidget,
    QMainWindow,
    QStackedWidget,
    QStatusBar,
    QTabBar,
    QTabWidget,
    QWidget,
)

from handcal.station.snapshot import Snapshot
from handcal_gui.pages.start.start_page import StartPage
from handcal_gui.pages.wizard.wizard import WizardPanel
from handcal_gui.panels.camera.panel import CameraPanel
from handcal_gui.panels.cloud.panel import CloudPanel
from handcal_gui.panels.fine_tune.panel import FineTunePanel
from handcal_gui.panels.link.panel import LinkPanel
from handcal_gui.panels.results.panel import ResultsPanel
from handcal_gui.panels.rotation.panel import RotationPanel
from handcal_gui.panels.session.panel import SessionPanel
from handcal_gui.panels.trials.panel import TrialsPanel
from handcal_gui.panels.wearer_view.panel import WearerViewPanel
from handcal_gui.theme import SPACING_PX, colors, follow_theme, icon
from handcal_gui.translation import tr
from handcal_gui.widgets.banner import Banner
from handcal_gui.widgets.layouts import scrollable, vbox

Page = Literal["start", "live", "review"]
Arrangement = Literal["panels", "station"]
_LAYOUT_VERSION = 2
_CHILDREN_ONLY = Qt.FindChildOption.FindDirectChildrenOnly
_NARROWEST_PX, _WIDEST_PX = 360, 720
"""Limits of the initial width of a column of docks."""
_SMALL_PX = 1200, 690
"""Width and height below which all docks of a window are tabs."""
_LEFT_COLUMN, _RIGHT_COLUMN = ("camera", "cloud", "rotation"), ("results", "fine_tune")
_LEFT, _RIGHT = Qt.DockWidgetArea.LeftDockWidgetArea, Qt.DockWidgetArea.RightDockWidgetArea


_TITLES = {
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
_MENUS = {
    "File": tr("&File"),
    "Edit": tr("Edi&t"),  # Alt+E adds the left eye, or exports
    "View": tr("&View"),
    "Help": tr("&Help"),
}
_TITLE_BUTTONS = {"qt_dockwidget_closebutton": "close", "qt_dockwidget_floatbutton": "float"}
"""Icons of a dock's buttons, by the names that Qt gives the buttons."""
_ICON_TABS = """
    QTabBar::tab { padding: 5px 9px; width: 20px; border: 0; font-size: 1px; color: transparent; }
    QTabBar::tab:hover { background: palette(midlight); }
    QTabBar::tab:selected { background: palette(base); }
    QTabBar::tab:selected { border-bottom: 2px solid palette(highlight); }
"""
"""Tabs without texts, which stay for screen readers and tooltips."""
_DOCKS_OF_PAGE: dict[Page, frozenset[str]] = {
    "start": frozenset(),
    "live": frozenset(_TITLES),
    "review": frozenset({"cloud", "results", "trials", "session"}),
}


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


class MainWindow(QMainWindow):
    """Holds pages and panels and arranges them, whatever they show.

    Parameters
    ----------
    start, wizard, review : QWidget
        The pages.
    panels : Panels

    Attributes
    ----------
    menus : dict of str to QMenu
        File, Edit, View and Help.
    closing : Signal()
        The window is about to close.
    arrangement_changed : Signal(str)
        The user has chosen panels around the guide, or the guide alone.
    """

    closing = Signal()
    arrangement_changed = Signal(str)

    def __init__(
        self, start: StartPage, wizard: WizardPanel, review: QWidget, panels: Panels
    ) -> None:
        super().__init__()
        self.setObjectName("mainWindow")
        self.setWindowTitle("handcal")
        self.panels = panels
        self.banner = Banner()
        self._pages: dict[Page, QWidget] = {"start": start, "live": wizard, "review": review}
        self._stack = QStackedWidget()
        for page in self._pages.values():
            self._stack.addWidget(scrollable(page))
        middle = QWidget()
        vbox(
            self.banner,
            (self._stack, 1),
            on=middle,
            margins=(SPACING_PX // 2, SPACING_PX // 2, SPACING_PX // 2, 0),
        )
        self.setCentralWidget(middle)
        self._bar = wizard.bar
        self.setStatusBar(_Strip(self._bar))
        # GroupedDragging: a dock without title can be undocked by its tab.
        options = QMainWindow.DockOption
        self.setDockOptions(
            options.AnimatedDocks
            | options.AllowNestedDocks
            | options.AllowTabbedDocks
            | options.GroupedDragging
        )
        self.setCorner(Qt.Corner.BottomLeftCorner, _LEFT)
        self.setCorner(Qt.Corner.BottomRightCorner, _RIGHT)
        self._titles_timer = QTimer(self, interval=0, singleShot=True)
        self._titles_timer.timeout.connect(self._leave_titles_to_tabs)
        self._docks = self._make_docks()
        self._layouts: dict[Page, QByteArray] = {}
        self._page: Page = "start"
        self._arrangement: Arrangement = "panels"
        self._guide = wizard
        self._default_layouts = {
            is_small: self._arranged(is_small=is_small) for is_small in (True, False)
        }
        self._make_menus()
        self._keep_focus_off_clicked_buttons()
        self.show_page("start")
        follow_theme(self, self._draw_title_buttons)

    @property
    def docks(self) -> Mapping[str, QDockWidget]:
        """The docks by the names of their panels."""
        return self._docks

    @property
    def page(self) -> Page:
        """The page shown."""
        return self._page

    def use_arrangement(self, arrangement: Arrangement) -> None:
        """Arrange calibrations as panels around the guide, or as the guide alone."""
        self._keep_layout()
        self._arrangement = arrangement
        self._station.setChecked(arrangement == "station")
        page, self._page = self._page, "start"
        self.show_page(page)

    def show_page(self, page: Page) -> None:
        """Show a page with its docks, in the layout used last."""
        self._keep_layout()
        self._page = page
        self.statusBar().setVisible(page == "live")
        self._stack.setCurrentIndex(list(self._pages).index(page))
        is_small = self.width() < _SMALL_PX[0] or self.height() < _SMALL_PX[1]
        is_alone = self._arrangement == "station"
        self._guide.fill_window(is_alone and not is_small)
        layout = self._layouts.get(page, self._default_layouts[is_small])
        self.restoreState(layout, _LAYOUT_VERSION)
        if self.minimumSizeHint().height() > self.screen().availableGeometry().height():
            self.restoreState(self._default_layouts[is_small], _LAYOUT_VERSION)
        for name, dock in self._docks.items():
            belongs = name in self._docks_of_page
            if not belongs:
                dock.hide()
            elif page not in self._layouts:
                dock.show()
            dock.toggleViewAction().setEnabled(belongs)
        if page not in self._layouts:
            self._share_room()
            self._docks["results"].raise_()
        self._leave_titles_to_tabs()

    @property
    def _docks_of_page(self) -> frozenset[str]:
        is_alone = self._page == "live" and self._arrangement == "station"
        return frozenset() if is_alone else _DOCKS_OF_PAGE[self._page]

    def bring_up(self, name: str) -> None:
        """Raise a panel above those tabbed with it, unless one of them has the keyboard focus."""
        dock, focus = self._docks.get(name), QApplication.focusWidget()
        if dock is not None and name in self._docks_of_page:
            others = self.tabifiedDockWidgets(dock)
            if not any(focus and other.isAncestorOf(focus) for other in others):
                dock.raise_()

    def go_to(self, name: str) -> None:
        """Raise a panel and give it the keyboard focus, if it belongs to the page."""
        if name in self._docks_of_page:
            dock = self._docks[name]
            dock.show()
            dock.raise_()
            dock.widget().setFocus(Qt.FocusReason.ShortcutFocusReason)

    def reset_layout(self) -> None:
        """Restore the default layout of the page's docks."""
        self._layouts.pop(self._page, None)
        page, self._page = self._page, "start"  # so that the current layout is not saved
        self.show_page(page)

    def layouts(self) -> dict[Page, str]:
        """Return the layout of every page as text, for `restore_layouts`."""
        self._keep_layout()
        return {
            page: base64.b64encode(state.data()).decode() for page, state in self._layouts.items()
        }

    def restore_layouts(self, layouts: Mapping[Page, str]) -> None:
        """Restore the layouts of an earlier run; those that do not fit are ignored."""
        for page, text in layouts.items():
            state = QByteArray.fromBase64(text.encode())
            if page in _DOCKS_OF_PAGE and self.restoreState(state, _LAYOUT_VERSION):
                self._layouts[page] = state
        page, self._page = self._page, "start"
        self.show_page(page)

    def add_action(self, menu: str, text: str, keys: str, do: Callable[[], object]) -> QAction:
        """Add an action to one of the `menus`."""
        action = QAction(text, self)
        if keys:
            action.setShortcut(QKeySequence(keys))
        action.triggered.connect(lambda _checked=False: do())
        if menu == "View":
            self.menus[menu].insertAction(self._dock_actions_start, action)
        else:
            self.menus[menu].addAction(action)
        return action

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Make Return press the focused button, as Space does not, and Esc close the message."""
        if event.key() == Qt.Key.Key_Escape:
            self.banner.clear()
        elif event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and self._page == "live":
            if not self._bar.is_repeat:
                _press(QApplication.focusWidget())
        else:
            super().keyPressEvent(event)

    def event(self, event: QEvent) -> bool:
        """Pass key events to the bar, which detects keys that are held down."""
        if isinstance(event, QKeyEvent):
            self._bar.notice_key(event)
        return super().event(event)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Handle the keys that a floating dock ignores, and fit the tabs of a resized one."""
        if isinstance(watched, QDockWidget) and event.type() == QEvent.Type.Resize:
            self._titles_timer.start()
        is_apart = isinstance(watched, QDockWidget) and watched.window() is not self
        if is_apart and isinstance(event, QKeyEvent):
            self._bar.notice_key(event)
            if event.type() == QEvent.Type.KeyPress:
                self.keyPressEvent(event)
                return event.isAccepted()
        return super().eventFilter(watched, event)

    def closeEvent(self, event: QCloseEvent) -> None:
        """Emit `closing` before the window closes."""
        self.closing.emit()
        super().closeEvent(event)

    def _keep_layout(self) -> None:
        if self._docks_of_page:
            self._layouts[self._page] = self.saveState(_LAYOUT_VERSION)

    def _make_docks(self) -> dict[str, QDockWidget]:
        docks = {}
        for name, title in _TITLES.items():
            dock = QDockWidget(title, self)
            dock.setObjectName(f"{name}Dock")
            dock.setWidget(getattr(self.panels, name))
            dock.installEventFilter(self)
            dock.visibilityChanged.connect(self._titles_timer.start)
            dock.dockLocationChanged.connect(self._titles_timer.start)
            docks[name] = dock
        return docks

    def _arranged(self, *, is_small: bool) -> QByteArray:
        """Arrange the docks around the page, in a small window as tabs beside it."""
        docks, across = self._docks, Qt.Orientation.Vertical
        for dock in docks.values():
            dock.hide()  # or the window grows while they stand below one another
        for name in _LEFT_COLUMN:
            self.addDockWidget(_LEFT, docks[name])
        for name in _RIGHT_COLUMN:
            self.addDockWidget(_LEFT if is_small else _RIGHT, docks[name])
        behind: dict[str, tuple[str, ...]] = {
            "results": ("wearer_view", "trials", "session", "link")
        }
        if is_small:
            behind = {"camera": tuple(name for name in docks if name != "camera")}
        else:
            for above, below in (*pairwise(_LEFT_COLUMN), *pairwise(_RIGHT_COLUMN)):
                self.splitDockWidget(docks[above], docks[below], across)
        for front, others in behind.items():
            for name in others:
                self.tabifyDockWidget(docks[front], docks[name])
        self.setTabPosition(Qt.DockWidgetArea.AllDockWidgetAreas, QTabWidget.TabPosition.North)
        return self.saveState(_LAYOUT_VERSION)

    def _share_room(self) -> None:
        """Divide the window among the docks of a page whose layout the user has not changed."""
        docks = self._docks
        across, down = Qt.Orientation.Horizontal, Qt.Orientation.Vertical
        width, height = self.width(), self.height()
        left, right = (
            min(max(width * percent // 100, _NARROWEST_PX), _WIDEST_PX) for percent in (26, 30)
        )
        if self._page == "review":  # the page itself needs little space
            page = self._pages["review"].minimumSizeHint().width() + 8 * SPACING_PX
            left = (width - page) * 45 // 100
            right = width - page - left
        self.resizeDocks([docks["camera"], docks["results"]], [left, right], across)
        column = [docks[name] for name in _LEFT_COLUMN]
        self.resizeDocks(column, [height * percent // 100 for percent in (38, 33, 29)], down)
        results = height * 45 // 100
        self.resizeDocks([docks["results"], docks["fine_tune"]], [results, height - results], down)

    def _draw_title_buttons(self) -> None:
        """Draw the buttons of docks like other icons: Qt's own are dark in the dark theme, too."""
        for dock in self._docks.values():
            for name, drawing in _TITLE_BUTTONS.items():
                button = dock.findChild(QAbstractButton, name)
                if button is not None:
                    button.setIcon(icon(drawing))

    def _leave_titles_to_tabs(self) -> None:
        """Hide the titles of docks whose tabs show the same text."""
        bars = self.findChildren(QTabBar, options=_CHILDREN_ONLY)
        without_text = {name for bar in bars for name in self._fit_tabs(bar)}
        for name, dock in self._docks.items():
            shared = any(not other.isHidden() for other in self.tabifiedDockWidgets(dock))
            is_said = shared and name not in without_text
            title = dock.titleBarWidget()
            if is_said and title is None:
                dock.setTitleBarWidget(QWidget(dock))
            elif not is_said and title is not None:
                dock.setTitleBarWidget(None)  # type: ignore[arg-type]  # PySide's stub is wrong
                title.deleteLater()
        self._draw_title_buttons()  # Qt recreates them with the titles

    def _fit_tabs(self, bar: QTabBar) -> Iterator[str]:
        """Show icons in place of texts that do not fit; return the names of those docks."""
        bar.setElideMode(Qt.TextElideMode.ElideNone)
        named = {dock.windowTitle(): name for name, dock in self._docks.items()}
        names = [named[bar.tabText(i)] for i in range(bar.count()) if bar.tabText(i) in named]
        texts_px = sum(
            bar.fontMetrics().horizontalAdvance(self._docks[name].windowTitle()) for name in names
        )
        room_px = max((self._docks[name].width() for name in names), default=0)
        has_icons = texts_px + 3 * SPACING_PX * len(names) > room_px
        bar.setStyleSheet(_ICON_TABS if has_icons else "")
        for i, name in enumerate(names):
            bar.setTabIcon(i, icon(name.replace("_", "-")) if has_icons else QIcon())
        return iter(names if has_icons else ())

    def _make_menus(self) -> None:
        self.menus = {name: self.menuBar().addMenu(title) for name, title in _MENUS.items()}
        view = self.menus["View"]
        go_to = view.addMenu(tr("&Go to"))
        for number, (name, title) in enumerate(_TITLES.items(), 1):
            go_to.addAction(title, QKeySequence(f"Ctrl+{number}"), partial(self.go_to, name))
        self._station = view.addAction(
            tr("&Station: the guide alone"), QKeySequence("F11"), self._swap
        )
        self._station.setCheckable(True)
        self._dock_actions_start = view.addSeparator()
        for dock in self._docks.values():
            view.addAction(dock.toggleViewAction())

    def _swap(self) -> None:
        arrangement: Arrangement = "panels" if self._arrangement == "station" else "station"
        self.use_arrangement(arrangement)
        self.arrangement_changed.emit(arrangement)

    def _keep_focus_off_clicked_buttons(self) -> None:
        """Keep the keyboard focus where it is when a button is clicked."""
        for button in self.findChildren(QAbstractButton):
            if button.focusPolicy() == Qt.FocusPolicy.StrongFocus:
                button.setFocusPolicy(Qt.FocusPolicy.TabFocus)


class _Strip(QStatusBar):
    """The window's bottom strip, below all docks; holds a bar and nothing else."""

    def __init__(self, bar: QWidget) -> None:
        super().__init__()
        self.setSizeGripEnabled(False)  # it appears and disappears, and moves the bar
        self.setContentsMargins(0, 0, 0, 0)
        self.addPermanentWidget(bar, 1)

    def paintEvent(self, _event: QPaintEvent) -> None:
        """Draw a line above the bar."""
        painter = QPainter(self)
        painter.setPen(QColor(colors().muted))
        painter.drawLine(0, 0, self.width(), 0)
        painter.end()


def _press(widget: QWidget | None) -> None:
    """Press a button, or open a list."""
    if isinstance(widget, QAbstractButton):
        widget.click()
    elif isinstance(widget, QComboBox) and not widget.isEditable():
        widget.showPopup()
