from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QApplication,
    QCheckBox,
    QComboBox,
    QLabel,
    QPushButton,
    QToolButton,
    QWidget,
)
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.core.types import Eye, EyeShift, Rig
from handcal.register.results import Results
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import make_trial
from handcal.station.snapshot import Snapshot
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.calibrate.trials.panel import TrialsPanel
from handcal_gui.widgets.key_cap import KeyCap
from handcal_gui.widgets.table import Table
from tests.gui.helpers import button, child, text


def test_a_low_panel_shows_four_trials(panel: TrialsPanel, record: SessionRecord, rig: Rig) -> None:
    with Session(record.path) as session:
        session.save_trial(make_trial(rig.eyes["left"], "left", 0.4, np.zeros(3), [1e-3, 0, 0]))
    panel.show_record(Session.open(record.path))
    panel.resize(384, 276)
    for _ in range(3):  # a layout may ask for another
        QApplication.processEvents()
    table = child(panel, Table, "trials")
    assert table.viewport().height() >= 4 * table.rowHeight(0)


def tuned(snapshot: Callable[..., Snapshot]) -> Snapshot:
    """Return what is there once φ of both eyes has been moved by hand."""
    applied_m = snapshot(State.APPLIED).procedure.applied_shift_m
    moved_m = {eye: shift_m + 1e-3 for eye, shift_m in applied_m.items()}
    return snapshot(State.APPLIED, procedure={"applied_shift_m": moved_m})


def choose(panel: TrialsPanel, name: str, text: str) -> None:
    [combo] = (c for c in panel.findChildren(QComboBox) if c.accessibleName() == name)
    combo.setCurrentText(text)


def test_empty(panel: TrialsPanel) -> None:
    assert text(panel, "message") == "Trials are recorded while a session runs."
    assert not button(panel, QToolButton, "Record trial").isEnabled()


@pytest.mark.parametrize("state", [State.SHOW_HAND, State.ALIGN, State.SOLVED, State.APPLYING])
def test_needs_an_applied_calibration(
    panel: TrialsPanel, snapshot: Callable[..., Snapshot], state: State
) -> None:
    panel.show_snapshot(snapshot(state))
    assert text(panel, "message") == "Solve and apply the alignments first."
    assert not button(panel, QToolButton, "Record trial").isEnabled()


def test_needs_the_eye_to_be_solved(
    panel: TrialsPanel, snapshot: Callable[..., Snapshot], results: Results
) -> None:
    one = replace(results, eyes={"right": results.eyes["right"]})
    panel.show_snapshot(snapshot(State.APPLIED, procedure={"results": one}))
    choose(panel, "Eye", "Left eye")
    assert text(panel, "message") == "The left eye has not been aligned."
    choose(panel, "Eye", "Right eye")
    assert button(panel, QToolButton, "Record trial").isEnabled()


def test_asks_for_a_trial_by_key(
    qtbot: QtBot, panel: TrialsPanel, snapshot: Callable[..., Snapshot]
) -> None:
    panel.show_snapshot(tuned(snapshot))
    choose(panel, "Eye", "Right eye")
    choose(panel, "Distance of the target", "0.6 m")
    panel.setFocus()
    with qtbot.waitSignal(panel.trial_requested) as asked:
        QTest.keyClick(panel, Qt.Key.Key_T)
    assert asked.args == ["right", 0.6]


def test_the_key_works_beside_the_panel(qtbot: QtBot, snapshot: Callable[..., Snapshot]) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    beside, panel = QPushButton("Beside", window), TrialsPanel(window)
    with qtbot.waitActive(window):
        window.show()
        window.activateWindow()
    panel.show_snapshot(tuned(snapshot))
    beside.setFocus()
    with qtbot.waitSignal(panel.trial_requested):
        QTest.keyClick(beside, Qt.Key.Key_T)


def test_a_trial_of_nothing_must_be_asked_for_twice(
    qtbot: QtBot, panel: TrialsPanel, snapshot: Callable[..., Snapshot]
) -> None:
    asked: list[tuple[str, float]] = []
    panel.trial_requested.connect(lambda eye, depth_m: asked.append((eye, depth_m)))
    panel.show_snapshot(snapshot(State.APPLIED))
    with qtbot.waitSignal(panel.doubted) as doubted:
        panel.record_action.trigger()
    assert doubted.args is not None
    assert "φ of the left eye has not been fine-tuned: the error would be 0 px" in doubted.args[0]
    with qtbot.waitSignal(panel.doubted) as doubted:
        choose(panel, "Eye", "Right eye")
    assert doubted.args == [""]
    panel.record_action.trigger()
    with qtbot.waitSignal(panel.doubted) as doubted:
        there = snapshot(State.APPLIED)
        panel.show_snapshot(replace(there, record=replace(there.record, is_finished=True)))
    assert doubted.args == [""]
    assert asked == []
    for _ in range(2):
        panel.record_action.trigger()
    assert asked == [("right", 0.4)]
    panel.record_action.trigger()  # the doubt is new with every trial
    assert len(asked) == 1
    panel.show_snapshot(tuned(snapshot))
    panel.record_action.trigger()
    assert len(asked) == 2


