"""The main window: pages in the middle, panels on either side, menus above, a bar below."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Literal

from PySide6.QtCore import QEvent, Qt, Signal
from PySide6.QtGui import QAction, QCloseEvent, QKeyEvent, QKeySequence, QResizeEvent
from PySide6.QtWidgets import (
    QApplication,
    QMainWindow,
    QScrollArea,
    QSplitter,
    QStackedWidget,
    QStatusBar,
    QWidget,
)

from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import keep_focus_off_clicked_buttons, press
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.guide.wizard import WizardPanel
from handcal_gui.calibrate.sections import (
    LEFT,
    PLACES,
    RIGHT,
    TABS,
    TITLES,
    Panels,
    Section,
    Tabs,
    column,
    share_height,
)
from handcal_gui.calibrate.start.start_page import StartPage
from handcal_gui.widgets.banner import Banner
from handcal_gui.widgets.layouts import scrollable, vbox
from handcal_gui.widgets.placement import keep_on_screen

Page = Literal["start", "live", "review"]
Arrangement = Literal["panels", "station"]
_SHARES = (0.22, 0.315)
"""Of the window's width, for the columns of panels; what the user drags replaces them."""
_MENUS = {
    "File": tr("&File"),
    "Edit": tr("&Edit"),
    "View": tr("&View"),
    "Help": tr("&Help"),
}


