from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QComboBox,
    QDoubleSpinBox,
    QLabel,
    QLineEdit,
    QRadioButton,
    QScrollArea,
    QSlider,
    QWidget,
)
from pytestqt.qtbot import QtBot

from handcal.calibration.states import MAX_HAND_SET_SHIFT_M, State
from handcal.core.display import DrawnMove, effect_at
from handcal.core.types import EYES, Rig
from handcal.register.results import Results, results_json
from handcal.session.record import SessionRecord
from handcal.session.state import WENT_BACK, SessionEvent
from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.fine_tune.panel import FineTunePanel
from handcal_gui.calibrate.fine_tune.stream import PERIOD_MS, Shifts
from handcal_gui.calibrate.trials.panel import TrialsPanel
from handcal_gui.widgets.result_rows import fine_tuned_texts
from tests.gui.calibrate.fine_tune.controls import (
    Show,
    action,
    editor,
    field,
    fields_mm,
    status,
    texts,
)
from tests.gui.helpers import child
from tests.gui.views import fine_tuned, with_events


def test_empty_says_how_to_begin(panel: FineTunePanel) -> None:
    assert "starts with a session" in status(panel)
    assert not field(panel, "left", 1).isEnabled()


def test_shows_what_the_headset_renders_with(
    panel: FineTunePanel, show: Show, results: Results
) -> None:
    show()
    for eye in EYES:
        solved_mm = 1e3 * results.eyes[eye].shift_m
        np.testing.assert_allclose(fields_mm(panel, eye), solved_mm, atol=0.005)
    assert status(panel) == "In the headset. ← → φ1, ↑ ↓ φ2, PgUp PgDn φ3, E eye"
    assert field(panel, "left", 1).isEnabled()


@pytest.mark.parametrize(
    ("state", "why"),
    [
        (State.ALIGN, "Confirm the alignment"),
        (State.ALIGNED, "Solve"),
        (State.SOLVED, "Apply"),
        (State.APPLYING, "receiving"),
    ],
)
def test_cannot_be_used_during_an_alignment(
    panel: FineTunePanel, show: Show, sent: list[Shifts], state: State, why: str, qtbot: QtBot
) -> None:
    show(state)
    assert why in status(panel)
    assert not field(panel, "left", 1).isEnabled()
    QTest.keyClick(panel, Qt.Key.Key_Right)
    qtbot.wait(2 * PERIOD_MS)
    assert sent == []


def test_cannot_be_used_without_a_headset(panel: FineTunePanel, show: Show) -> None:
    show(link={"connected": False}, link_problem="switch the headset on")
    # In short: the banner and the link panel say why.
    assert status(panel) == "The headset is not connected; see Link."
    assert not field(panel, "left", 1).isEnabled()


def test_a_session_resumed_with_the_same_phi_begins_with_it(
    panel: FineTunePanel, show: Show, rig: Rig, results: Results
) -> None:
    for _ in range(2):
        show()
        for eye in EYES:
            solved_mm = 1e3 * results.eyes[eye].shift_m
            np.testing.assert_allclose(fields_mm(panel, eye), solved_mm, atol=0.005)
        panel.set_rig(rig)  # the next session
        assert not field(panel, "left", 1).isEnabled()


