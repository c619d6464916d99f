"""Pages, docks and layout of the main window."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QRadioButton,
    QTabBar,
    QTabWidget,
    QToolButton,
    QWidget,
)
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.session.session import SessionRecord
from handcal_gui.app.preferences import PreferencesFile
from handcal_gui.app.program import Program
from handcal_gui.app.theme import use_theme
from handcal_gui.calibrate.review_page import ReviewPage
from handcal_gui.calibrate.window import MainWindow, Page
from handcal_gui.widgets.banner import Banner
from tests.gui.calibrate.window.conftest import Maker, is_in_front, main_button, press, say, shown
from tests.gui.views import all_views

TABBED = ("wearer_view", "results", "trials", "session", "link")


def test_every_page_has_its_docks(window: MainWindow) -> None:
    assert shown(window) == set()
    window.show_page("live")
    assert shown(window) == set(window.docks)
    window.show_page("review")
    assert shown(window) == {"cloud", "results", "trials", "session"}
    assert not window.docks["camera"].toggleViewAction().isEnabled()
    window.show_page("start")
    assert shown(window) == set()


def test_only_panels_of_the_page_are_offered_to_go_to(window: MainWindow) -> None:
    actions = {one.text(): one for one in window.findChildren(QAction)}
    pages: tuple[Page, ...] = ("start", "review", "live")
    for page in pages:
        window.show_page(page)
        assert actions["Camera"].isEnabled() == (page == "live")
        assert actions["Results"].isEnabled() == (page != "start")
    window.use_arrangement("station")
    assert not actions["Results"].isEnabled()


def test_a_dock_closed_stays_closed_on_its_page_until_the_layout_is_reset(
    window: MainWindow,
) -> None:
    window.show_page("live")
    window.docks["link"].close()
    window.show_page("review")
    window.show_page("live")
    assert "link" not in shown(window)
    window.reset_layout()
    assert shown(window) == set(window.docks)


def test_layouts_are_remembered_for_each_page(
    program: Program, qtbot: QtBot, tmp_path: Path
) -> None:
    program.window.show_page("live")
    program.window.docks["camera"].close()
    program.window.show_page("review")
    program.window.docks["cloud"].close()
    program.window.close()
    again = Program(PreferencesFile(tmp_path / "preferences.json"))
    qtbot.addWidget(again.window)
    again.window.show_page("live")
    assert shown(again.window) == set(again.window.docks) - {"camera"}
    again.window.show_page("review")
    assert shown(again.window) == {"results", "trials", "session"}
    again.window.close()


def test_one_key_leaves_the_guide_alone_and_this_is_remembered(
    qtbot: QtBot, program: Program, tmp_path: Path
) -> None:
    window = program.window
    window.show_page("live")
    window.docks["link"].close()
    window.activateWindow()
    qtbot.waitActive(window)
    press(window, Qt.Key.Key_F11)
    assert shown(window) == set()
    window.bring_up("results")
    window.go_to("results")
    window.show_page("review")
    assert shown(window) == {"cloud", "results", "trials", "session"}
    window.show_page("live")
    assert shown(window) == set()
    again = Program(PreferencesFile(tmp_path / "preferences.json"))
    qtbot.addWidget(again.window)
    again.window.show_page("live")
    assert shown(again.window) == set()
    again.window.close()
    press(window, Qt.Key.Key_F11)
    assert shown(window) == set(window.docks) - {"link"}


def test_the_guide_is_the_largest_thing_in_the_window(window: MainWindow) -> None:
    for size_px in ((960, 510), (1280, 690), (1366, 738), (1920, 1050), (3840, 2160)):
        window.show_page("start")
        window.resize(*size_px)
        window.show_page("live")
        window.reset_layout()
        QApplication.processEvents()
        assert window.size().toTuple() == size_px
        guide = window.centralWidget()
        assert guide is not None
        for name in shown(window):
            dock = window.docks[name]
            if is_in_front(window, name):
                assert dock.width() * dock.height() < guide.width() * guide.height()


def has_title(window: MainWindow, name: str) -> bool:
    return window.docks[name].titleBarWidget() is None


def test_a_dock_has_a_title_unless_its_tab_says_the_same(qtbot: QtBot, window: MainWindow) -> None:
    window.show_page("live")
    assert [name for name in window.docks if not has_title(window, name)] == list(TABBED)
    window.docks["link"].setFloating(True)
    qtbot.waitUntil(lambda: has_title(window, "link"))
    assert not has_title(window, "trials")
    for name in ("wearer_view", "trials", "session"):
        window.docks[name].hide()
    qtbot.waitUntil(lambda: has_title(window, "results"))


@pytest.mark.parametrize("size_px", [(960, 510), (1280, 690), (1920, 1050)])
def test_every_tab_is_in_sight_and_says_what_it_is(
    qtbot: QtBot, window: MainWindow, size_px: tuple[int, int]
) -> None:
    window.resize(*size_px)
    window.show_page("live")
    window.reset_layout()
    is_small = size_px == (960, 510)
    group = set(window.docks) if is_small else set(TABBED)

    def tabs() -> QTabBar:
        bars = [one for one in window.findChildren(QTabBar) if one.isVisible()]
        return max(bars, key=QTabBar.count)

    def are_in_sight() -> bool:
        bar = tabs()
        return all(bar.rect().contains(bar.tabRect(i)) for i in range(bar.count()))

    qtbot.waitUntil(are_in_sight)
    bar = tabs()
    assert {bar.tabText(i) for i in range(bar.count())} == {
        window.docks[name].windowTitle() for name in group
    }
    for i in range(bar.count()):
        assert bar.tabIcon(i).isNull() != is_small
        place = 1 + [one.windowTitle() for one in window.docks.values()].index(bar.tabText(i))
        assert bar.tabToolTip(i) == f"{bar.tabText(i)} (Ctrl+{place})"
    assert not any(arrow.isVisible() for arrow in bar.findChildren(QToolButton))
    assert all(has_title(window, name) == is_small for name in group)


def test_no_tabs_of_a_former_layout_stay(window: MainWindow) -> None:
    def tabs() -> list[int]:
        QApplication.processEvents()
        bars = window.findChildren(QTabBar, options=Qt.FindChildOption.FindDirectChildrenOnly)
        seen = (bar for bar in bars if bar.isVisible() and bar.geometry().intersects(window.rect()))
        return [bar.count() for bar in seen]

    window.show_page("live")
    assert tabs() == [len(TABBED)]
    window.use_arrangement("station")
    assert tabs() == []
    window.use_arrangement("panels")
    window.docks["link"].setFloating(True)
    window.docks["link"].setFloating(False)
    assert tabs() == [len(TABBED)]
    window.show_page("review")
    assert tabs() == [3]
    window.show_page("start")
    assert tabs() == []


def test_the_wizard_has_the_room_it_needs(window: MainWindow) -> None:
    window.show_page("live")
    wizard = window.centralWidget()
    assert wizard is not None
    assert wizard.height() > wizard.sizeHint().height()
    assert window.docks["camera"].width() >= 350


def test_a_step_brings_up_its_panel_but_not_over_work(qtbot: QtBot, window: MainWindow) -> None:
    window.show_page("live")
    window.bring_up("session")
    qtbot.waitUntil(lambda: is_in_front(window, "session"))
    window.go_to("trials")
    qtbot.waitUntil(lambda: is_in_front(window, "trials"))
    window.bring_up("results")
    assert is_in_front(window, "trials")


def test_panels_are_reached_by_keys(qtbot: QtBot, window: MainWindow) -> None:
    window.show_page("live")
    window.activateWindow()
    qtbot.waitActive(window)
    QTest.keyClick(window, Qt.Key.Key_7, Qt.KeyboardModifier.ControlModifier)
    qtbot.waitUntil(lambda: is_in_front(window, "trials"))
    assert window.panels.trials.hasFocus()
    window.show_page("start")
    QTest.keyClick(window, Qt.Key.Key_7, Qt.KeyboardModifier.ControlModifier)
    assert not is_in_front(window, "trials")


LONG = "The hand is cut by the image border, and the headset does not answer. " * 6
SIZES_PX = ((1280, 720), (1366, 768), (1920, 1080))


def corner_px(window: MainWindow) -> tuple[int, int]:
    """Return how far the main button's lower right corner is from the window's."""
    for _ in range(3):  # a layout may ask for another
        QApplication.processEvents()
    main = main_button(window)
    assert main.isVisible()
    corner = main.mapTo(window, main.rect().bottomRight())
    return window.width() - corner.x(), window.height() - corner.y()


@pytest.mark.parametrize("size_px", SIZES_PX)
def test_nothing_moves_the_main_button(
    program: Program, snapshot: Maker, record: SessionRecord, size_px: tuple[int, int]
) -> None:
    window, now = program.window, snapshot()
    window.show_page("live")
    window.resize(*size_px)
    places = {corner_px(window)}

    def look() -> None:
        places.add(corner_px(window))
        assert window.size().toTuple() == size_px
        assert window.statusBar().width() == window.width()

    for panel in window.panels.all():
        panel.show_snapshot(now)
    look()
    for view in all_views(snapshot, record):
        long = tuple(replace(one, text=LONG) for one in view.preconditions)
        for one in (view, replace(view, sentence=LONG, note=LONG, preconditions=long)):
            say(program, now, one)
            look()
    window.banner.show_message(LONG)
    look()
    window.banner.clear()
    say(program, now, view)  # with four long texts at once the guide scrolls, beside its bar
    look()
    QApplication.processEvents()
    buttons = [one for one in window.findChildren(QAbstractButton) if one.isVisible()]
    before = [one.mapTo(window, QPoint()) for one in buttons]
    window.banner.show_message(LONG)
    look()
    QApplication.processEvents()
    close = window.banner.findChild(QToolButton)
    assert close is not None
    assert close.isVisible()
    assert [one.mapTo(window, QPoint()) for one in buttons] == before
    window.banner.clear()
    for condition in (LONG, ""):
        window.banner.show_condition(condition)
        look()
    for name, dock in window.docks.items():
        for is_floating in (True, False):
            dock.setFloating(is_floating)
            look()
        dock.close()
        look()
        if name != "link":
            dock.show()
    bottom = Qt.DockWidgetArea.BottomDockWidgetArea
    window.addDockWidget(bottom, window.docks["results"])
    look()
    for dock in window.docks.values():
        dock.close()
        look()
    window.reset_layout()
    look()
    for show in (window.showMaximized, window.showNormal):
        show()
        places.add(corner_px(window))
    window.show_page("review")
    window.show_page("live")
    window.resize(*size_px)
    look()
    assert len(places) == 1


def test_the_eye_of_the_next_trial_is_fine_tuned(program: Program) -> None:
    panels = program.window.panels
    left, right = panels.fine_tune.findChildren(QRadioButton)
    assert left.isChecked()
    panels.trials.eye_changed.emit("right")
    assert right.isChecked()
    panels.trials.eye_changed.emit("left")
    assert left.isChecked()


def test_the_page_of_a_stored_session_grows_with_the_window(window: MainWindow) -> None:
    window.resize(3840, 2100)
    window.show_page("review")
    QApplication.processEvents()
    page = window.findChild(ReviewPage)
    assert isinstance(page, ReviewPage)
    assert page.width() > 1200


def test_all_texts_follow_the_theme(qtbot: QtBot, program: Program, snapshot: Maker) -> None:
    window = program.window
    banner = window.findChild(Banner)
    assert banner is not None
    use_theme("light")
    window.show_page("live")
    window.panels.results.show_snapshot(snapshot(State.APPLIED))
    for dock in window.docks.values():
        dock.raise_()
        for tabs in dock.findChildren(QTabWidget):
            for i in range(tabs.count()):
                tabs.setCurrentIndex(i)
                QApplication.processEvents()  # Qt gives a page its style when it is first shown

    def unlike() -> list[str]:
        """Return the enabled widgets with texts in another theme's colours."""
        text = QApplication.palette().windowText().color().lightness()
        return [
            f"{type(one).__name__} {one.objectName()}"
            for one in window.findChildren(QWidget)
            if one.isEnabled() and one is not banner and not banner.isAncestorOf(one)
            if abs(one.palette().windowText().color().lightness() - text)
            > 150  # a verdict has a colour
        ]

    for theme in ("dark", "light", "contrast", "system"):
        use_theme(theme)
        qtbot.waitUntil(lambda: not unlike())
