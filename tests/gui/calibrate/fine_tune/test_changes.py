"""φ that was set: undone, reset, compared with others, and kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from handcal_gui.calibrate.fine_tune.history import same_shifts
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.core.types import EYES, Rig, Verdict
from handcal.register.results import Results
from handcal_gui.calibrate.fine_tune.panel import FineTunePanel
from handcal_gui.calibrate.fine_tune.stream import PERIOD_MS, SETTLE_MS, Shifts
from tests.gui.calibrate.fine_tune.controls import (
    Show,
    action,
    editor,
    field,
    fields_mm,
    status,
    texts,
)

OFFLINE: Shifts = {eye: np.zeros(3) for eye in EYES}


def test_starts_again_with_another_wearer(panel: FineTunePanel, show: Show, rig: Rig) -> None:
    show()
    field(panel, "left", 1).setValue(4.0)
    panel.set_rig(rig)
    assert fields_mm(panel, "left") == [0.0, 0.0, 0.0]
    assert not action(panel, "Undo").isEnabled()


def test_what_others_replace_is_an_undo_away(
    qtbot: QtBot, panel: FineTunePanel, show: Show, results: Results, sent: list[Shifts]
) -> None:
    def set_by_others(shifts_m: Shifts) -> None:
        show(procedure={"applied_shift_m": shifts_m})
        np.testing.assert_allclose(fields_mm(panel, "left"), 1e3 * shifts_m["left"], atol=0.005)

    show()
    field(panel, "left", 1).setValue(4.0)
    fine_tuned_mm = fields_mm(panel, "left")
    qtbot.waitUntil(lambda: bool(sent))
    for moved_m in (0.001, 0.002):  # as without an alignment, and with another in its place
        set_by_others({eye: results.eyes[eye].shift_m + moved_m for eye in EYES})
        assert status(panel).startswith("The φ you set was replaced. Ctrl+")
    sent.clear()
    action(panel, "Undo").trigger()
    assert fields_mm(panel, "left") == fine_tuned_mm
    qtbot.waitUntil(lambda: bool(sent))
    set_by_others(fine_tuned := sent[-1])
    assert "replaced" not in status(panel)
    set_by_others(OFFLINE)  # by G
    assert "replaced" in status(panel)
    set_by_others(fine_tuned)  # by G once more
    assert "replaced" not in status(panel)
    action(panel, "Undo").trigger()
    assert not action(panel, "Undo").isEnabled(), "the solved φ was not set by hand"


def test_undo_and_redo(
    qtbot: QtBot, panel: FineTunePanel, show: Show, results: Results, sent: list[Shifts]
) -> None:
    show()
    before_mm = fields_mm(panel, "left")
    field(panel, "left", 1).setValue(1.0)
    field(panel, "left", 3).setValue(3.0)
    after_mm = fields_mm(panel, "left")
    focused = field(panel, "left", 3)
    focused.setFocus()
    ctrl, shift = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier
    for _ in range(2):
        QTest.keyClick(focused.lineEdit(), Qt.Key.Key_Z, ctrl)
    assert fields_mm(panel, "left") == before_mm
    qtbot.waitUntil(lambda: bool(sent))
    assert same_shifts(sent[-1], {eye: results.eyes[eye].shift_m for eye in EYES})
    for _ in range(2):
        QTest.keyClick(focused.lineEdit(), Qt.Key.Key_Z, ctrl | shift)
    assert fields_mm(panel, "left") == after_mm
    assert not action(panel, "Redo").isEnabled()


def test_nudges_that_follow_closely_are_undone_together(
    qtbot: QtBot, panel: FineTunePanel, show: Show
) -> None:
    show()
    before_mm = fields_mm(panel, "left")
    for _ in range(3):
        QTest.keyClick(panel, Qt.Key.Key_Right)
    with qtbot.waitSignal(panel.shift_settled, timeout=5 * SETTLE_MS):
        pass
    once_mm = fields_mm(panel, "left")
    QTest.keyClick(panel, Qt.Key.Key_Right)
    action(panel, "Undo").trigger()
    assert fields_mm(panel, "left") == once_mm
    action(panel, "Undo").trigger()
    assert fields_mm(panel, "left") == before_mm


def test_resets(
    panel: FineTunePanel, show: Show, sent: list[Shifts], results: Results, qtbot: QtBot
) -> None:
    show()
    action(panel, "Reset to offline").trigger()
    assert fields_mm(panel, "left") == [0.0, 0.0, 0.0]
    qtbot.waitUntil(lambda: bool(sent))
    assert same_shifts(sent[-1], OFFLINE)
    action(panel, "Reset to solved").trigger()
    qtbot.waitUntil(lambda: len(sent) > 1)
    assert same_shifts(sent[-1], {eye: results.eyes[eye].shift_m for eye in EYES})


def test_nothing_solved_leaves_the_offline_calibration_to_begin_with(
    panel: FineTunePanel, show: Show
) -> None:
    show(State.SHOW_HAND)
    assert field(panel, "left", 1).isEnabled()
    assert not action(panel, "Reset to solved").isEnabled()
    assert not action(panel, "Show solved").isEnabled()
    assert any("against the offline φ" in text for text in texts(panel))


def test_showing_the_offline_calibration_loses_nothing(
    qtbot: QtBot, panel: FineTunePanel, show: Show, sent: list[Shifts]
) -> None:
    show()
    field(panel, "left", 1).setValue(4.0)
    set_mm = fields_mm(panel, "left")
    with qtbot.waitSignal(panel.shift_settled):  # what was set is recorded first
        QTest.keyClick(panel, Qt.Key.Key_B)
    assert sent[-1]["left"][0] == pytest.approx(0.004)
    qtbot.waitUntil(lambda: same_shifts(sent[-1], OFFLINE))
    show(procedure={"applied_shift_m": sent[-1]})
    assert fields_mm(panel, "left") == [0.0, 0.0, 0.0]  # what is drawn
    assert not field(panel, "left", 1).isEnabled()
    with qtbot.assertNotEmitted(panel.shift_settled, wait=SETTLE_MS + 5 * PERIOD_MS):
        QTest.keyClick(panel, Qt.Key.Key_B)
    assert sent[-1]["left"][0] == pytest.approx(0.004)
    assert fields_mm(panel, "left") == set_mm
    assert field(panel, "left", 1).isEnabled()


def test_only_one_is_shown_instead(
    qtbot: QtBot, panel: FineTunePanel, show: Show, sent: list[Shifts], results: Results
) -> None:
    show()
    field(panel, "left", 1).setValue(4.0)
    QTest.keyClick(panel, Qt.Key.Key_B)
    QTest.keyClick(panel, Qt.Key.Key_S)
    assert not action(panel, "Show offline").isChecked()
    solved_m = {eye: results.eyes[eye].shift_m for eye in EYES}
    qtbot.waitUntil(lambda: bool(sent) and same_shifts(sent[-1], solved_m))


def test_showing_solved_can_be_ended_when_nothing_is_solved_any_more(
    qtbot: QtBot, panel: FineTunePanel, show: Show, sent: list[Shifts]
) -> None:
    show()
    field(panel, "left", 1).setValue(4.0)
    QTest.keyClick(panel, Qt.Key.Key_S)
    qtbot.waitUntil(lambda: len(sent) > 1)
    show(procedure={"results": None, "applied_shift_m": sent[-1]})
    action(panel, "Show solved").trigger()
    qtbot.waitUntil(lambda: sent[-1]["left"][0] == pytest.approx(0.004))
    assert field(panel, "left", 1).isEnabled()


def test_settles_at_once_before_a_trial(
    qtbot: QtBot, panel: FineTunePanel, show: Show, sent: list[Shifts]
) -> None:
    show()
    field(panel, "left", 1).setValue(4.0)
    with qtbot.waitSignal(panel.shift_settled):
        panel.settle()
    assert [shifts_m["left"][0] for shifts_m in sent] == pytest.approx([0.004])


def test_a_hidden_panel_leaves_the_headset_with_what_was_set(
    qtbot: QtBot, panel: FineTunePanel, show: Show, sent: list[Shifts]
) -> None:
    show()
    field(panel, "left", 1).setValue(4.0)
    QTest.keyClick(panel, Qt.Key.Key_B)
    qtbot.waitUntil(lambda: bool(sent) and same_shifts(sent[-1], OFFLINE))
    panel.hide()
    assert sent[-1]["left"][0] == pytest.approx(0.004)
    assert not action(panel, "Show offline").isChecked()


def test_new_projections_start_again(panel: FineTunePanel, show: Show) -> None:
    show()
    panel.hide()
    panel.show()
    applied_m = {eye: np.array([0.001, 0.002, 0.003]) for eye in EYES}
    show(procedure={"applied_shift_m": applied_m})
    assert fields_mm(panel, "left") == [1.0, 2.0, 3.0]
    assert not action(panel, "Undo").isEnabled()


def test_the_effect_is_against_the_calibrated_shift_of_an_eye_that_keeps_the_offline_calibration(
    panel: FineTunePanel, show: Show, results: Results
) -> None:
    verdicts = {**results.verdicts, "left": Verdict("keep", "as told")}
    kept = {
        "results": replace(results, verdicts=verdicts),
        "applied_shift_m": {"left": np.zeros(3), "right": results.eyes["right"].shift_m},
    }
    show(procedure=kept)
    assert "against the calibrated φ" in texts(panel)
    assert "+0.00 %" in texts(editor(panel, "left"))
    action(panel, "Show solved").trigger()
    assert "+0.00 %" not in texts(editor(panel, "left"))
    assert "+0.00 %" in texts(editor(panel, "right"))