@pytest.mark.parametrize("has_results", [True, False])
def test_what_was_fine_tuned_before_a_resume_is_an_undo_away(
    panel: FineTunePanel, show: Show, record: SessionRecord, results: Results, has_results: bool
) -> None:
    solved_m = results.rendered_shift_m
    tuned_m = {**solved_m, "left": solved_m["left"] + np.array([0.002, 0.0, 0.0])}
    held = results_json(results) if has_results else None
    resumed = replace(fine_tuned(record, tuned_m), results=held)
    solved = results if has_results else None
    show(procedure={"applied_shift_m": tuned_m, "results": solved}, record=resumed)
    show(procedure={"applied_shift_m": solved_m}, record=record)  # an alignment more
    assert "The φ you set was replaced" in status(panel)
    QTest.keyClick(panel, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    tuned_mm, solved_mm = (1e3 * one for one in (tuned_m["left"], solved_m["right"]))
    np.testing.assert_allclose(fields_mm(panel, "left"), tuned_mm, atol=0.005)
    np.testing.assert_allclose(fields_mm(panel, "right"), solved_mm, atol=0.005)


def test_going_back_is_not_fine_tuning(
    panel: FineTunePanel, show: Show, record: SessionRecord, results: Results
) -> None:
    tuned_m = {eye: np.full(3, 0.001) for eye in EYES}
    offline_m = {eye: np.zeros(3) for eye in EYES}

    def went_back(before: SessionRecord, shifts_m: Shifts) -> SessionRecord:
        return fine_tuned(with_events(before, (WENT_BACK, {})), shifts_m)

    by_hand = fine_tuned(record, tuned_m)
    there = went_back(by_hand, offline_m)
    back = went_back(there, tuned_m)
    assert [bool(fine_tuned_texts(results, one)) for one in (by_hand, there, back)] == [1, 0, 1]
    assert [one.went_back for one in (by_hand, there, back)] == [False, True, False]
    one_eye = went_back(by_hand, {**offline_m, "left": tuned_m["left"]})
    assert one_eye.went_back
    assert list(one_eye.set_by_hand_m) == ["left"], "as of a former φ that held it"
    slipped = with_events(record, (SessionEvent.FACTS_SAVED, {"former": "session-1"}))
    former = fine_tuned(slipped, tuned_m)
    assert not former.set_by_hand_m, "set in the session before"
    assert fine_tuned(former, tuned_m).set_by_hand_m
    show(procedure={"applied_shift_m": offline_m}, record=went_back(record, offline_m))
    show(procedure={"applied_shift_m": results.rendered_shift_m}, record=record)
    assert "replaced" not in status(panel)


def test_a_comparison_is_not_ended_by_accident(panel: FineTunePanel, show: Show) -> None:
    show()
    assert field(panel, "left", 1).isEnabled()
    show(comparing="first")
    assert status(panel).startswith("The wearer compares two drawings")
    assert not field(panel, "left", 1).isEnabled()


@pytest.mark.parametrize(
    ("key", "axis", "sign"),
    [
        (Qt.Key.Key_Right, 0, -1),
        (Qt.Key.Key_Left, 0, 1),
        (Qt.Key.Key_Down, 1, -1),
        (Qt.Key.Key_Up, 1, 1),
        (Qt.Key.Key_PageUp, 2, 1),
        (Qt.Key.Key_PageDown, 2, -1),
    ],
)
def test_arrow_keys_move_the_chosen_eye(
    qtbot: QtBot,
    panel: FineTunePanel,
    show: Show,
    results: Results,
    key: Qt.Key,
    axis: int,
    sign: int,
) -> None:
    show()
    QTest.keyClick(panel, Qt.Key.Key_3)
    QTest.keyClick(panel, Qt.Key.Key_E)
    with qtbot.waitSignal(panel.shift_changed) as changed:
        QTest.keyClick(panel, key)
    expected_m = results.eyes["right"].shift_m.copy()
    expected_m[axis] += sign * 0.001
    np.testing.assert_allclose(changed.args[0]["right"], expected_m, atol=1e-12)
    np.testing.assert_array_equal(changed.args[0]["left"], results.eyes["left"].shift_m)


def test_arrow_keys_move_the_eye_while_a_button_has_the_focus(
    qtbot: QtBot, panel: FineTunePanel, show: Show
) -> None:
    show()
    buttons = [one for one in panel.findChildren(QAbstractButton) if one.isEnabled()]
    assert len(buttons) > 8
    for one in buttons:
        one.setFocus()
        focused = panel.focusWidget()
        with qtbot.waitSignal(panel.shift_changed):
            QTest.keyClick(one, Qt.Key.Key_Left)
        assert panel.focusWidget() is focused
        assert child(editor(panel, "left"), QRadioButton).isChecked()


def test_the_panel_says_that_a_click_gives_it_the_arrow_keys(
    qtbot: QtBot, panel: FineTunePanel, show: Show
) -> None:
    other = QLineEdit()
    qtbot.addWidget(other)
    with qtbot.waitExposed(other):
        other.show()
    other.activateWindow()
    other.setFocus()
    qtbot.waitUntil(other.hasFocus)
    show()
    for height_px, keys in ((260, "← → φ1, ↑ ↓ φ2, PgUp PgDn φ3, E eye"), (700, "the keys above")):
        panel.resize(panel.width(), height_px)
        QApplication.processEvents()
        show()
        assert status(panel) == f"Ctrl+6, then {keys}"
    show(State.ALIGN)
    assert "Ctrl+6" not in status(panel)
    panel.activateWindow()
    panel.setFocus()
    qtbot.waitUntil(panel.hasFocus)
    show()
    assert "Ctrl+6" not in status(panel)


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
def test_the_picture_moves_as_the_key_points(
    qtbot: QtBot,
    panel: FineTunePanel,
    show: Show,
    results: Results,
    rig: Rig,
    key: Qt.Key,
    points: Callable[[DrawnMove], bool],
) -> None:
    show()
    with qtbot.waitSignal(panel.shift_changed) as changed:
        QTest.keyClick(panel, key)
    before_m, after_m = results.eyes["left"].shift_m, changed.args[0]["left"]
    assert points(effect_at(rig.eyes["left"], before_m, after_m, 0.5))


def test_both_eyes_move_together(
    qtbot: QtBot, panel: FineTunePanel, show: Show, results: Results
) -> None:
    show()
    QTest.keyClick(panel, Qt.Key.Key_L)
    with qtbot.waitSignal(panel.shift_changed) as changed:
        field(panel, "left", 2).setValue(5.0)
    step_m = [changed.args[0][eye] - results.eyes[eye].shift_m for eye in EYES]
    np.testing.assert_allclose(step_m[0], step_m[1], atol=1e-12)
    assert changed.args[0]["left"][1] == pytest.approx(0.005)


def test_the_slider_moves_the_eye(qtbot: QtBot, panel: FineTunePanel, show: Show) -> None:
    show()
    [slider] = editor(panel, "right").findChildren(QSlider, "slider3")
    with qtbot.waitSignal(panel.shift_changed) as changed:
        slider.setValue(250)
    assert changed.args[0]["right"][2] == pytest.approx(0.0025)
    assert field(panel, "right", 3).value() == 2.5


def test_no_eye_passes_the_limit_of_the_engine(
    panel: FineTunePanel, show: Show, sent: list[Shifts], qtbot: QtBot
) -> None:
    show()
    field(panel, "left", 1).setValue(29.95)
    QTest.keyClick(panel, Qt.Key.Key_Left)
    qtbot.waitUntil(lambda: bool(sent))
    assert sent[-1]["left"][0] == MAX_HAND_SET_SHIFT_M


def test_the_step_is_that_of_the_fields_too(qtbot: QtBot, panel: FineTunePanel, show: Show) -> None:
    show()
    field(panel, "left", 1).setValue(2.0)
    action(panel, "0.5").trigger()
    field(panel, "left", 1).stepUp()
    assert field(panel, "left", 1).value() == 2.5


def test_takes_the_nearest_step(panel: FineTunePanel) -> None:
    panel.set_step_m(4e-4)
    assert panel.step_m == 5e-4
    assert action(panel, "0.5").isChecked()


def test_tells_what_it_does_at_the_target(panel: FineTunePanel, show: Show, rig: Rig) -> None:
    show()
    solved_m = 1e-3 * np.array(fields_mm(panel, "left"))
    field(panel, "left", 1).setValue(1e3 * solved_m[0] + 1.0)
    [depth] = panel.findChildren(QComboBox)
    for index, depth_m in enumerate((0.4, 0.5, 0.6)):
        depth.setCurrentIndex(index)
        effect = effect_at(rig.eyes["left"], [0, 0, 0], [0.001, 0, 0], depth_m)
        shown = next(t for t in texts(editor(panel, "left")) if " px" in t)
        assert float(shown.split(" px")[0].replace("−", "-")) == pytest.approx(
            effect.right_px, abs=0.15
        )


def test_the_wheel_scrolls_the_panel_and_changes_nothing(panel: FineTunePanel, show: Show) -> None:
    show()
    before_mm = fields_mm(panel, "left")
    target = field(panel, "left", 1)
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


def test_every_field_has_a_name_and_an_explanation(panel: FineTunePanel) -> None:
    for widget in (*panel.findChildren(QDoubleSpinBox), *panel.findChildren(QSlider)):
        assert "φ" in widget.accessibleName()
        assert "viewpoint" in widget.toolTip()
    assert {radio.text() for radio in panel.findChildren(QRadioButton)} == {
        "Left eye",
        "Right eye",
    }


def test_a_small_panel_needs_no_scrolling(panel: FineTunePanel, show: Show) -> None:
    panel.resize(360, 304)
    show()
    QApplication.processEvents()
    [area] = panel.findChildren(QScrollArea)
    assert area.horizontalScrollBar().maximum() == 0
    kinds = QAbstractButton, QDoubleSpinBox, QSlider, QComboBox
    for control in panel.findChildren(QWidget):
        if isinstance(control, kinds) and control.isVisible():
            assert control.visibleRegion().boundingRect() == control.rect(), (
                control.accessibleName()
            )


def test_the_keys_are_told_where_there_is_room_for_them(
    qtbot: QtBot, panel: FineTunePanel, show: Show
) -> None:
    [keys] = [one for one in panel.findChildren(QLabel) if one.text().startswith("Arrow keys")]
    show()
    assert keys.isVisible()
    panel.resize(384, 268)  # the controls alone, with the fonts of any machine
    show()
    qtbot.waitUntil(lambda: not keys.isVisible())
    [area] = panel.findChildren(QScrollArea)
    body = area.widget()
    assert body is not None
    assert body.toolTip() == keys.text()
    qtbot.waitUntil(lambda: area.verticalScrollBar().maximum() == 0)


def test_in_a_high_panel_the_status_stands_below_its_controls(
    qtbot: QtBot, panel: FineTunePanel, show: Show
) -> None:
    show()
    [area] = panel.findChildren(QScrollArea)
    said = child(panel, QLabel, "status")
    for height_px in (284, 900):
        panel.resize(430, height_px)
        qtbot.waitUntil(lambda: said.y() - area.geometry().bottom() < said.height())
    assert area.height() < 450
    assert area.verticalScrollBar().maximum() == 0


def test_a_panel_that_grows_loses_its_scroll_bar(panel: FineTunePanel, show: Show) -> None:
    show()
    [area] = panel.findChildren(QScrollArea)
    for height_px in (200, 302):  # of the dock at 1366x768
        panel.resize(409, height_px)
        QApplication.processEvents()
    assert area.verticalScrollBar().maximum() == 0


def test_the_effect_is_at_first_that_at_the_distance_of_the_first_trials(
    qtbot: QtBot, panel: FineTunePanel
) -> None:
    trials = TrialsPanel()
    qtbot.addWidget(trials)
    boxes = (*panel.findChildren(QComboBox), *trials.findChildren(QComboBox))
    depths = [one for one in boxes if one.accessibleName() == "Distance of the target"]
    assert [one.currentText() for one in depths] == ["0.4 m", "0.4 m"]