class MainWindow(QMainWindow):
    """Holds pages and panels, and opens the panels that have something to show.

    What the user has opened or folded stays so.

    Parameters
    ----------
    start, wizard, review : QWidget
        The pages.
    panels : Panels

    Attributes
    ----------
    menus : dict of str to QMenu
        File, Edit, View and Help.
    sections : dict of str to Section
        By the names of their panels; the other panels are in the tabs.
    closing : Signal()
        The window is about to close.
    arrangement_changed : Signal(str)
        The user has chosen panels around the guide, or only the guide.
    may_close : callable
        Returns False to keep the window open.
    """

    closing = Signal()
    arrangement_changed = Signal(str)

    def __init__(
        self, start: StartPage, wizard: WizardPanel, review: QWidget, panels: Panels
    ) -> None:
        super().__init__()
        self.setObjectName("mainWindow")
        self.show_wearer("")
        self.may_close: Callable[[], bool] = lambda: True
        self.panels = panels
        self.banner = Banner()
        self.sections = {
            name: Section(name, getattr(panels, name), partial(self._choose, name))
            for name in (*LEFT, *RIGHT)
        }
        of_tabs = {name: getattr(panels, name) for name in TABS}
        self.tabs = Tabs(of_tabs, partial(self._choose, "tabs"))
        self._parts: dict[str, Section | Tabs] = {**self.sections, "tabs": self.tabs}
        # Keys that work in the whole window work while their panel is folded, too.
        self._far_reaching = {
            name: [
                action
                for action in getattr(panels, name).actions()
                if action.shortcutContext() is Qt.ShortcutContext.WindowShortcut
            ]
            for name in TITLES
        }
        for actions in self._far_reaching.values():
            self.addActions(actions)
        self._chosen: dict[str, bool] = {}  # open or folded by the user
        self._opened: set[str] = set()  # as there was something to show
        self._shares = list(_SHARES)
        self._page: Page = "start"
        self._arrangement: Arrangement = "panels"
        self._guide = wizard
        self._pages: dict[Page, QWidget] = {"start": start, "live": wizard, "review": review}
        self._stack = QStackedWidget()
        for page in self._pages.values():
            self._stack.addWidget(scrollable(page))
        middle = QWidget()
        gap_px = SPACING_PX // 2
        margins = (*3 * (gap_px,), 2)  # so that no message is on the line of the strip below
        pages = (self._stack, 1)
        self._middle = vbox(self.banner, pages, on=middle, margins=margins, spacing=gap_px)
        self._columns = (
            column(*(self.sections[name] for name in LEFT)),
            column(*(self.sections[name] for name in RIGHT), self.tabs),
        )
        self._sides = tuple(map(_side, self._columns))
        self._splitter = QSplitter(childrenCollapsible=False)
        for i, part in enumerate((self._sides[0], middle, self._sides[1])):
            self._splitter.addWidget(part)
            self._splitter.setStretchFactor(i, int(part is middle))
        self._splitter.splitterMoved.connect(self._keep_shares)
        self.setCentralWidget(self._splitter)
        self._bar = wizard.bar
        strip = QStatusBar()
        strip.setSizeGripEnabled(False)  # it appears and disappears, and moves the bar
        strip.addPermanentWidget(self._bar, 1)
        self.setStatusBar(strip)
        self._make_menus()
        wizard.add_switch(self._station)
        keep_focus_off_clicked_buttons(self)
        self.show_page("start")

    @property
    def page(self) -> Page:
        """The page shown."""
        return self._page

    def use_arrangement(self, arrangement: Arrangement) -> None:
        """Arrange calibrations as panels around the guide, or as the guide only."""
        self._arrangement = arrangement
        self._station.setChecked(arrangement == "station")
        self._arrange()

    def show_wearer(self, name: str) -> None:
        """Name the wearer whose session is shown in the title; empty for none."""
        self.setWindowTitle(tr("{} – handcal").format(name) if name else "handcal")

    def show_page(self, page: Page) -> None:
        """Show a page with its panels."""
        if page != self._page:
            self._opened = set()
        self._page = page
        if page == "start":
            self.show_wearer("")
        size_px = self.size()
        self.statusBar().setVisible(page == "live")
        # Where a message moves nothing that is about to be pressed: the guide's pictures give way
        # to it, on the start page the space above the buttons.
        self._middle.insertWidget(int(page == "live"), self.banner)
        self._stack.setCurrentIndex(list(self._pages).index(page))
        self._arrange()
        if self.size() != size_px:  # Qt enlarges a window for what it shows
            keep_on_screen(self)

    def follow(self, snapshot: Snapshot) -> None:
        """Open the sections that have something to show; the rotation only while it matters."""
        filled = {name for name, place in PLACES.items() if place.has_content(snapshot)}
        opened = (self._opened | filled) - ({"rotation"} - filled)
        if opened != self._opened:
            self._opened = opened
            self._arrange()

    def go_to(self, name: str) -> None:
        """Open a panel and give it the keyboard focus, if it belongs to the page."""
        if name not in self._offered():
            return
        if name in TABS:
            self.tabs.show_panel(name)
        self._choose(name if name in self.sections else "tabs", True)
        panel = getattr(self.panels, name)
        panel.window().activateWindow()
        panel.setFocus(Qt.FocusReason.ShortcutFocusReason)

    def reset_layout(self) -> None:
        """Open and fold the panels as at first, in columns as wide as at first."""
        self._chosen, self._shares = {}, list(_SHARES)
        for section in self.sections.values():
            if section.isWindow():
                section.set_apart(False)
        self._chosen = {}
        self._arrange()

    def layout_text(self) -> str:
        """Return what the user has opened, folded and dragged as text, for `restore_layout`."""
        return json.dumps({"chosen": self._chosen, "shares": self._shares})

    def restore_layout(self, text: str) -> None:
        """Restore the layout of an earlier run; one that does not fit is ignored."""
        with suppress(ValueError, TypeError, KeyError, AttributeError):
            stored = json.loads(text)
            left, right = (min(max(float(one), 0.1), 0.45) for one in stored["shares"])
            chosen = {name: bool(stored["chosen"][name]) for name in stored["chosen"]}
            self._shares = [left, right]
            self._chosen = {name: chosen[name] for name in chosen if name in self._parts}
        self._arrange()

    def add_action(self, menu: str, text: str, keys: str, do: Callable[[], object]) -> QAction:
        """Add an action to one of the `menus`."""
        action = QAction(text, self)
        if keys:
            action.setShortcut(QKeySequence(keys))
        action.triggered.connect(lambda _checked=False: do())
        self.menus[menu].addAction(action)
        return action

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Make Return press the focused button, as Space does not, and Esc close the message."""
        if event.key() == Qt.Key.Key_Escape:
            self.banner.clear()
        elif event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and self._page == "live":
            if not self._bar.is_repeat:
                press(QApplication.focusWidget())
        else:
            super().keyPressEvent(event)

    def event(self, event: QEvent) -> bool:
        """Pass key events to the bar, which detects keys that are held down."""
        if isinstance(event, QKeyEvent):
            self._bar.notice_key(event)
        return super().event(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Keep the shares of the columns."""
        super().resizeEvent(event)
        self._share_width()

    def closeEvent(self, event: QCloseEvent) -> None:
        """Emit `closing` before the window closes, if it may."""
        if not self.may_close():
            event.ignore()
            return
        self.closing.emit()
        for section in self.sections.values():
            section.hide()  # those that are windows of their own
        super().closeEvent(event)

    def _offered(self) -> frozenset[str]:
        """Return the panels of the page in its arrangement."""
        if self._page == "review":
            return frozenset(name for name, place in PLACES.items() if place.is_of_stored)
        is_shown = self._page == "live" and self._arrangement == "panels"
        return frozenset(TITLES) if is_shown else frozenset()

    def _choose(self, name: str, is_open: bool) -> None:
        self._chosen[name] = is_open
        self._arrange()

    def _arrange(self) -> None:
        """Show the panels of the page, open or folded."""
        offered = self._offered()
        self._guide.use_whole_window(self._page == "live" and not offered)
        for name, section in self.sections.items():
            section.setVisible(name in offered)
            is_open = self._page == "review" or name in self._opened
            section.set_open(section.isWindow() or self._chosen.get(name, is_open))
        self.tabs.offer(offered & {*TABS})
        self.tabs.setVisible(bool(offered))
        self.tabs.set_open(self._chosen.get("tabs", self._page == "review"))
        for name, go_to in self._go_to.items():
            go_to.setEnabled(name in offered)
            for action in self._far_reaching[name]:
                action.setVisible(name in offered)
        share_height(self._columns[0], [self.sections[name] for name in LEFT])
        share_height(self._columns[1], [*(self.sections[name] for name in RIGHT), self.tabs])
        for side in self._sides:
            side.setVisible(bool(offered))
        self._share_width()

    def _share_width(self) -> None:
        """Give a column its share of the width, or hardly any while all of it is folded."""
        widths = []
        for side, made, share, names in zip(
            self._sides, self._columns, self._shares, (LEFT, (*RIGHT, "tabs")), strict=True
        ):
            bar_px = side.verticalScrollBar().sizeHint().width()
            side.setMinimumWidth(made.minimumSizeHint().width() + bar_px)
            widths.append(round(self.width() * share) if self._is_open(names) else 0)
        self._splitter.setSizes([widths[0], self.width() - sum(widths), widths[1]])

    def _is_open(self, names: tuple[str, ...]) -> bool:
        parts = [self._parts[name] for name in names]
        return any(part.is_open and not (part.isHidden() or part.isWindow()) for part in parts)

    def _keep_shares(self) -> None:
        sizes = self._splitter.sizes()
        for i, names in enumerate((LEFT, (*RIGHT, "tabs"))):
            if self._is_open(names):
                self._shares[i] = sizes[2 * i] / max(self.width(), 1)

    def _make_menus(self) -> None:
        self.menus = {name: self.menuBar().addMenu(title) for name, title in _MENUS.items()}
        view = self.menus["View"]
        menu = view.addMenu(tr("&Go to"))
        self._go_to = {
            name: menu.addAction(title, QKeySequence(f"Ctrl+{number}"), partial(self.go_to, name))
            for number, (name, title) in enumerate(TITLES.items(), 1)
        }
        self._station = view.addAction(tr("&Station view"), QKeySequence("F11"), self._swap)
        self._station.setCheckable(True)
        self._station.setToolTip(tr("Only the guide: one picture, one sentence, one button (F11)"))

    def _swap(self) -> None:
        arrangement: Arrangement = "panels" if self._arrangement == "station" else "station"
        self.use_arrangement(arrangement)
        self.arrangement_changed.emit(arrangement)


def _side(made: QWidget) -> QScrollArea:
    """Return a column that scrolls when more is open than it has room for."""
    area = scrollable(made)
    area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    return area
