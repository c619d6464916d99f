"""The whole program opened, closed and resumed; its dialogs, and what is changed by hand."""

from __future__ import annotations

import json
import socket
import threading
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QLabel,
    QMessageBox,
    QPlainTextEdit,
    QPushButton,
    QWidget,
)

from handcal.calibration.states import State
from handcal.core.errors import LinkError
from handcal.core.types import Float64
from handcal.export.export import ExportSettings
from handcal.session.session import Session, SessionRecord
from handcal.station.station import Station
from handcal_gui.app.preferences import PREFERENCES_VERSION, PreferencesFile
from handcal_gui.calibrate.control.conditions import Conditions
from handcal_gui.calibrate.guide.view import Action, Step
from handcal_gui.widgets.path_field import PathField
from tests.gui.app.program.technician import (
    PATIENCE_MS,
    Technician,
    align,
    can_start,
    make_cursor,
    solve_and_apply,
)
from tests.gui.calibrate.fine_tune.controls import fields_mm
from tests.gui.helpers import child, text


def test_damaged_pairing_keys_are_said_and_left_alone(
    open_program: Callable[[], Technician], file: PreferencesFile
) -> None:
    path = file.path.with_name("pairing.key")
    path.write_bytes(b'{"devices": [')
    assert "pairing.key are damaged" in open_program().banner
    assert path.read_bytes() == b'{"devices": ['


def test_exports_go_beside_the_session_folder_or_to_the_last_one(
    technician: Technician, tmp_path: Path
) -> None:
    program = technician.program
    paths = [tmp_path / "sessions" / "a", tmp_path / "sessions" / "b"]

    first = program.windows.export_many(paths, program.window)
    assert first.windowTitle() == "Export 2 sessions"
    assert child(first, PathField).path == str(tmp_path / "handcal exports")
    first.remembered.emit(ExportSettings(), tmp_path / "chosen")
    second = program.windows.export_many(paths, program.window)
    assert child(second, PathField).path == str(tmp_path / "chosen")


