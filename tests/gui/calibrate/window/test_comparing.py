"""Blinded comparisons in the window: the answers are in sight in both arrangements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QLabel, QPushButton, QScrollArea
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.core.types import Rig
from handcal.session.session import SessionRecord
from handcal.session.trial import make_trial
from handcal_gui.app.program import Program
from tests.gui.calibrate.window.conftest import Maker, press
from tests.gui.helpers import button, child, letters

BUTTONS = {
    "Show first": "W",
    "Show second": "O",
    "Stop comparing": "P",
    "First is better": "T",
    "Second is better": "C",
    "Neither": "N",
}
"""Buttons of a comparison and their letters."""
_ALT = Qt.KeyboardModifier.AltModifier


def settle() -> None:
    for _ in range(3):  # a layout may ask for another
        QApplication.processEvents()


@pytest.mark.parametrize("text_scale", [1.0, 1.25], indirect=True)
@pytest.mark.parametrize("size_px", [(960, 510), (1280, 690), (1920, 1050)])
def test_the_station_shows_the_answers_of_a_comparison(
    qtbot: QtBot, program: Program, snapshot: Maker, size_px: tuple[int, int]
) -> None:
    window, guide, trials = program.window, program.wizard_panel, program.window.panels.trials
    window.resize(*size_px)
    window.show_page("live")
    window.use_arrangement("station")
    window.activateWindow()
    qtbot.waitActive(window)
    guide.show_snapshot(snapshot(State.APPLIED))
    assert not guide.comparison.isVisible()
    seen = snapshot(State.APPLIED, comparing="first", has_compared_both=True)
    for panel in (guide, trials, guide.picture):
        panel.show_snapshot(seen)
    settle()
    area = guide.parent().parent()  # type: ignore[union-attr]
    assert isinstance(area, QScrollArea)
    assert area.verticalScrollBar().maximum() == 0
    for text in BUTTONS:
        shown = button(guide, QPushButton, text)
        assert shown.visibleRegion().boundingRect() == shown.rect(), text
    asked = child(guide, QLabel, "compareAsk")
    assert asked.heightForWidth(asked.width()) <= asked.height()
    found = [one for part in (window, guide.bar) for one in letters(part, is_shown=True)]
    assert all(found.count(letter.lower()) == 1 for letter in BUTTONS.values()), found
    asks: list[str] = []
    trials.show_compared_requested.connect(lambda place: asks.append(f"show {place}"))
    trials.comparison_answered.connect(asks.append)
    trials.end_comparison_requested.connect(lambda: asks.append("end"))
    for letter in BUTTONS.values():
        press(window, getattr(Qt.Key, f"Key_{letter}"), _ALT)
    expected = ["show first", "show second", "end", "first", "second", "neither"]
    qtbot.waitUntil(lambda: len(asks) == len(expected))
    assert sorted(asks) == sorted(expected)
    window.use_arrangement("panels")
    guide.show_snapshot(seen)
    assert not guide.comparison.isVisible(), "the panel has them"


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
    said = child(window, QLabel, "brief").text()
    assert said == "Trials are recorded once φ is solved, beside the panels: press F11, then T"
    window.use_arrangement("panels")
    with qtbot.waitSignal(trials.doubted):  # φ was not moved since
        press(window, Qt.Key.Key_T)


@pytest.mark.parametrize("text_scale", [1.0, 1.25], indirect=True)
@pytest.mark.parametrize("size_px", [(960, 510), (1280, 690), (1280, 720)])
@pytest.mark.parametrize("count", [0, 3])
def test_the_trials_panel_shows_a_comparison_whole(
    program: Program,
    snapshot: Maker,
    record: SessionRecord,
    rig: Rig,
    size_px: tuple[int, int],
    count: int,
) -> None:
    trial = make_trial(rig.eyes["left"], "left", 0.4, np.zeros(3), [1e-3, 0.0, 0.0])
    tried = replace(record, trials=dict.fromkeys(range(1, count + 1), trial))
    window, trials = program.window, program.window.panels.trials
    window.resize(*size_px)
    window.show_page("live")
    window.docks["trials"].raise_()
    trials.show_snapshot(snapshot(State.APPLIED, record=tried))
    settle()
    hint = child(trials, QLabel, "trialsHint")
    assert hint.isVisible() is (count == 0)
    for has_both, name in ((False, "compareLook"), (True, "compareAsk")):
        seen = snapshot(State.APPLIED, comparing="first", has_compared_both=has_both, record=tried)
        trials.show_snapshot(seen)
        settle()
        assert not hint.isVisible()
        asked = child(trials, QLabel, name)
        assert asked.isVisible()
        assert asked.heightForWidth(asked.width()) <= asked.height()
        for shown in (asked, *(button(trials, QPushButton, text) for text in BUTTONS)):
            assert shown.visibleRegion().boundingRect() == shown.rect(), shown.objectName()
