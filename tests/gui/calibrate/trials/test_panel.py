"""The panel of trials: it guides through them, asks the engine, and shows what came of them."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QCheckBox, QComboBox, QPushButton, QSpinBox, QToolButton, QWidget
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.core.types import EYES, Eye, Rig
from handcal.register.results import Results
from handcal.session.session import Session, SessionRecord
from handcal.session.trial import Comparison, make_trial
from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.fine_tune.panel import FineTunePanel
from handcal_gui.calibrate.trials.comparison_row import ComparisonRow
from handcal_gui.calibrate.trials.panel import TrialPlot, TrialsPanel
from handcal_gui.widgets.table import Table
from tests.gui.calibrate.conftest import Engine
from tests.gui.helpers import button, child, text

Maker = Callable[..., Snapshot]


@pytest.fixture(autouse=True)
def presses_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let each press come two seconds after the one before."""
    times_s = itertools.count(0.0, 2.0)
    monkeypatch.setattr("handcal_gui.calibrate.trials.panel.monotonic", lambda: next(times_s))


@pytest.fixture
def fine_tune(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> FineTunePanel:
    """Return a panel in which φ was moved."""
    panel = FineTunePanel()
    qtbot.addWidget(panel)
    monkeypatch.setattr(FineTunePanel, "is_touched", True)
    return panel


@pytest.fixture
def panel(qtbot: QtBot, engine: Engine, fine_tune: FineTunePanel) -> TrialsPanel:
    panel = TrialsPanel()
    qtbot.addWidget(panel)
    panel.submit = panel.comparison.submit = engine
    panel.fine_tune = fine_tune
    panel.show()
    return panel


def choose(panel: TrialsPanel, name: str, chosen: str) -> None:
    [combo] = (c for c in panel.findChildren(QComboBox) if c.accessibleName() == name)
    combo.setCurrentText(chosen)


def saved(engine: Engine) -> list[tuple[Eye, float]]:
    return [call.args for call in engine.station.trials.save.mock_calls]


def with_trials(seen: Snapshot, *made: tuple[Eye, float]) -> Snapshot:
    """Return a snapshot with trials of the present φ."""
    results = seen.procedure.results
    assert results is not None
    trials = {
        number: make_trial(
            seen.record.rig.eyes[eye], eye, depth_m, results.rendered_shift_m[eye], [0.003, 0, 0]
        )
        for number, (eye, depth_m) in enumerate(made, 1)
    }
    return replace(seen, record=replace(seen.record, trials=trials))


@pytest.mark.parametrize(
    ("state", "said"),
    [
        (None, "Trials are recorded while a session runs."),
        (State.SHOW_HAND, "Solve and apply the alignments first."),
        (State.ALIGN, "Solve and apply the alignments first."),
        (State.SOLVED, "Solve and apply the alignments first."),
        (State.VERIFY, "An eye is being verified; confirm or skip that first."),
    ],
)
def test_needs_an_applied_calibration(
    panel: TrialsPanel, snapshot: Maker, state: State | None, said: str
) -> None:
    if state is not None:
        panel.show_snapshot(snapshot(state))
    assert text(panel, "message") == said
    assert not button(panel, QToolButton, "Record trial").isEnabled()
    assert not child(panel, QCheckBox).isEnabled()


def test_needs_the_eye_to_be_solved(panel: TrialsPanel, snapshot: Maker, results: Results) -> None:
    one = replace(results, eyes={"right": results.eyes["right"]})
    panel.show_snapshot(snapshot(State.APPLIED, procedure={"results": one}))
    assert "right eye, 0.4 m" in text(panel, "message")
    choose(panel, "Eye", "Left eye")
    assert text(panel, "message") == "The left eye has not been aligned."


def test_guides_through_eyes_and_distances_until_none_is_left(
    panel: TrialsPanel, snapshot: Maker, engine: Engine
) -> None:
    child(panel, QSpinBox).setValue(1)
    applied = snapshot(State.APPLIED)
    asked: list[tuple[Eye, float]] = []
    for number in range(1, 7):
        panel.show_snapshot(with_trials(applied, *asked))
        assert text(panel, "message").startswith(f"Trial {number} of 6: ")
        panel.record_action.trigger()
        asked = saved(engine)
    assert asked == [(eye, depth_m) for depth_m in (0.4, 0.5, 0.6) for eye in EYES]
    panel.show_snapshot(with_trials(applied, *asked))
    assert text(panel, "message") == "All 6 trials are recorded. T records more."
    child(panel, QSpinBox).setValue(2)
    assert text(panel, "message").startswith("Trial 7 of 12: left eye, 0.4 m.")


def test_trials_of_an_earlier_phi_do_not_count(
    panel: TrialsPanel, snapshot: Maker, tried: SessionRecord
) -> None:
    panel.show_snapshot(snapshot(State.APPLIED, record=tried))
    assert text(panel, "message").startswith("Trial 1 of 18: left eye, 0.4 m.")


def test_the_key_works_beside_the_panel(qtbot: QtBot, snapshot: Maker, engine: Engine) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    beside, panel = QPushButton("Beside", window), TrialsPanel(window)
    panel.submit = engine
    with qtbot.waitActive(window):
        window.show()
        window.activateWindow()
    panel.show_snapshot(snapshot(State.APPLIED))
    choose(panel, "Eye", "Right eye")
    choose(panel, "Distance of the target", "0.6 m")
    beside.setFocus()
    QTest.keyClick(beside, Qt.Key.Key_T)
    assert saved(engine) == [("right", 0.6)]


def test_a_trial_in_which_nothing_was_moved_must_be_asked_for_twice(
    panel: TrialsPanel, snapshot: Maker, engine: Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FineTunePanel, "is_touched", False)
    doubts: list[str] = []
    panel.doubted.connect(doubts.append)
    panel.show_snapshot(snapshot(State.APPLIED))
    panel.record_action.trigger()
    assert "φ of the left eye has not been moved" in doubts[-1]
    choose(panel, "Eye", "Right eye")
    assert doubts[-1] == ""
    assert saved(engine) == []
    for _ in range(2):
        panel.record_action.trigger()
    assert saved(engine) == [("right", 0.4)]
    panel.record_action.trigger()  # the doubt is new with every trial
    assert len(saved(engine)) == 1
    monkeypatch.setattr(FineTunePanel, "is_touched", True)
    panel.show_snapshot(snapshot(State.APPLIED))
    assert doubts[-1] == ""


def test_a_double_click_or_a_held_key_is_one_press(
    panel: TrialsPanel, snapshot: Maker, engine: Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    presses_s = iter([0.0, 0.2, 1.3])
    monkeypatch.setattr("handcal_gui.calibrate.trials.panel.monotonic", lambda: next(presses_s))
    panel.show_snapshot(snapshot(State.APPLIED))
    for count in (1, 1, 2):
        panel.record_action.trigger()
        assert len(saved(engine)) == count
    assert not panel.record_action.autoRepeat()


def test_the_target_in_the_headset_follows_the_guide_and_ends_with_the_calibration(
    panel: TrialsPanel, snapshot: Maker, engine: Engine
) -> None:
    shows, aside = panel.findChildren(QCheckBox)
    trials = engine.station.trials
    applied = snapshot(State.APPLIED)
    panel.show_snapshot(applied)
    shows.click()
    panel.show_snapshot(applied)
    trials.show_target.assert_called_once_with("left", 0.4, starts_aside=False)
    panel.show_snapshot(with_trials(applied, ("left", 0.4)))
    trials.show_target.assert_called_with("right", 0.4, starts_aside=False)
    aside.click()
    trials.show_target.assert_called_with("right", 0.4, starts_aside=True)
    trials.hide_target.assert_not_called()
    panel.show_snapshot(snapshot(State.ALIGN))
    trials.hide_target.assert_called_once()
    assert not shows.isChecked()


@pytest.mark.parametrize("ends_by", ["another session", "the end of this one"])
def test_the_target_goes_with_its_session(
    panel: TrialsPanel, snapshot: Maker, engine: Engine, ends_by: str
) -> None:
    applied = snapshot(State.APPLIED)
    panel.show_snapshot(applied)
    child(panel, QCheckBox).click()
    if ends_by == "another session":
        panel.set_read_only(False)
    else:
        finished = replace(applied.record, is_finished=True)
        panel.show_snapshot(snapshot(State.APPLIED, record=finished))
    engine.station.trials.hide_target.assert_called_once()


def test_a_comparison_is_begun_answered_once_both_were_shown_and_counted(
    panel: TrialsPanel, snapshot: Maker, engine: Engine, record: SessionRecord
) -> None:
    row = child(panel, ComparisonRow)
    panel.show_snapshot(snapshot(State.APPLIED))
    child(row, QPushButton, "compare").click()
    engine.station.trials.compare.assert_called_once()
    panel.show_snapshot(snapshot(State.APPLIED, comparing="first"))
    assert not child(row, QPushButton, "answer-first").isEnabled()
    child(row, QPushButton, "show-second").click()
    engine.station.trials.show_compared.assert_called_once_with("second")
    panel.show_snapshot(snapshot(State.APPLIED, comparing="second", has_compared_both=True))
    child(row, QPushButton, "answer-second").click()
    engine.station.trials.answer.assert_called_once_with("second")
    child(row, QPushButton, "compareEnd").click()
    engine.station.trials.end_comparison.assert_called_once()
    with Session(record.path) as session:
        for _ in range(2):
            session.save_comparison(Comparison("offline", "second", {"left": np.zeros(3)}))
        session.save_comparison(Comparison("applied", "second", {"left": np.zeros(3)}))
        session.save_comparison(Comparison("offline", "neither", {"left": np.zeros(3)}))
    panel.show_record(Session.open(record.path))
    assert text(panel, "summary").splitlines()[-1] == (
        "Blinded comparisons: with the calibration better in 2 of 4, without it in 1, no "
        "difference in 1."
    )


def test_deletes_and_takes_back(panel: TrialsPanel, tried: SessionRecord, engine: Engine) -> None:
    with Session(tried.path) as session:
        session.delete("alignment", 1)
    panel.show_record(Session.open(tried.path))
    table = child(panel, Table, "trials")
    assert table.keys == [1, 3]
    table.selectRow(1)
    button(panel, QToolButton, "Delete").click()
    engine.station.delete.assert_called_once_with("trial", 3)
    assert text(panel, "undoText") == "Trial 2 deleted.", "alignments are not of this panel"
    QTest.keyClick(panel, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    engine.station.restore.assert_called_once_with("trial", 2)
    panel.set_read_only(True)
    assert text(panel, "undoText") == ""


def test_plot_table_and_text_have_one_statistic(
    panel: TrialsPanel, tried: SessionRecord, rig: Rig
) -> None:
    with Session(tried.path) as session:
        session.save_trial(make_trial(rig.eyes["right"], "right", 0.4, np.zeros(3), [3e-3, 0, 0]))
    tried = Session.open(tried.path)
    panel.show_record(tried)
    plot = child(panel, TrialPlot)
    means = {number: trial.error_arcmin.mean() for number, trial in tried.trials.items()}
    drawn = {line.name(): line.getData() for line in plot.item.listDataItems()}
    _, errors = drawn["Left eye"]
    np.testing.assert_allclose(errors[~np.isnan(errors)], [means[1], means[3]])
    at_m, marks = (values.reshape(-1, 3)[:, :2] for values in drawn["Mean ± SD (≥ 0)"])
    np.testing.assert_allclose(at_m.mean(axis=1), (0.4, 0.4, 0.6, 0.6))
    near = [means[1], means[4]]
    sd = np.std(near, ddof=1)
    np.testing.assert_allclose(marks[0], np.mean(near))
    np.testing.assert_allclose(marks[1], [np.mean(near) - sd, np.mean(near) + sd])
    np.testing.assert_allclose(marks[2:], means[3])  # one trial has no spread
    row = (
        child(panel, Table, "statistics-of-trials")
        .as_text()
        .split("0.4 m\t")[1]
        .splitlines()[0]
        .split("\t")
    )
    assert row[:3] == ["2", f"{np.mean(near):.1f}", f"{sd:.1f}"]
    [ticks] = plot.item.getAxis("bottom")._tickLevels
    assert [name for _, name in ticks] == ["0.4 (n = 2)", "0.5 (n = 0)", "0.6 (n = 1)"]