def test_the_dialogs_of_the_menus_end_with_the_program(
    open_program: Callable[[], Technician], file: PreferencesFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("handcal_gui.connect.connect_dialog.Announcement", _no_network)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    station = {"sessions": str(file.path.parent), "host": "127.0.0.1", "port": port}
    file.path.write_text(json.dumps({"version": PREFERENCES_VERSION, "station": station}))
    technician = open_program()
    program = technician.program
    first = program.windows.connect_headset()
    assert first is not None
    first.accept()
    assert program.windows.connect_headset() is not None  # the port is free again
    assert program.windows.show_library().isVisible()
    assert program.windows.make_support_bundle().isVisible()


def test_connect_shows_the_headset_of_a_calibration_and_leaves_it_alone(live: Technician) -> None:
    dialog = live.program.windows.connect_headset()
    assert dialog is not None
    live.wait(lambda: text(dialog, "headsetFound").startswith("Headset of the tests"))
    assert text(dialog, "digits") == ""
    child(dialog, QPushButton, "square-left").click()
    live.wait(lambda: child(dialog, QCheckBox, "squareSeen-left").isEnabled())
    dialog.accept()
    number = live.snapshot.number
    live.wait(lambda: live.snapshot.number > number + 2)
    assert live.snapshot.link.connected


def _no_network(_address: object) -> None:
    raise LinkError("no multicast")


def test_alignments_are_deleted_and_restored(live: Technician, studio: Any) -> None:
    align(live, studio)
    solve_and_apply(live)
    session = live.program.window.panels.session
    session.submit("delete the alignment", lambda s: s.delete("alignment", 1))
    live.wait(lambda: live.snapshot.record.alignments == {})
    assert live.snapshot.procedure.results is None
    session.submit("restore the alignment", lambda s: s.restore("alignment", 1))
    live.wait(lambda: len(live.snapshot.record.alignments) == 1)
    live.press_space_to("Solve")
    live.wait_for_state(State.SOLVED)
    session.submit("delete the alignment", lambda s: s.delete("alignment", 7))
    live.wait(lambda: live.banner.startswith("Could not delete the alignment: "))
    QTest.keyClick(live.program.window, Qt.Key.Key_Escape)
    assert live.banner == ""


def test_fine_tuning_streams_is_recorded_and_judged_by_trials(
    live: Technician, studio: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A person presses no key twice as fast as this test on a fast computer.
    monkeypatch.setattr("handcal_gui.calibrate.trials.panel._LEAST_APART_S", 0.0)
    align(live, studio)
    solve_and_apply(live)
    window = live.program.window
    solved_m = live.snapshot.procedure.applied_shift_m["left"]
    before = studio.headset.shown.projections["left"].P
    QTest.keyClick(window, Qt.Key.Key_T)
    live.wait(lambda: live.banner.startswith("The trial is not recorded yet: φ of the left eye"))
    window.go_to("fine_tune")
    panel = window.panels.fine_tune
    panel.setFocus()
    live.wait(lambda: panel.isVisible() and "In the headset" in live.child(QLabel, "status").text())
    # The picture moves to the left, the eye to the right.
    for _ in range(3):
        QTest.keyClick(panel, Qt.Key.Key_Left)
    step_m = 3.0 * panel.step_m
    live.wait(
        lambda: np.allclose(
            live.snapshot.procedure.applied_shift_m["left"] - solved_m, [step_m, 0, 0]
        )
    )
    live.wait(lambda: not np.array_equal(studio.headset.shown.projections["left"].P, before))
    live.wait(lambda: live.snapshot.record.fine_tuned is not None)
    assert live.banner == ""  # φ has been fine-tuned
    tuned = live.snapshot.record.fine_tuned
    assert tuned is not None
    np.testing.assert_allclose(tuned["left"], solved_m + np.array([step_m, 0.0, 0.0]))
    assert sum(event.name == "fine_tuned" for event in live.record.events) == 1

    QTest.keyClick(window, Qt.Key.Key_T)  # without a target, too
    live.wait(lambda: len(live.snapshot.record.trials) == 1)
    live.wait(lambda: np.array_equal(studio.headset.shown.projections["left"].P, before))
    shows_target, _ = window.panels.trials.findChildren(QCheckBox)
    shows_target.click()
    live.wait(lambda: studio.headset.shown.target is not None)
    target = studio.headset.shown.target
    assert target.eye == "left"
    recorded = sum(event.name == "fine_tuned" for event in live.record.events)
    QTest.keyClick(panel, Qt.Key.Key_Left)
    live.wait(lambda: not np.array_equal(studio.headset.shown.projections["left"].P, before))
    QTest.keyClick(window, Qt.Key.Key_T)
    live.wait(lambda: len(live.snapshot.record.trials) == 2)
    live.wait(lambda: live.banner == "")
    # It would be the right eye's turn, which has not been aligned: the left one has another.
    first, second = live.snapshot.record.trials.values()
    t_C0_V_m = live.snapshot.record.rig.eyes["left"].t_C0_V_m
    np.testing.assert_allclose(target.corners_V_m + t_C0_V_m, second.corners_E_m)
    for trial, n_presses in ((first, 3), (second, 1)):
        moved_m = trial.adjusted_shift_m - trial.calibrated_shift_m
        np.testing.assert_allclose(moved_m, [n_presses * panel.step_m, 0, 0], atol=1e-12)
        assert trial.error_px.min() > 0.0
    # Neither has moved the calibration.
    live.wait(lambda: np.array_equal(studio.headset.shown.projections["left"].P, before))
    stored = Session.open(live.snapshot.session_path)
    np.testing.assert_allclose(stored.applied_shift_m["left"], solved_m)
    assert sum(event.name == "fine_tuned" for event in stored.events) == recorded


def test_fine_tuning_that_comes_into_sight_begins_with_what_the_headset_has(
    live: Technician, studio: Any
) -> None:
    align(live, studio)
    solve_and_apply(live)
    applied_mm = 1e3 * live.snapshot.procedure.applied_shift_m["left"]
    live.program.window.go_to("fine_tune")
    editor = live.child(QWidget, "leftEditor")  # at once: no snapshot has come since
    shown_mm = [field.value() for field in editor.findChildren(QDoubleSpinBox)]
    np.testing.assert_allclose(shown_mm, applied_mm, atol=0.006)
    assert np.abs(applied_mm).max() > 0.1


def test_notes_and_shifts_of_the_last_moment_are_saved(live: Technician, studio: Any) -> None:
    path = live.snapshot.session_path
    window = live.program.window
    window.go_to("session")
    live.wait(lambda: live.child(QPlainTextEdit, "").isEnabled())
    live.child(QPlainTextEdit, "").setPlainText("wears glasses")
    window.go_to("fine_tune")
    panel = window.panels.fine_tune
    live.wait(lambda: panel.isVisible() and panel.isEnabled())
    panel.setFocus()
    live.wait(lambda: "In the headset" in live.child(QLabel, "status").text())
    QTest.keyClick(panel, Qt.Key.Key_Left)
    window.close()
    record = Session.open(path)
    assert record.notes == "wears glasses"
    assert record.fine_tuned is not None
    np.testing.assert_allclose(record.fine_tuned["left"], [panel.step_m, 0.0, 0.0])


def test_on_a_slow_computer_every_panel_is_shown(
    live: Technician, monkeypatch: pytest.MonkeyPatch
) -> None:
    controller, panels = live.program.live, live.program.window.panels
    monkeypatch.setattr(Conditions, "_watch_rate", lambda *_: None)
    controller._conditions.is_slow = True  # after three seconds with few frames
    live.program.window.resize(1600, 1000)
    live.program.window.reset_layout()
    live.program.window.go_to("camera")
    live.program.window.go_to("rotation")
    shown: Counter[str] = Counter()
    for name in ("cloud", "rotation", "camera"):
        monkeypatch.setattr(
            getattr(panels, name), "show_snapshot", lambda _, name=name: shown.update([name])
        )
    live.wait(lambda: min(shown[name] for name in ("cloud", "rotation", "camera")) >= 2)
    assert shown["rotation"] >= shown["camera"], "guidance comes first"


def test_a_session_in_use_elsewhere_cannot_be_resumed(
    technician: Technician, studio: Any, record: SessionRecord
) -> None:
    with Session(record.path):
        technician.program.resume_session(record.path)
        technician.wait(lambda: "in use by process" in technician.banner)
        assert technician.program.window.page == "start"
        technician.wait(lambda: can_start(technician))


def test_opening_a_station_can_be_cancelled(
    technician: Technician, studio: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    may_open = threading.Event()

    def open_slowly(*arguments: Any, **options: Any) -> Station:
        assert may_open.wait(PATIENCE_MS / 1000)
        return Station(*arguments, **options)

    monkeypatch.setattr("handcal_gui.app.program.Station", open_slowly)
    start = technician.program.start
    technician.wait(lambda: can_start(technician))
    technician.program.start_calibration(studio.settings, "Ada")
    assert not can_start(technician)
    QTest.keyClick(start.new, Qt.Key.Key_Return)  # the second of two in a hurry
    QTest.keyClick(start.new, Qt.Key.Key_Escape)
    assert not technician.child(QPushButton, "cancelOpening").isEnabled()
    may_open.set()
    technician.wait(lambda: can_start(technician))
    assert technician.program.window.page == "start"
    assert not technician.child(QPushButton, "cancelOpening").isVisible()
    technician.program.start_calibration(studio.settings, "Ada")
    technician.wait_for_page("live")


def test_an_interrupted_session_is_offered_and_resumed(
    open_program: Callable[[], Technician], studio: Any
) -> None:
    first = open_program()
    first.program.start_calibration(studio.settings, "Ada")
    first.wait_for_page("live")
    first.wait(lambda: first.snapshot.link.connected)
    align(first, studio)
    path = first.snapshot.session_path
    first.program.window.close()

    second = open_program()
    second.wait(second.child(QWidget, "resume").isVisible)
    second.program.start.unfinished.chosen.emit(path)
    second.wait_for_page("live")
    assert second.snapshot.session_path == path
    assert second.snapshot.procedure.state is State.ALIGNED
    second.press_space_for(Action.NEXT)
    solve_and_apply(second)
    assert second.record.is_applied


@pytest.mark.parametrize(
    ("moment", "resumed"),
    [
        ("solving", State.SOLVED),
        ("verifying", State.VERIFY),
        ("recording a trial", State.APPLIED),
    ],
)
def test_nothing_is_lost_by_closing_at_work(
    open_program: Callable[[], Technician], studio: Any, moment: str, resumed: State
) -> None:
    first = open_program()
    first.program.start_calibration(studio.settings, "Ada")
    first.wait_for_page("live")
    first.wait(lambda: first.snapshot.link.connected)
    first.child(QComboBox, "wizardPlan").setCurrentText("Left eye only")
    align(first, studio)
    if moment == "solving":
        first.press_space_to("Solve")
    else:
        solve_and_apply(first)
    if moment == "verifying":
        first.press_space_to("Verify the left eye")
        first.wait_for_state(State.VERIFY)
    if moment == "recording a trial":
        first.program.window.panels.trials.submit("trial", lambda s: s.trials.save("left", 1.0))
    path = first.snapshot.session_path
    first.program.window.close()

    stored = Session.open(path)
    assert len(stored.alignments) == 1
    assert stored.is_solved
    assert len(stored.trials) == (moment == "recording a trial")
    second = open_program()
    second.program.resume_session(path)
    second.wait_for_page("live")
    assert second.snapshot.procedure.state is resumed
    assert len(second.snapshot.record.alignments) == 1


@pytest.mark.parametrize("why", ["taken off", "hours later"])
def test_a_headset_that_was_off_is_verified_first_and_nothing_is_fused(
    live: Technician, studio: Any, monkeypatch: pytest.MonkeyPatch, why: str
) -> None:
    align(live, studio)
    solve_and_apply(live)
    before = live.snapshot
    live.program.live.do(Action.NEXT_WEARER)
    live.wait_for_page("start")
    if why == "taken off":
        monkeypatch.setattr("handcal_gui.app.program.ask_whether_worn", lambda *_: False)
    else:
        monkeypatch.setattr("handcal_gui.app.program.may_still_be_worn", lambda *_: False)
        monkeypatch.setattr("handcal_gui.app.program.ask_whether_worn", pytest.fail)
    live.program.resume_session(before.session_path)
    live.wait_for_page("live")
    record = live.snapshot.record
    assert record.path != before.session_path
    assert record.facts.former == before.session_path.name
    assert (record.alignments, record.verified_now) == ({}, frozenset())
    for eye, shift_m in before.procedure.applied_shift_m.items():
        np.testing.assert_allclose(live.snapshot.procedure.applied_shift_m[eye], shift_m)
    live.press_space_for(Action.NEXT)
    panel = live.program.wizard_panel
    live.wait(lambda: panel.shown is not None and panel.shown.step is Step.VERIFY)
    assert Session.open(before.session_path).is_finished


def test_resuming_can_be_thought_better_of(
    live: Technician, studio: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    align(live, studio)
    path = live.snapshot.session_path
    live.program.show_start()
    monkeypatch.setattr("handcal_gui.app.program.ask_whether_worn", lambda *_: None)
    live.program.resume_session(path)
    assert live.program.window.page == "start"
    assert live.program.live.snapshot is None


@pytest.mark.parametrize("answer", ["No", "Yes"])
def test_a_new_pairing_key_is_made_only_after_a_question(
    technician: Technician, file: PreferencesFile, monkeypatch: pytest.MonkeyPatch, answer: str
) -> None:
    key = file.pairings().open_key()
    button = getattr(QMessageBox.StandardButton, answer)
    monkeypatch.setattr(QMessageBox, "question", lambda *_: button)
    technician.program.window.panels.link.new_key.click()
    assert (file.pairings().open_key() == key) == (answer == "No")
    assert ("new pairing key" in technician.banner) == (answer == "Yes")


@pytest.mark.parametrize("compares", [False, True])
def test_a_session_resumed_at_once_is_fine_tuned_from_its_phi(
    live: Technician, studio: Any, *, compares: bool
) -> None:
    panels = live.program.window.panels

    def is_shown(shift_m: Float64) -> bool:
        return np.allclose(fields_mm(panels.fine_tune, "left"), 1e3 * shift_m, atol=0.01)

    align(live, studio)
    solve_and_apply(live)
    applied_m, path = live.snapshot.procedure.applied_shift_m["left"], live.snapshot.session_path
    live.wait(lambda: is_shown(applied_m))
    if compares:
        panels.trials.submit("compare", lambda s: s.trials.compare())
        live.wait(lambda: live.snapshot.comparing is not None)
    live.program.live.do(Action.NEXT_WEARER)
    live.wait_for_page("start")
    live.program.resume_session(path)
    live.wait_for_page("live")
    live.wait(lambda: live.snapshot.link.connected)
    live.wait(lambda: is_shown(applied_m))


@pytest.mark.parametrize(
    "moment",
    ["start page", "opening", "connect", "align", "applying", "review", "opening a session"],
)
def test_the_window_can_be_closed_at_any_moment(
    technician: Technician, studio: Any, record: SessionRecord, moment: str
) -> None:
    program = technician.program
    if moment in ("opening", "connect", "align", "applying"):
        program.start_calibration(studio.settings, "Ada")
    if moment in ("connect", "align", "applying"):
        technician.wait_for_page("live")
        technician.wait(lambda: technician.snapshot.link.connected)
    if moment == "align":
        make_cursor(technician, studio)
    if moment == "applying":
        align(technician, studio)
        technician.press_space_to("Solve")
        technician.wait_for_state(State.SOLVED)
        studio.headset.fall_silent()
        technician.press_space_for(Action.TAKE_STEP)
        technician.wait_for_state(State.APPLYING)
    if moment in ("review", "opening a session"):
        program.open_session(record.path)
    if moment == "review":
        technician.wait_for_page("review")
    program.window.close()
    assert [t.name for t in threading.enumerate() if t.name.startswith("handcal")] == []
    assert not program.window.isVisible()
    for path in Path(studio.settings.sessions).glob("session-*"):
        Session(path).close()  # free, and not damaged
