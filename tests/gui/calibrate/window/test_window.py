"""Pages, sections and keys of the main window."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QToolButton
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal_gui.app.preferences import PreferencesFile
from handcal_gui.app.program import Program
from handcal_gui.calibrate.guide.view import Action
from handcal_gui.calibrate.sections import LEFT, RIGHT, TABS
from handcal_gui.calibrate.window import MainWindow
from tests.gui.calibrate.window.conftest import Maker, main_button, offer_solve, press
from tests.gui.helpers import child

FIVE = (*LEFT, *RIGHT)


def opened(window: MainWindow) -> set[str]:
    """Return the sections that show their panels."""
    return {name for name, one in window.sections.items() if one.isVisible() and one.is_open}


def titles(window: MainWindow) -> set[str]:
    return {name for name, one in window.sections.items() if one.isVisible()}


def title(window: MainWindow, name: str) -> QToolButton:
    return child(window, QToolButton, f"{name}Title")


def test_the_five_panels_are_title_lines_until_they_have_something_to_show(
    window: MainWindow, snapshot: Maker
) -> None:
    assert titles(window) == set()
    window.show_page("live")
    assert titles(window) == set(FIVE)
    assert opened(window) == set()
    assert window.tabs.isVisible()
    assert not window.panels.link.isVisible(), "no pairing key on the first screen"
    window.follow(snapshot(State.SHOW_HAND, frame=None))
    assert opened(window) == set()
    window.follow(snapshot(State.SHOW_HAND))
    assert opened(window) == {"camera", "cloud"}
    window.follow(snapshot(State.ALIGN))
    assert opened(window) == {"camera", "cloud", "rotation"}
    window.follow(snapshot(State.APPLIED))
    assert opened(window) == {"camera", "cloud", "results", "fine_tune"}
    assert titles(window) == set(FIVE), "at every step"


def test_the_guide_has_the_room_of_what_is_folded(window: MainWindow, snapshot: Maker) -> None:
    window.show_page("live")
    QApplication.processEvents()
    alone = window._pages["live"].width()
    window.follow(snapshot(State.APPLIED))
    QApplication.processEvents()
    assert 0.4 * window.width() < window._pages["live"].width() < alone
    assert alone > 0.6 * window.width()


def test_what_somebody_opened_or_folded_stays_so_also_in_the_next_run(
    program: Program, qtbot: QtBot, snapshot: Maker, tmp_path: Path
) -> None:
    window = program.window
    window.show_page("live")
    title(window, "fine_tune").click()
    window.follow(snapshot(State.SHOW_HAND))
    title(window, "camera").click()
    window.follow(snapshot(State.ALIGN))
    assert opened(window) == {"cloud", "rotation", "fine_tune"}
    window.close()
    again = Program(PreferencesFile(tmp_path / "preferences.json"))
    qtbot.addWidget(again.window)
    again.window.show()
    again.window.show_page("live")
    again.window.follow(snapshot(State.SHOW_HAND))
    assert opened(again.window) == {"cloud", "fine_tune"}
    again.window.reset_layout()
    assert opened(again.window) == {"camera", "cloud"}
    again.window.close()


@pytest.mark.parametrize("text", ["{", "[]", '{"chosen": {"camera": 1}}', '{"shares": ["a", 1]}'])
def test_a_damaged_layout_is_the_first_one(window: MainWindow, text: str) -> None:
    before = window.layout_text()
    window.restore_layout(text)
    assert window.layout_text() == before


def test_a_small_window_leaves_nothing_behind(window: MainWindow, snapshot: Maker) -> None:
    window.show_page("live")
    window.follow(snapshot(State.APPLIED))
    widths = []
    for size_px in ((1920, 1050), (1024, 700), (1920, 1050)):
        window.resize(*size_px)
        QApplication.processEvents()
        widths.append([one.width() for one in window.sections.values()])
    assert widths[0] == widths[2]


def test_tabs_open_by_a_click_and_fold_by_another(window: MainWindow, qtbot: QtBot) -> None:
    window.show_page("live")
    bar = window.tabs.tabBar()
    for place, is_open in ((1, True), (2, True), (2, False)):
        where = bar.tabRect(place).center()
        QTest.mouseClick(bar, Qt.MouseButton.LeftButton, pos=where)
        shown = [name for name in TABS if getattr(window.panels, name).isVisible()]
        assert shown == ([TABS[place]] if is_open else [])


def test_a_panel_can_be_a_window_of_its_own_and_comes_back(
    window: MainWindow, snapshot: Maker
) -> None:
    window.show_page("live")
    section = window.sections["results"]
    section.set_apart(True)
    window.follow(snapshot(State.SHOW_HAND))
    assert section.isWindow()
    assert window.panels.results.isVisible()
    section.close()
    assert not section.isWindow()
    assert section.window() is window


def test_keys_work_in_a_panel_that_is_a_window_of_its_own(
    program: Program, window: MainWindow, qtbot: QtBot
) -> None:
    window.show_page("live")
    offer_solve(window)
    asked: list[object] = []
    program.wizard_panel.bar.do = asked.append
    section = window.sections["results"]
    section.set_apart(True)
    section.activateWindow()
    qtbot.waitActive(section)
    QTest.qSleep(2)  # as `press`
    QTest.keyClick(section.windowHandle(), Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: asked == [Action.TAKE_STEP])
    # On a real screen, Qt looks for keys of the main window only from windows of this kind.
    assert section.windowType() is Qt.WindowType.Tool
    window.banner.show_message("The hand is cut by the image border.")
    QTest.keyClick(section.windowHandle(), Qt.Key.Key_Escape)
    assert window.banner.text == ""
    section.close()


def test_a_small_window_leaves_nothing_behind_in_the_next_run(
    program: Program, qtbot: QtBot, snapshot: Maker, tmp_path: Path
) -> None:
    def widths(one: MainWindow) -> list[int]:
        one.resize(1920, 1050)
        one.show_page("live")
        one.follow(snapshot(State.APPLIED))
        QApplication.processEvents()
        return [section.width() for section in one.sections.values()]

    wide = widths(program.window)
    program.window.resize(1024, 700)
    QApplication.processEvents()
    program.window.close()
    again = Program(PreferencesFile(tmp_path / "preferences.json"))
    qtbot.addWidget(again.window)
    again.window.show()
    assert widths(again.window) == wide
    again.window.close()


def test_keys_open_a_panel_and_give_it_the_keyboard(window: MainWindow, qtbot: QtBot) -> None:
    window.show_page("live")
    window.activateWindow()
    qtbot.waitActive(window)
    for key, name in ((Qt.Key.Key_6, "fine_tune"), (Qt.Key.Key_7, "trials")):
        QTest.keyClick(window, key, Qt.KeyboardModifier.ControlModifier)
        panel = getattr(window.panels, name)
        qtbot.waitUntil(panel.hasFocus)
        assert panel.isVisible()
    window.show_page("start")
    window.go_to("trials")
    assert not window.panels.trials.isVisible()


def test_a_stored_session_has_its_panels_open(window: MainWindow) -> None:
    window.show_page("review")
    assert opened(window) == {"cloud", "results"}
    assert window.panels.trials.isVisible()
    assert not window.tabs.isTabVisible(TABS.index("link"))


def test_the_station_view_is_one_labelled_press_and_remembered(
    program: Program, qtbot: QtBot, tmp_path: Path
) -> None:
    window = program.window
    window.show_page("live")
    [switch] = [one for one in window.findChildren(QToolButton) if "Station view" in one.text()]
    assert switch.isVisible()
    switch.click()
    assert titles(window) == set()
    assert not window.tabs.isVisible()
    window.go_to("results")
    assert titles(window) == set()
    window.show_page("review")
    assert titles(window) == {"cloud", "results"}
    again = Program(PreferencesFile(tmp_path / "preferences.json"))
    qtbot.addWidget(again.window)
    again.window.show()
    again.window.show_page("live")
    assert titles(again.window) == set()
    again.window.close()
    window.show_page("live")
    window.activateWindow()
    qtbot.waitActive(window)
    press(window, Qt.Key.Key_F11)
    assert titles(window) == set(FIVE)


def test_escape_closes_the_message_and_the_main_button_stays(
    window: MainWindow, qtbot: QtBot
) -> None:
    window.show_page("live")
    QApplication.processEvents()
    main = main_button(window)
    before = main.mapTo(window, main.rect().bottomRight())
    window.banner.show_message("The hand is cut by the image border. " * 6)
    QApplication.processEvents()
    assert main.mapTo(window, main.rect().bottomRight()) == before
    QTest.keyClick(window, Qt.Key.Key_Escape)
    assert window.banner.text == ""


def test_a_running_calibration_asks_before_the_window_closes(window: MainWindow) -> None:
    window.may_close = lambda: False
    window.close()
    assert window.isVisible()
    window.may_close = lambda: True


def test_the_wearer_is_in_the_title_while_a_session_is_shown(
    window: MainWindow, snapshot: Maker
) -> None:
    window.show_page("live")
    window.show_wearer(replace(snapshot().record, wearer="Ada").wearer)
    assert window.windowTitle() == "Ada – handcal"
    window.show_page("start")
    assert window.windowTitle() == "handcal"
