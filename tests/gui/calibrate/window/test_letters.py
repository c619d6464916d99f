"""Letters with Alt, and keys of panels: each leads to one place, and every button has one."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QHelpEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QCheckBox,
    QComboBox,
    QLineEdit,
    QPushButton,
    QTabBar,
    QTabWidget,
    QToolButton,
    QToolTip,
    QWidget,
)
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.register.results import Results
from handcal.session.session import SessionRecord
from handcal_gui.app.program import Program
from handcal_gui.calibrate.docks import is_in_sight
from handcal_gui.calibrate.guide import result_bar
from handcal_gui.calibrate.parts.legend import LegendEntry
from handcal_gui.calibrate.parts.record_tabs import RecordTabs
from handcal_gui.calibrate.review_page import ReviewPage
from tests.gui.calibrate.window.conftest import Maker, press, say
from tests.gui.helpers import button, child, letters
from tests.gui.views import all_views, begun

EACH_SIZE = pytest.mark.parametrize("size_px", [(960, 510), (1920, 1050)])


def raised(qtbot: QtBot, program: Program) -> Iterator[list[QWidget]]:
    """Raise each dock and each of its tabs in turn, and yield the docks then in sight."""
    docks = [dock for dock in program.window.docks.values() if not dock.isHidden()]
    for dock in docks:
        dock.raise_()
        qtbot.waitUntil(partial(is_in_sight, dock))
        tabs = dock.findChildren(QTabWidget)
        for i in range(max([1, *(tab.count() for tab in tabs)])):
            for tab in tabs:
                tab.setCurrentIndex(i)
            QApplication.processEvents()
            yield [one.widget() for one in docks if is_in_sight(one)]


def of_docks(qtbot: QtBot, program: Program) -> list[list[str]]:
    """Return the letters of the docks that can be in sight together."""
    return [
        [letter for dock in docks for letter in letters(dock, is_shown=True)]
        for docks in raised(qtbot, program)
    ]


def begin(program: Program, snapshot: Maker, size_px: tuple[int, int], **changes: object) -> None:
    window, seen = program.window, snapshot(State.APPLIED, **changes)
    window.resize(*size_px)
    window.show_page("live")
    window.panels.link.show_pairing("192.168.178.105:50123", "a pairing key", is_virtual=True)
    for panel in window.panels.all():
        panel.show_snapshot(seen)


@EACH_SIZE
def test_each_letter_of_a_calibration_leads_to_one_place(
    qtbot: QtBot, program: Program, snapshot: Maker, record: SessionRecord, size_px: tuple[int, int]
) -> None:
    window, guide = program.window, program.wizard_panel
    panels = []
    for changes in ({}, {"comparing": "first", "has_compared_both": True}):
        begin(program, snapshot, size_px, **changes)
        child(window, QPushButton, "comparison-cancel").show()  # while it is solved
        panels += of_docks(qtbot, program)
    assert {letter for shown in panels for letter in shown} == {*"wctnkpog"}
    menus = letters(window, is_shown=True)[:4]
    assert menus == [*"fevh"]
    for view in all_views(snapshot, record):
        say(program, snapshot(State.APPLIED), view)
        around = [letter for one in (guide, guide.bar) for letter in letters(one, is_shown=True)]
        for shown in panels:
            found = [*menus, *around, *shown]
            assert len(set(found)) == len(found), (view.sentence, "".join(found))


def test_every_button_of_the_guide_shows_its_letter_or_key(
    program: Program, snapshot: Maker, record: SessionRecord
) -> None:
    begin(program, snapshot, (1280, 690))
    guide = program.wizard_panel
    main = child(guide.bar, QPushButton, "wizardMain")  # its key is drawn beside it
    for view in all_views(snapshot, record):
        say(program, snapshot(State.APPLIED), view)
        buttons = [one for part in (guide, guide.bar) for one in part.findChildren(QAbstractButton)]
        for one in buttons:
            told = re.search(r"&|\(.+\)", one.text())
            assert told or one is main or not one.isVisible(), one.text()


@pytest.mark.parametrize(
    ("key", "modifier", "done"),
    [
        (Qt.Key.Key_P, Qt.KeyboardModifier.ControlModifier, "ask_printer"),
        (Qt.Key.Key_Y, Qt.KeyboardModifier.AltModifier, "copy_text"),
    ],
)
def test_keys_print_and_copy_a_result_in_sight_only(
    qtbot: QtBot,
    program: Program,
    snapshot: Maker,
    record: SessionRecord,
    monkeypatch: pytest.MonkeyPatch,
    key: Qt.Key,
    modifier: Qt.KeyboardModifier,
    done: str,
) -> None:
    calls: list[object] = []
    monkeypatch.setattr(result_bar, done, lambda *told: calls.append(told))
    begin(program, snapshot, (1280, 690))
    program.window.activateWindow()
    qtbot.waitActive(program.window)
    program.wizard_panel.start(begun())
    for state in (State.ALIGN, State.APPLIED):
        assert not calls
        seen = snapshot(state)
        program.wizard_panel.show_snapshot(seen)
        program.wizard_panel.picture.show_snapshot(seen)
        press(program.window, key, modifier)
    qtbot.waitUntil(lambda: len(calls) == 1)


def test_a_letter_leads_to_the_panel_in_sight_and_to_none_behind_tabs(
    qtbot: QtBot, program: Program, snapshot: Maker
) -> None:
    begin(program, snapshot, (1920, 1050))
    window, panels = program.window, program.window.panels
    window.activateWindow()
    qtbot.waitActive(window)
    alt = Qt.KeyboardModifier.AltModifier
    whole = child(panels.wearer_view, QCheckBox, "wearer-view-whole")
    shown = button(panels.link, QPushButton, "Show key")
    eye_distance = child(panels.session, QLineEdit, "eyeDistance")
    window.docks["link"].raise_()
    for key in (Qt.Key.Key_W, Qt.Key.Key_O, Qt.Key.Key_G):  # of panels behind it
        press(window, key, alt)
    press(window, Qt.Key.Key_K, alt)
    qtbot.waitUntil(shown.isChecked)
    assert not whole.isChecked()
    window.docks["wearer_view"].raise_()
    press(window, Qt.Key.Key_W, alt)
    qtbot.waitUntil(whole.isChecked)
    window.docks["session"].raise_()
    press(window, Qt.Key.Key_T, alt)
    qtbot.waitUntil(eye_distance.hasFocus)
    window.docks["trials"].raise_()
    with qtbot.waitSignal(panels.trials.compare_requested):
        press(window, Qt.Key.Key_C, alt)  # also of two panels behind it


@EACH_SIZE
def test_each_letter_of_a_stored_session_leads_to_one_place(
    qtbot: QtBot,
    program: Program,
    record: SessionRecord,
    results: Results,
    size_px: tuple[int, int],
) -> None:
    window = program.window
    window.resize(*size_px)
    review = child(window, ReviewPage)
    review.show_session(record, results, 8.0)
    window.panels.session.show_record(record, results)
    window.panels.results.show_results(results, record.alignments)
    window.show_page("review")
    around = letters(review, is_shown=True)
    assert len(around) == 5
    for shown in of_docks(qtbot, program):
        found = [*"fevh", *around, *shown]
        assert len(set(found)) == len(found), "".join(found)


def test_every_button_of_a_panel_has_a_letter_or_names_its_key(
    qtbot: QtBot, program: Program, snapshot: Maker
) -> None:
    for changes in ({}, {"comparing": "first", "has_compared_both": True}):
        begin(program, snapshot, (1920, 1050), **changes)
        for docks in raised(qtbot, program):
            for dock in docks:
                kinds = (QCheckBox, QPushButton, QToolButton)
                for one in (found for kind in kinds for found in dock.findChildren(kind)):
                    entry = one.parentWidget()
                    told = entry.toolTip() if isinstance(entry, LegendEntry) else one.toolTip()
                    has_key = "&" in one.text() or re.search(r"\(.+\)", told)
                    assert has_key or not one.isVisible(), (one.text(), told)


def test_lists_of_panels_name_the_key_that_chooses_their_next_entry(
    qtbot: QtBot, program: Program, snapshot: Maker
) -> None:
    begin(program, snapshot, (1920, 1050))
    window = program.window
    window.activateWindow()
    qtbot.waitActive(window)
    keys = {"trials": [Qt.Key.Key_E, Qt.Key.Key_D], "fine_tune": [Qt.Key.Key_D]}
    for name, chosen in {"camera": [Qt.Key.Key_M], **keys}.items():
        window.go_to(name)
        qtbot.waitUntil(partial(is_in_sight, window.docks[name]))
        boxes = window.docks[name].findChildren(QComboBox)
        assert len(boxes) == len(chosen)
        for box, key in zip(boxes, chosen, strict=True):
            assert box.toolTip().endswith(f"({key.name.removeprefix('Key_')})")
            before, seen = box.currentText(), set()
            for _ in range(box.count()):
                press(window, key)
                seen.add(box.currentText())
            assert len(seen) == box.count()
            assert box.currentText() == before


def test_keys_reset_what_is_fine_tuned(qtbot: QtBot, program: Program, snapshot: Maker) -> None:
    begin(program, snapshot, (1920, 1050))
    window, panel = program.window, program.window.panels.fine_tune
    window.activateWindow()
    qtbot.waitActive(window)
    window.go_to("fine_tune")
    shift = Qt.KeyboardModifier.ShiftModifier
    for key, is_offline in ((Qt.Key.Key_B, True), (Qt.Key.Key_S, False)):
        press(window, key, shift)
        assert [not part.any() for part in panel.shift_m().values()] == [is_offline] * 2


def test_ctrl_tab_shows_the_next_tab_of_a_panel(
    qtbot: QtBot, program: Program, snapshot: Maker
) -> None:
    begin(program, snapshot, (1920, 1050))
    window = program.window
    window.activateWindow()
    qtbot.waitActive(window)
    for name in ("trials", "session"):
        window.docks[name].raise_()
        tabs = child(window.docks[name], RecordTabs)
        tabs.currentWidget().setFocus()
        for place in (1, 2, 0):
            press(window, Qt.Key.Key_Tab, Qt.KeyboardModifier.ControlModifier)
            assert tabs.currentIndex() == place


def test_tabs_of_panels_name_their_keys_also_where_they_are_icons(
    program: Program, snapshot: Maker
) -> None:
    for size_px in ((960, 510), (1920, 1050)):
        begin(program, snapshot, size_px)
        program.window.reset_layout()
        QApplication.processEvents()
        direct = Qt.FindChildOption.FindDirectChildrenOnly
        bars = program.window.findChildren(QTabBar, options=direct)
        tabs = {
            bar.tabText(i): bar.tabToolTip(i)
            for bar in bars
            if bar.isVisible()
            for i in range(bar.count())
        }
        assert tabs["Session"] == "Session (Ctrl+8)"
        [bar] = [one for one in bars if one.isVisible()]
        place = bar.tabRect(1).center()
        help_wanted = QHelpEvent(QEvent.Type.ToolTip, place, bar.mapToGlobal(place))
        QApplication.sendEvent(bar, help_wanted)
        assert QToolTip.text() == bar.tabToolTip(1)
        QToolTip.hideText()
        assert all(tip.startswith(f"{text} (Ctrl+") for text, tip in tabs.items())