def test_a_shift_set_just_now_counts_before_the_headset_has_it(
    qtbot: QtBot, panel: TrialsPanel, snapshot: Callable[..., Snapshot]
) -> None:
    panel.show_snapshot(snapshot(State.APPLIED))
    panel.fine_tuned_m = lambda: tuned(snapshot).procedure.applied_shift_m
    with qtbot.waitSignal(panel.trial_requested), qtbot.assertNotEmitted(panel.doubted):
        panel.record_action.trigger()


def test_the_turn_stays_with_the_only_solved_eye(
    panel: TrialsPanel, tried: SessionRecord, snapshot: Callable[..., Snapshot]
) -> None:
    assert list(tried.trials.values())[-1].eye == "left"
    seen = snapshot(State.APPLIED, record=tried)
    assert seen.procedure.results is not None
    only: dict[Eye, EyeShift] = {"left": seen.procedure.results.eyes["left"]}
    results = replace(seen.procedure.results, eyes=only)
    panel.show_snapshot(replace(seen, procedure=replace(seen.procedure, results=results)))
    assert panel.record_action.isEnabled()
    assert "left eye" in text(panel, "message")


def test_a_double_click_or_a_held_key_is_one_press(
    panel: TrialsPanel, snapshot: Callable[..., Snapshot], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    panel.trial_requested.connect(lambda *_: asked.append("trial"))
    panel.doubted.connect(lambda _: asked.append("doubt"))
    presses_s = iter([0.0, 0.2, 1.3, 1.5, 2.6])
    monkeypatch.setattr("handcal_gui.calibrate.trials.panel.monotonic", lambda: next(presses_s))
    panel.show_snapshot(snapshot(State.APPLIED))
    for _ in range(4):  # two double clicks
        panel.record_action.trigger()
    assert asked == ["doubt", "trial"]
    panel.show_snapshot(tuned(snapshot))
    panel.record_action.trigger()
    assert asked == ["doubt", "trial", "trial"]
    assert not panel.record_action.autoRepeat()


def test_takes_the_eyes_in_turn(
    qtbot: QtBot,
    panel: TrialsPanel,
    snapshot: Callable[..., Snapshot],
    tried: SessionRecord,
    rig: Rig,
) -> None:
    eyes: list[str] = []
    panel.eye_changed.connect(eyes.append)
    panel.show_snapshot(tuned(snapshot))
    assert text(panel, "message") == "Fine-tune φ of the left eye, then record."
    panel.show_snapshot(replace(tuned(snapshot), record=tried))
    panel.show_snapshot(replace(tuned(snapshot), record=tried))
    assert text(panel, "message") == "Fine-tune φ of the right eye, then record."
    assert eyes == ["left", "right"]
    with qtbot.waitSignal(panel.trial_requested) as asked:
        button(panel, QToolButton, "Record trial").click()
    assert asked.args[0] == "right"


def test_the_button_stays_under_the_mouse(
    panel: TrialsPanel, snapshot: Callable[..., Snapshot], tried: SessionRecord
) -> None:
    panel.show_snapshot(tuned(snapshot))
    record = button(panel, QToolButton, "Record trial")
    QApplication.processEvents()
    before = record.geometry()
    panel.show_snapshot(replace(tuned(snapshot), record=tried))
    QApplication.processEvents()
    assert record.geometry() == before


def test_what_to_do_and_its_key_are_in_sight_beside_trials_too(
    panel: TrialsPanel, snapshot: Callable[..., Snapshot], tried: SessionRecord
) -> None:
    panel.resize(360, 290)
    record, message = button(panel, QToolButton, "Record trial"), child(panel, QLabel, "message")
    places = set()
    for seen in (snapshot(State.SHOW_HAND), replace(tuned(snapshot), record=tried)):
        panel.show_snapshot(seen)
        for _ in range(3):  # a layout may ask for another
            QApplication.processEvents()
        assert message.isVisible()
        assert message.geometry().bottom() < record.geometry().top(), "at the top"
        places.add(record.geometry().getRect())
    assert message.text() == "Fine-tune φ of the right eye, then record."
    assert len(places) == 1, "no button moves with it"
    key = child(panel, KeyCap)
    assert (key.text(), key.isVisible()) == ("T", True)
    assert 0 < record.x() - key.geometry().right() < SPACING_PX + 2


def test_the_target_in_the_headset_follows_the_choices(
    panel: TrialsPanel, snapshot: Callable[..., Snapshot]
) -> None:
    asked: list[tuple[str, float] | None] = []
    panel.show_target_requested.connect(lambda eye, depth_m: asked.append((eye, depth_m)))
    panel.hide_target_requested.connect(lambda: asked.append(None))
    box = panel.findChild(QCheckBox)
    assert box is not None
    panel.show_snapshot(snapshot(State.SOLVED))
    assert not box.isEnabled()
    applied = snapshot(State.APPLIED)
    panel.show_snapshot(applied)
    box.click()
    panel.show_snapshot(applied)
    assert asked == [("left", 0.4)], "asked for once"
    choose(panel, "Distance of the target", "0.5 m")
    choose(panel, "Eye", "Right eye")
    assert asked[1:] == [("left", 0.5), ("right", 0.5)]
    box.click()
    assert asked[3:] == [None]
    box.click()
    panel.show_snapshot(snapshot(State.ALIGN))
    assert asked[4:] == [("right", 0.5), None]
    assert not box.isChecked()


@pytest.mark.parametrize("ends_by", ["another session", "the end of this one"])
def test_the_target_goes_with_its_session(
    panel: TrialsPanel, snapshot: Callable[..., Snapshot], ends_by: str
) -> None:
    hidden: list[bool] = []
    panel.hide_target_requested.connect(lambda: hidden.append(True))
    box = panel.findChild(QCheckBox)
    assert box is not None
    applied = snapshot(State.APPLIED)
    panel.show_snapshot(applied)
    box.click()
    if ends_by == "another session":
        panel.set_read_only(False)
    else:
        finished = replace(applied.record, is_finished=True)
        panel.show_snapshot(snapshot(State.APPLIED, record=finished))
    assert hidden == [True]
    assert not box.isChecked()
    assert box.isEnabled() == (ends_by == "the end of this one")  # the guide can go back


def test_a_trial_without_a_touch_since_the_last_is_doubted(
    qtbot: QtBot, panel: TrialsPanel, snapshot: Callable[..., Snapshot], rig: Rig
) -> None:
    there = tuned(snapshot)
    applied_m = there.procedure.applied_shift_m["left"]
    with Session(there.record.path) as session:
        session.save_trial(make_trial(rig.eyes["left"], "left", 0.4, np.zeros(3), applied_m))
    panel.show_snapshot(replace(there, record=Session.open(there.record.path)))
    choose(panel, "Eye", "Left eye")
    choose(panel, "Distance of the target", "0.4 m")
    with qtbot.waitSignal(panel.doubted) as doubted:
        panel.record_action.trigger()
    assert "has not been touched since its last trial" in doubted.args[0]
    with qtbot.waitSignal(panel.trial_requested):
        panel.record_action.trigger()
    choose(panel, "Distance of the target", "0.5 m")
    with qtbot.waitSignal(panel.trial_requested):
        panel.record_action.trigger()


def test_shows_trials_and_statistics(panel: TrialsPanel, tried: SessionRecord) -> None:
    panel.show_record(tried)
    table = child(panel, Table, "trials")
    numbers = [table.model().index(row, 0).data() for row in range(table.model().rowCount())]
    assert numbers == ["1", "3"]
    means = [trial.error_arcmin.mean() for trial in tried.trials.values()]
    assert text(panel, "summary") == (
        f"2 trials of 1 calibration: mean {np.mean(means):.1f}′, SD between trials "
        f"{np.std(means, ddof=1):.1f}′. One calibration cannot tell how the next one turns out."
    )
    statistics = child(panel, Table, "statistics-of-trials")
    assert "0.4 m" in statistics.as_text()
    assert "0.5 m" not in statistics.as_text()


def test_deletes_and_takes_back(qtbot: QtBot, panel: TrialsPanel, tried: SessionRecord) -> None:
    with Session(tried.path) as session:
        session.delete("alignment", 1)
    panel.show_record(Session.open(tried.path))
    table = child(panel, Table, "trials")
    table.selectRow(1)
    with qtbot.waitSignal(panel.delete_requested) as asked:
        button(panel, QToolButton, "Delete").click()
    assert asked.args == ["trial", 3]
    assert text(panel, "undoText") == "Trial 2 deleted.", "alignments are not of this panel"
    with qtbot.waitSignal(panel.restore_requested) as asked:
        QTest.keyClick(panel, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert asked.args == ["trial", 2]


def test_a_finished_session_is_only_looked_at(panel: TrialsPanel, tried: SessionRecord) -> None:
    panel.set_read_only(True)
    panel.show_record(tried)
    assert not button(panel, QToolButton, "Record trial").isEnabled()
    assert text(panel, "undoText") == ""


def test_a_trial_is_of_the_calibrated_shift_not_the_solved_one(panel: TrialsPanel) -> None:
    hint = text(panel, "trialsHint")
    assert "the error of the calibrated φ relative to the φ with which" in hint
    assert "0 for an eye that keeps the offline calibration" in hint
    assert "calibrated φ" in panel.record_action.toolTip()
