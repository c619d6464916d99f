"""Blinded comparisons in the window: the answers are in sight in both arrangements."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QPushButton, QToolButton
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal_gui.app.program import Program
from tests.gui.calibrate.conftest import Engine
from tests.gui.calibrate.window.conftest import Maker, press
from tests.gui.helpers import child
from tests.gui.views import NUDGED, begun


def test_the_station_shows_and_takes_the_answers_of_a_comparison(
    program: Program, snapshot: Maker, engine: Engine
) -> None:
    window, guide = program.window, program.wizard_panel
    guide.comparison.submit = engine
    window.show_page("live")
    window.use_arrangement("station")
    guide.show_snapshot(snapshot(State.APPLIED))
    assert not guide.comparison.isVisible()
    seen = snapshot(State.APPLIED, comparing="first", has_compared_both=True)
    guide.show_snapshot(seen)
    assert child(guide, QLabel, "compareAsk").isVisible()
    child(guide, QPushButton, "answer-first").click()
    engine.station.trials.answer.assert_called_once_with("first")
    window.use_arrangement("panels")
    guide.show_snapshot(seen)
    assert not guide.comparison.isVisible(), "the panel has them"


def test_blinking_ends_with_the_result_that_it_is_for(program: Program, snapshot: Maker) -> None:
    guide = program.wizard_panel
    program.window.show_page("live")
    applied = snapshot(State.APPLIED)
    guide.start(begun(is_held=True))
    [blink] = [one for one in guide.findChildren(QToolButton) if "ink before" in one.text()]
    for ends in (
        snapshot(State.VERIFY, procedure={"verifying": NUDGED}),
        snapshot(State.APPLIED, comparing="first"),
        snapshot(State.SHOW_HAND),
    ):
        guide.show_snapshot(applied)
        guide.picture.show_snapshot(applied)
        blink.click()
        assert guide.picture._blink.isActive()
        guide.show_snapshot(ends)
        guide.picture.show_snapshot(ends)
        assert not guide.picture._blink.isActive()
        assert not guide.picture._is_before, "the drawn outline is shown"


def test_in_the_station_the_key_of_trials_says_where_they_are_recorded(
    qtbot: QtBot, program: Program, snapshot: Maker
) -> None:
    window, trials = program.window, program.window.panels.trials
    window.show_page("live")
    trials.show_snapshot(snapshot(State.APPLIED))
    window.use_arrangement("station")
    window.activateWindow()
    qtbot.waitActive(window)
    press(window, Qt.Key.Key_T)
    assert "press F11, then T" in child(window, QLabel, "brief").text()
    window.use_arrangement("panels")
    with qtbot.waitSignal(trials.doubted):  # φ was not moved since
        press(window, Qt.Key.Key_T)
