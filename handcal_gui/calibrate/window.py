"""The main window: pages in the middle, panels in docks around them, menus above, a bar below."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from functools import partial
from math import inf
from typing import Literal

from PySide6.QtCore import QByteArray, QEvent, QObject, Qt, Signal
from PySide6.QtGui import (
    QAction,
    QCloseEvent,
    QKeyEvent,
    QKeySequence,
    QMouseEvent,
    QResizeEvent,
)
from PySide6.QtWidgets import (
    QApplication,
    QDockWidget,
    QMainWindow,
    QStackedWidget,
    QWidget,
)

from handcal_gui.app.keys import keep_focus_off_clicked_buttons, press
from handcal_gui.app.theme import SPACING_PX, follow_theme, font_px
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.docks import (
    TITLES,
    Docks,
    PanelLetters,
    Panels,
    arrange_docks,
    has_columns,
    hide_tabs,
    leave_titles_to_tabs,
    make_docks,
    share_room,
    widen_page,
)
from handcal_gui.calibrate.guide.action_bar import BottomStrip
from handcal_gui.calibrate.guide.wizard import WizardPanel
from handcal_gui.calibrate.start.start_page import StartPage
from handcal_gui.widgets.banner import Banner
from handcal_gui.widgets.layouts import fit_soon, scrollable, vbox

Page = Literal["start", "live", "review"]
Arrangement = Literal["panels", "station"]
_SHARED, _OWN = 3, 2
"""Versions of stored layouts: divided by the program, or by the user, who dragged a splitter."""
_SMALL = 100.0, 57.5
"""Width and height below which all docks of a window are tabs, in sizes of the font."""
_SETTLED_MS = 100
"""Time without a new size after which the panels share it: that takes as long as a resize."""
_GUIDE = 40.0
"""Width, in sizes of the font, that the guide needs at every step."""
_REVIEW_PERCENT = 36
"""Of a large window's width, for the page of a stored session with its residual map."""
_MENUS = {
    "File": tr("&File"),
    "Edit": tr("&Edit"),
    "View": tr("&View"),
    "Help": tr("&Help"),
}
_DOCKS_OF_PAGE: dict[Page, frozenset[str]] = {
    "start": frozenset(),
    "live": frozenset(TITLES),
    "review": frozenset({"cloud", "results", "trials", "session"}),
}


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
        self._pages: dict[Page, QWidget] = {"start": start, "live": wizard, "review": review}
        self._stack = QStackedWidget()
        for page in self._pages.values():
            self._stack.addWidget(scrollable(page))
        middle = QWidget()
        gap_px = SPACING_PX // 2
        margins = (*3 * (gap_px,), 2)  # so that no message is on the line of the strip below
        pages = (self._stack, 1)
        self._middle = vbox(self.banner, pages, on=middle, margins=margins, spacing=gap_px)
        self.setCentralWidget(middle)
        self._bar = wizard.bar
        self.setStatusBar(BottomStrip(self._bar))
        self._docks = make_docks(self, panels)
        PanelLetters(self._docks, self)
        self._leave_titles_to_tabs = partial(leave_titles_to_tabs, self, self._docks)
        self._titles_timer = fit_soon(self._leave_titles_to_tabs, self)
        for dock in self._docks.values():
            dock.installEventFilter(self)
            dock.visibilityChanged.connect(self._titles_timer.start)
            dock.dockLocationChanged.connect(self._titles_timer.start)
            dock.topLevelChanged.connect(self._own_layout)
        self._is_own, self._was_small, self._least_px = False, False, inf
        self._share_soon = fit_soon(self._fit_panels, self)
        self._share_soon.setInterval(_SETTLED_MS)
        self._layouts: dict[Page, QByteArray] = {}
        self._page: Page = "start"
        self._arrangement: Arrangement = "panels"
        self._guide = wizard
        self._default_layouts: dict[bool, QByteArray] = {}
        for is_small in (True, False):
            arrange_docks(self, self._docks, is_small=is_small)
            self._default_layouts[is_small] = self.saveState(_SHARED)
        self._make_menus()
        keep_focus_off_clicked_buttons(self)
        self.show_page("start")
        follow_theme(self, self._titles_timer.start)

    @property
    def docks(self) -> Docks:
        """The docks by the names of their panels."""
        return self._docks

    @property
    def page(self) -> Page:
        """The page shown."""
        return self._page

    def use_arrangement(self, arrangement: Arrangement) -> None:
        """Arrange calibrations as panels around the guide, or as the guide only."""
        self._keep_layout()
        self._arrangement = arrangement
        self._station.setChecked(arrangement == "station")
        page, self._page = self._page, "start"
        self.show_page(page)

    def show_wearer(self, name: str) -> None:
        """Name the wearer whose session is shown in the title; empty for none."""
        self.setWindowTitle(tr("{} – handcal").format(name) if name else "handcal")

    def show_page(self, page: Page) -> None:
        """Show a page with its docks, in the layout used last."""
        self._keep_layout()
        self._page = page
        if page == "start":
            self.show_wearer("")
        size_px = self.size()
        self.statusBar().setVisible(page == "live")
        # Where a message moves nothing that is about to be pressed: the guide's pictures give way
        # to it, on the start page the space above the buttons.
        self._middle.insertWidget(int(page == "live"), self.banner)
        self._stack.setCurrentIndex(list(self._pages).index(page))
        is_small = self._was_small = self._is_small()
        self._guide.fill_window(self._arrangement == "station", is_small=is_small)
        self._restore_layout(page, is_small=is_small)
        for name, dock in self._docks.items():
            belongs = name in self._docks_of_page
            if not belongs:
                dock.hide()
            elif page not in self._layouts:
                dock.show()
            dock.toggleViewAction().setEnabled(belongs)
            self._go_to[name].setEnabled(belongs)
        if page not in self._layouts:
            self._docks["results"].raise_()
        self._share_room()
        self._leave_titles_to_tabs()
        self._find_least_size()
        if self.size() != size_px:  # Qt enlarges a window for its docks
            room, frame = self.screen().availableGeometry(), self.frameGeometry()
            self.resize(self.size().boundedTo(room.size()))
            left, top = room.right() - frame.width(), room.bottom() - frame.height()
            self.move(max(room.left(), min(self.x(), left)), max(room.top(), min(self.y(), top)))

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
        self._least_px = inf
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
            versions = (_SHARED, _OWN) if page in _DOCKS_OF_PAGE else ()
            if any(self.restoreState(state, version) for version in versions):
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

    def say_why_not(self, action: QAction, why: Callable[[], str]) -> None:
        """Disable an action of the File menu, and show the reason in it, while there is one."""
        text = action.text()

        def show() -> None:
            reason = why()
            action.setEnabled(not reason)
            action.setText(f"{text} ({reason})" if reason else text)

        def end() -> None:  # its key says why, too
            action.setEnabled(True)
            action.setText(text)

        self.menus["File"].aboutToShow.connect(show)
        self.menus["File"].aboutToHide.connect(end)

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
        """Pass key events to the bar, which detects keys that are held down; note a dragging."""
        if isinstance(event, QKeyEvent):
            self._bar.notice_key(event)
        if isinstance(event, QMouseEvent) and event.type() == QEvent.Type.MouseButtonPress:
            self._is_own |= self.isSeparator(event.position().toPoint())
        elif event.type() == QEvent.Type.MouseButtonRelease and self._is_own:
            self._least_px = self._stack.width()
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

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Share the new room, once the window is no longer being resized."""
        super().resizeEvent(event)
        self._share_soon.start()

    def closeEvent(self, event: QCloseEvent) -> None:
        """Emit `closing` before the window closes, if it may."""
        if not self.may_close():
            event.ignore()
            return
        self.closing.emit()
        super().closeEvent(event)

    def _keep_layout(self) -> None:
        if self._docks_of_page:
            self._layouts[self._page] = self.saveState(_OWN if self._is_own else _SHARED)

    def _restore_layout(self, page: Page, *, is_small: bool) -> None:
        """Restore a page's layout, or the default where it needs a larger screen."""
        size_px = self.size()
        room_px = self.screen().availableSize() - (self.frameGeometry().size() - size_px)
        default = self._default_layouts[is_small]
        hide_tabs(self)
        layout = self._layouts.get(page, default)
        self._is_own = self.restoreState(layout, _OWN)
        self.restoreState(layout, _SHARED)  # or nothing, where it is the user's
        is_unfit = self.minimumSizeHint().boundedTo(room_px) != self.minimumSizeHint()
        is_unfit |= is_small and has_columns(self, self._docks) and self._missing_px() > 0
        if is_unfit:
            if self._docks_of_page:  # or it is kept, for the arrangement with panels
                self._layouts.pop(page, None)
            self.restoreState(default, _SHARED)
            self._is_own = False
            self._find_least_size()
            self.resize(size_px)  # Qt has enlarged it

    def _missing_px(self) -> float:
        """Return the width that the guide lacks."""
        least_px = min(_GUIDE * font_px(), self._least_px)
        return least_px - self._stack.width() if self._page == "live" else 0.0

    def _own_layout(self) -> None:
        self._is_own = True

    def _fit_panels(self) -> None:
        """Share the window's new room, with the layout of its size unless the user has made one."""
        if self._docks_of_page and not self._is_own and self._is_small() != self._was_small:
            focus = QApplication.focusWidget()
            closed = [one for one in self._docks.values() if not one.toggleViewAction().isChecked()]
            self.reset_layout()
            for dock in closed:
                dock.close()
            for dock in self._docks.values():
                if focus is not None and dock.isAncestorOf(focus):
                    dock.raise_()
                    focus.setFocus()
        self._share_room()

    def _share_room(self) -> None:
        """Divide the window as by default, or leave it, with a guide as wide as it needs to be."""
        if self._docks_of_page and not self._is_own:
            least_px = self._pages["review"].minimumSizeHint().width() + 5 * SPACING_PX
            review_px = max(least_px, self.width() * _REVIEW_PERCENT // 100)
            share_room(self, self._docks, review_px if self._page == "review" else None)
        elif (missing_px := self._missing_px()) > 0:
            widen_page(self, self._docks, missing_px)

    def _find_least_size(self) -> None:
        """Compute the least size for the docks shown, at once."""
        if (box := self.layout()) is not None:
            box.activate()  # or it stays that of the page before

    def _is_small(self) -> bool:
        width, height = _SMALL
        return self.width() < width * font_px() or self.height() < height * font_px()

    def _make_menus(self) -> None:
        self.menus = {name: self.menuBar().addMenu(title) for name, title in _MENUS.items()}
        view = self.menus["View"]
        menu = view.addMenu(tr("&Go to"))
        self._go_to = {
            name: menu.addAction(title, QKeySequence(f"Ctrl+{number}"), partial(self.go_to, name))
            for number, (name, title) in enumerate(TITLES.items(), 1)
        }
        self._station = view.addAction(
            tr("&Station: only the guide"), QKeySequence("F11"), self._swap
        )
        self._station.setCheckable(True)
        self._dock_actions_start = view.addSeparator()
        for dock in self._docks.values():
            view.addAction(dock.toggleViewAction())

    def _swap(self) -> None:
        arrangement: Arrangement = "panels" if self._arrangement == "station" else "station"
        self.use_arrangement(arrangement)
        self.arrangement_changed.emit(arrangement)
