"""Blinded comparisons in the trials panel, step by step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from PySide6.QtWidgets import QApplication, QLabel, QPushButton
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.session.comparison import COMPARED
from handcal.session.journal import Event
from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.trials.comparison_row import ComparisonRow
from handcal_gui.calibrate.trials.panel import TrialsPanel
from tests.gui.helpers import button, child, show, text


@pytest.fixture
def panel(qtbot: QtBot) -> TrialsPanel:
    return show(qtbot, TrialsPanel(), 430, 450)


def test_a_blinded_comparison_is_asked_for_step_by_step(
    qtbot: QtBot, panel: TrialsPanel, snapshot: Callable[..., Snapshot]
) -> None:
    begin = button(panel, QPushButton, "Blinded comparison")
    assert not begin.isEnabled()
    applied = snapshot(State.APPLIED)
    panel.show_snapshot(applied)
    with qtbot.waitSignal(panel.compare_requested):
        begin.click()
    first = replace(applied, comparing="first")
    panel.show_snapshot(first)
    assert not begin.isVisible()
    assert not panel.record_action.isEnabled()
    assert text(panel, "message") == "Answer the comparison first, or stop it."
    better = button(panel, QPushButton, "Second is better")
    assert not better.isEnabled()  # before both were shown
    assert better.toolTip() == "Show the first and the second drawing before the answer"
    assert child(panel, QLabel, "compareLook").isVisible()
    second = button(panel, QPushButton, "Show second")
    with qtbot.waitSignal(panel.show_compared_requested) as asked:
        second.click()
    assert asked.args == ["second"]
    assert not second.isChecked()  # until the station shows it
    panel.show_snapshot(replace(first, comparing="second", has_compared_both=True))
    assert second.isChecked()
    assert better.toolTip() == ""
    assert child(panel, QLabel, "compareAsk").isVisible()
    with qtbot.waitSignal(panel.comparison_answered) as answered:
        better.click()
    assert answered.args == ["second"]
    with qtbot.waitSignal(panel.end_comparison_requested):
        button(panel, QPushButton, "Stop comparing").click()
    panel.show_snapshot(applied)
    assert begin.isVisible()
    event = Event(
        99,
        applied.record.events[-1].time,
        COMPARED,
        {"first": "offline", "answer": "first", "applied_shift_m": {}},
    )
    panel.show_record(replace(applied.record, events=(*applied.record.events, event)))
    assert text(panel, "compared") == "1 comparison recorded"
    panel.show_record(applied.record)  # of another session
    assert text(panel, "compared") == ""


def test_no_button_moves_between_the_compared_drawings_and_the_answer(
    panel: TrialsPanel, snapshot: Callable[..., Snapshot]
) -> None:
    first = replace(snapshot(State.APPLIED), comparing="first")
    row = child(panel, ComparisonRow)
    panel.show_snapshot(first)
    QApplication.processEvents()
    before_px = row.heightForWidth(368)
    panel.show_snapshot(replace(first, comparing="second", has_compared_both=True))
    QApplication.processEvents()
    assert row.heightForWidth(368) == before_px
