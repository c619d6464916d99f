"""φ set by hand: moved by keys, fields and sliders, undone, reset, and compared."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QSlider
from pytestqt.qtbot import QtBot

from handcal.calibration.states import MAX_HAND_SET_SHIFT_M, State
from handcal.core.display import DrawnMove, effect_at
from handcal.core.types import EYES, Rig, Verdict
from handcal.register.results import Results
from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.fine_tune.panel import (
    PERIOD_MS,
    SETTLE_MS,
    FineTunePanel,
    Shifts,
    is_same_shifts,
)
from tests.gui.calibrate.conftest import Engine
from tests.gui.calibrate.fine_tune.controls import Show, action, editor, field, fields_mm, status
from tests.gui.helpers import text
from tests.gui.views import NUDGED

OFFLINE: Shifts = {eye: np.zeros(3) for eye in EYES}
CTRL, SHIFT = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier


@pytest.fixture
def panel(qtbot: QtBot, rig: Rig, engine: Engine) -> FineTunePanel:
    panel = FineTunePanel()
    panel.submit = engine
    qtbot.addWidget(panel)
    panel.set_rig(rig)
    panel.show()
    return panel


@pytest.fixture
def show(panel: FineTunePanel, snapshot: Callable[..., Snapshot]) -> Show:
    """Show the panel, twice, what the headset renders with: by default as solved."""

    def show(
        state: State = State.APPLIED, procedure: Mapping[str, Any] = {}, **changes: Any
    ) -> None:
        for _ in range(2):
            now_ns = time.monotonic_ns()
            panel.show_snapshot(snapshot(state, procedure=procedure, t_host_ns=now_ns, **changes))

    return show


@pytest.fixture
def sent(engine: Engine) -> Callable[[], list[Shifts]]:
    """Return the φ that the engine was given so far."""
    return lambda: [call.args[0] for call in engine.station.calibration.set_shift.mock_calls]


@pytest.fixture
def last(qtbot: QtBot, sent: Callable[[], list[Shifts]]) -> Callable[[], Shifts]:
    """Return the newest φ once all is sent."""

    def last() -> Shifts:
        qtbot.wait(2 * PERIOD_MS)
        return sent()[-1]

    return last


def solved(results: Results) -> Shifts:
    return {eye: results.eyes[eye].shift_m for eye in EYES}


def test_shows_what_the_headset_renders_with_and_begins_again_with_a_session(
    panel: FineTunePanel, show: Show, results: Results, rig: Rig
) -> None:
    assert "starts with a session" in status(panel)
    assert not field(panel, "left", 1).isEnabled()
    show()
    for eye in EYES:
        np.testing.assert_allclose(
            fields_mm(panel, eye), 1e3 * results.eyes[eye].shift_m, atol=0.005
        )
    assert status(panel) == "In the headset."
    field(panel, "left", 1).setValue(4.0)
    panel.set_rig(rig)
    assert fields_mm(panel, "left") == [0.0, 0.0, 0.0]
    assert not action(panel, "Undo").isEnabled()


@pytest.mark.parametrize(
    "changes",
    [
        {"state": State.ALIGN},
        {"state": State.ALIGNED},
        {"state": State.SOLVED},
        {"state": State.APPLYING},
        {"link": {"connected": False}},
        {"comparing": "first"},
    ],
)
def test_cannot_be_used_while_phi_is_not_to_be_moved(
    panel: FineTunePanel,
    show: Show,
    sent: Callable[[], list[Shifts]],
    changes: dict[str, Any],
    qtbot: QtBot,
) -> None:
    show(**changes)
    assert status(panel) != "In the headset."
    assert not field(panel, "left", 1).isEnabled()
    QTest.keyClick(panel, Qt.Key.Key_Right)
    qtbot.wait(2 * PERIOD_MS)
    assert sent() == []


@pytest.mark.parametrize(
    ("key", "points"),
    [
        (Qt.Key.Key_Right, lambda move: move.right_px > 0.0),
        (Qt.Key.Key_Left, lambda move: move.right_px < 0.0),
        (Qt.Key.Key_Up, lambda move: move.up_px > 0.0),
        (Qt.Key.Key_Down, lambda move: move.up_px < 0.0),
        (Qt.Key.Key_PageUp, lambda move: move.size_ratio > 1.0),
        (Qt.Key.Key_PageDown, lambda move: move.size_ratio < 1.0),
    ],
)
def test_keys_move_the_picture_of_the_chosen_eye_their_way(
    panel: FineTunePanel,
    show: Show,
    last: Callable[[], Shifts],
    results: Results,
    rig: Rig,
    key: Qt.Key,
    points: Callable[[DrawnMove], bool],
) -> None:
    show()
    QTest.keyClick(panel, Qt.Key.Key_3)  # by 1 mm
    QTest.keyClick(panel, Qt.Key.Key_E)
    QTest.keyClick(panel, key)
    before_m, after_m = solved(results), last()
    np.testing.assert_array_equal(after_m["left"], before_m["left"])
    assert np.abs(after_m["right"] - before_m["right"]).max() == pytest.approx(0.001)
    assert points(effect_at(rig.eyes["right"], before_m["right"], after_m["right"], 0.5))


def test_fields_and_sliders_move_one_eye_or_both_up_to_the_engines_limit(
    panel: FineTunePanel, show: Show, last: Callable[[], Shifts], results: Results
) -> None:
    show()
    [slider] = editor(panel, "right").findChildren(QSlider, "slider3")
    slider.setValue(250)
    assert last()["right"][2] == pytest.approx(0.0025)
    QTest.keyClick(panel, Qt.Key.Key_L)
    field(panel, "left", 2).setValue(5.0)
    step_m = last()["left"] - solved(results)["left"]
    np.testing.assert_allclose(last()["right"][1] - solved(results)["right"][1], step_m[1])
    QTest.keyClick(panel, Qt.Key.Key_L)
    field(panel, "left", 1).setValue(29.95)
    QTest.keyClick(panel, Qt.Key.Key_Left)
    assert last()["left"][0] == MAX_HAND_SET_SHIFT_M


def test_the_step_is_that_of_the_fields_too(panel: FineTunePanel, show: Show) -> None:
    show()
    panel.set_step_m(4e-4)
    assert panel.step_m == 5e-4
    field(panel, "left", 1).setValue(2.0)
    field(panel, "left", 1).stepUp()
    assert field(panel, "left", 1).value() == 2.5


def test_tells_what_it_does_at_the_target(panel: FineTunePanel, show: Show, rig: Rig) -> None:
    show()
    field(panel, "left", 1).setValue(fields_mm(panel, "left")[0] + 1.0)
    [depth] = panel.findChildren(QComboBox)
    for index, depth_m in enumerate((0.4, 0.5, 0.6)):
        depth.setCurrentIndex(index)
        effect = effect_at(rig.eyes["left"], [0, 0, 0], [0.001, 0, 0], depth_m)
        shown = text(editor(panel, "left"), "effect").split("\n")[0]
        px = float(shown.removeprefix("Right ").split(" px")[0].replace("−", "-"))
        assert px == pytest.approx(effect.right_px, abs=0.15)


def test_in_a_verification_only_the_guide_tells_the_move(panel: FineTunePanel, show: Show) -> None:
    show()
    assert text(editor(panel, "left"), "effect")
    show(State.VERIFY, procedure={"verifying": NUDGED})
    assert not text(editor(panel, "left"), "effect")


def test_the_effect_is_against_the_calibrated_phi_also_of_an_eye_that_keeps_the_offline_one(
    panel: FineTunePanel, show: Show, results: Results
) -> None:
    verdicts = {**results.verdicts, "left": Verdict("keep", "as told")}
    applied_m = {"left": np.zeros(3), "right": results.eyes["right"].shift_m}
    show(
        procedure={
            "results": replace(results, verdicts=verdicts),
            "applied_shift_m": applied_m,
        }
    )
    assert "+0.00 %" in text(editor(panel, "left"), "effect")
    action(panel, "Show solved").trigger()
    assert "+0.00 %" not in text(editor(panel, "left"), "effect")
    assert "+0.00 %" in text(editor(panel, "right"), "effect")


def test_the_wheel_scrolls_the_panels_and_changes_nothing(panel: FineTunePanel, show: Show) -> None:
    show()
    before_mm = fields_mm(panel, "left")
    [slider] = editor(panel, "left").findChildren(QSlider, "slider1")
    for target in (field(panel, "left", 1), slider):
        where = QPointF(5, 5)
        event = QWheelEvent(
            where,
            QPointF(target.mapToGlobal(where)),
            QPoint(0, 0),
            QPoint(0, 120),
            Qt.MouseButton.NoButton,
            Qt.KeyboardModifier.NoModifier,
            Qt.ScrollPhase.NoScrollPhase,
            False,
        )
        QApplication.sendEvent(target, event)
    assert fields_mm(panel, "left") == before_mm


def test_a_silent_headset_is_reported(
    panel: FineTunePanel, snapshot: Callable[..., Snapshot], show: Show
) -> None:
    show()
    field(panel, "left", 1).setValue(4.0)
    late_ns = time.monotonic_ns() + 3_000_000_000
    panel.show_snapshot(snapshot(State.APPLIED, procedure={"is_applied": False}, t_host_ns=late_ns))
    assert "Not acknowledged" in status(panel)


def test_undo_and_redo_by_bursts(
    panel: FineTunePanel,
    show: Show,
    last: Callable[[], Shifts],
    results: Results,
    engine: Engine,
    qtbot: QtBot,
) -> None:
    show()
    before_mm = fields_mm(panel, "left")
    for _ in range(3):
        QTest.keyClick(panel, Qt.Key.Key_Right)
    qtbot.waitUntil(lambda: "record φ" in engine.names, timeout=5 * SETTLE_MS)
    once_mm = fields_mm(panel, "left")
    QTest.keyClick(panel, Qt.Key.Key_Right)
    QTest.keyClick(panel, Qt.Key.Key_Z, CTRL)
    assert fields_mm(panel, "left") == once_mm
    QTest.keyClick(panel, Qt.Key.Key_Z, CTRL)
    assert fields_mm(panel, "left") == before_mm
    assert is_same_shifts(last(), solved(results))
    assert not action(panel, "Undo").isEnabled()
    QTest.keyClick(panel, Qt.Key.Key_Z, CTRL | SHIFT)
    assert fields_mm(panel, "left") == once_mm


def test_a_new_result_in_place_of_what_was_set_can_be_undone(
    panel: FineTunePanel, show: Show, last: Callable[[], Shifts], results: Results
) -> None:
    show()
    field(panel, "left", 1).setValue(4.0)
    set_m = last()
    new_m = {eye: shift_m + 0.001 for eye, shift_m in solved(results).items()}
    show(procedure={"applied_shift_m": new_m})
    np.testing.assert_allclose(fields_mm(panel, "left"), 1e3 * new_m["left"], atol=0.005)
    action(panel, "Undo").trigger()
    assert is_same_shifts(last(), set_m)


def test_a_trial_begins_untouched_and_what_was_moved_for_the_one_before_is_no_undo(
    panel: FineTunePanel, show: Show, last: Callable[[], Shifts], results: Results
) -> None:
    show(trial_eye="left")
    assert not panel.is_touched
    QTest.keyClick(panel, Qt.Key.Key_Right)
    assert panel.is_touched
    last()
    show(procedure={"applied_shift_m": solved(results)}, trial_eye="right")
    assert not panel.is_touched
    assert "trial only" in status(panel)


def test_resets(
    panel: FineTunePanel, show: Show, last: Callable[[], Shifts], results: Results
) -> None:
    show()
    action(panel, "Reset to offline").trigger()
    assert is_same_shifts(last(), OFFLINE)
    action(panel, "Reset to solved").trigger()
    assert is_same_shifts(last(), solved(results))
    show(State.SHOW_HAND)
    assert not action(panel, "Reset to solved").isEnabled()
    assert not action(panel, "Show solved").isEnabled()


def test_showing_another_phi_loses_nothing(
    panel: FineTunePanel,
    show: Show,
    last: Callable[[], Shifts],
    results: Results,
    engine: Engine,
    qtbot: QtBot,
) -> None:
    show()
    field(panel, "left", 1).setValue(4.0)
    set_mm = fields_mm(panel, "left")
    QTest.keyClick(panel, Qt.Key.Key_B)
    assert engine.names.count("record φ") == 1  # what was set is recorded first
    assert is_same_shifts(last(), OFFLINE)
    show(procedure={"applied_shift_m": last()})
    assert fields_mm(panel, "left") == [0.0, 0.0, 0.0]  # what is drawn
    assert not field(panel, "left", 1).isEnabled()
    QTest.keyClick(panel, Qt.Key.Key_S)  # only one is shown instead
    assert is_same_shifts(last(), solved(results))
    panel.hide()  # or the headset would go on with it
    assert last()["left"][0] == pytest.approx(0.004)
    qtbot.wait(SETTLE_MS + 5 * PERIOD_MS)
    assert engine.names.count("record φ") == 1
    panel.show()
    assert fields_mm(panel, "left") == set_mm


def test_settles_at_once_before_a_trial(
    panel: FineTunePanel, show: Show, sent: Callable[[], list[Shifts]], engine: Engine
) -> None:
    show()
    field(panel, "left", 1).setValue(4.0)
    panel.settle()
    assert [shifts_m["left"][0] for shifts_m in sent()] == pytest.approx([0.004])
    assert engine.station.trials.record_shift.call_count == 1
