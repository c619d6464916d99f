"""The whole program, with a real station whose camera and headset are in the test's hand."""

from __future__ import annotations

import json
import socket
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
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
    QPlainTextEdit,
    QPushButton,
    QWidget,
)
from pytestqt.qtbot import QtBot

from handcal.errors import LinkError
from handcal.register.placement import PlacementSettings
from handcal.session.session import Session, SessionRecord
from handcal.station.plan import PlanSettings
from handcal.station.procedure import State
from handcal.station.settings import StationSettings
from handcal.station.snapshot import Snapshot
from handcal.station.station import Station
from handcal_gui import launch
from handcal_gui.control.conditions import Conditions
from handcal_gui.pages.wizard.view import Action, Step
from handcal_gui.preferences import PreferencesFile
from handcal_gui.program import Program
from handcal_gui.theme import use_theme
from tests.gui.helpers import button, child, text

KEY = "a pairing key of the tests"
PATIENCE_MS = 20_000


class Technician:
    """Watches the window and uses the keyboard."""

    def __init__(self, program: Program, qtbot: QtBot) -> None:
        self.program = program
        self.qtbot = qtbot

    @property
    def snapshot(self) -> Snapshot:
        assert self.program.live.snapshot is not None
        return self.program.live.snapshot

    @property
    def banner(self) -> str:
        return self.program.window.banner.text

    @property
    def record(self) -> SessionRecord:
        return Session.open(self.snapshot.session_path)

    def wait(self, condition: Callable[[], bool]) -> None:
        self.qtbot.waitUntil(condition, timeout=PATIENCE_MS)

    def wait_for_page(self, page: str) -> None:
        self.wait(lambda: self.program.window.page == page)
        if page == "live":
            self.wait(lambda: self.program.live.snapshot is not None)

    def can(self, action: Action) -> bool:
        shown = self.program.wizard_panel.shown
        return shown is not None and shown.main.action is action and shown.main.is_enabled

    def press_space_for(self, action: Action) -> None:
        """Press the space bar once the wizard offers this."""
        self.wait(lambda: self.can(action))
        QTest.keyClick(self.program.window, Qt.Key.Key_Space)

    def wait_for_state(self, state: State) -> None:
        self.wait(lambda: self.snapshot.procedure.state is state)

    def child(self, kind: type[Any], name: str) -> Any:
        found = self.program.window.findChild(kind, name)
        assert isinstance(found, QWidget)
        return found


@pytest.fixture
def file(tmp_path: Path) -> PreferencesFile:
    path = tmp_path / "config" / "preferences.json"
    path.parent.mkdir()
    station = {"sessions": str(tmp_path / "sessions")}
    path.write_text(json.dumps({"station": station, "runs_itself": False}))
    path.with_name("pairing.key").write_text(KEY)
    return PreferencesFile(path)


@pytest.fixture
def open_program(
    qtbot: QtBot, file: PreferencesFile, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[[], Technician]]:
    opened: list[Program] = []

    # The tests' camera is slow on a busy computer.
    monkeypatch.setattr("handcal_gui.control.conditions._SLOW_HZ", 0.0)

    def open_program() -> Technician:
        program = Program(file)
        opened.append(program)
        qtbot.addWidget(program.window)
        program.window.show()
        return Technician(program, qtbot)

    yield open_program
    for program in opened:
        program.window.close()
    use_theme("system")
    assert [t.name for t in threading.enumerate() if t.name.startswith("handcal")] == []


def test_damaged_pairing_keys_are_said_and_left_alone(
    open_program: Callable[[], Technician], file: PreferencesFile
) -> None:
    path = file.path.with_name("pairing.key")
    path.write_bytes(b'{"devices": [')
    assert "pairing.key are damaged" in open_program().banner
    assert path.read_bytes() == b'{"devices": ['


@pytest.fixture
def technician(open_program: Callable[[], Technician]) -> Technician:
    return open_program()


@pytest.fixture
def live(technician: Technician, studio: Any) -> Technician:
    """Return a technician before a station that runs, with the headset connected."""
    technician.program.start_calibration(studio.settings, "Ada")
    technician.wait_for_page("live")
    technician.wait(lambda: technician.snapshot.link.connected)
    return technician


def test_the_dialogs_of_the_menus_end_with_the_program(
    open_program: Callable[[], Technician], file: PreferencesFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("handcal_gui.dialogs.connect.Announcement", _no_network)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    station = {"sessions": str(file.path.parent), "host": "127.0.0.1", "port": port}
    file.path.write_text(json.dumps({"station": station}))
    technician = open_program()
    program = technician.program
    first = program.connect_headset()
    assert first is not None
    first.accept()
    assert program.connect_headset() is not None  # the port is free again
    assert program.show_library().isVisible()
    assert program.make_support_bundle().isVisible()


def test_connect_shows_the_headset_of_a_calibration_and_leaves_it_alone(live: Technician) -> None:
    dialog = live.program.connect_headset()
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


def can_start(technician: Technician) -> bool:
    """Return whether the start page allows starting a calibration."""
    return bool(technician.child(QPushButton, "start").isEnabled())


def test_on_a_slow_computer_every_panel_is_shown(
    live: Technician, monkeypatch: pytest.MonkeyPatch
) -> None:
    controller, panels = live.program.live, live.program.window.panels
    monkeypatch.setattr(Conditions, "_watch_rate", lambda *_: None)
    controller._conditions.is_slow = True  # after three seconds with few frames
    live.program.window.resize(1600, 1000)
    live.program.window.reset_layout()
    shown: Counter[str] = Counter()
    for name in ("cloud", "rotation", "camera"):
        monkeypatch.setattr(
            getattr(panels, name), "show_snapshot", lambda _, name=name: shown.update([name])
        )
    live.wait(lambda: min(shown[name] for name in ("cloud", "rotation", "camera")) >= 2)
    assert shown["rotation"] >= shown["camera"], "guidance comes first"


def make_cursor(technician: Technician, studio: Any, first: Action = Action.NEXT) -> None:
    """Get from Connect, or from Verify, to a cursor."""
    studio.camera.shows = "cursor"
    technician.press_space_for(first)
    technician.press_space_for(Action.NEXT)
    technician.press_space_for(Action.MAKE_CURSOR)
    technician.wait_for_state(State.ALIGN)
    technician.wait(lambda: studio.headset.shown.cursor_W_m is not None)


def is_turned(technician: Technician) -> bool:
    """Return whether the visible hand is not the cursor's, and is held still."""
    seen = technician.snapshot.observation
    if seen is None or seen.rotation_rad is None or not seen.is_steady:
        return False
    return bool(np.linalg.norm(seen.rotation_rad) > 0.02)


def align(technician: Technician, studio: Any, first: Action = Action.NEXT) -> None:
    make_cursor(technician, studio, first)
    studio.camera.shows = "live"
    technician.wait(lambda: is_turned(technician))
    studio.headset.confirm()
    technician.wait_for_state(State.ALIGNED)


def solve_and_apply(technician: Technician) -> None:
    technician.press_space_for(Action.SOLVE)
    technician.press_space_for(Action.APPLY)
    technician.wait_for_state(State.APPLIED)


def test_the_wizard_one_eye_after_the_other_by_the_space_bar(
    live: Technician, studio: Any, file: PreferencesFile
) -> None:
    align(live, studio)
    assert studio.headset.shown.eyes == ("left",)
    solve_and_apply(live)
    live.wait(lambda: live.can(Action.ANOTHER))
    align(live, studio, Action.ANOTHER)
    assert studio.headset.shown.eyes == ("right",)
    solve_and_apply(live)
    for _ in ("left", "right"):
        live.wait(lambda: live.can(Action.VERIFY))
        live.child(QPushButton, "wizardOther0").click()  # skip
    live.wait(lambda: live.can(Action.ANOTHER))  # not accepted, so it does not fit
    live.child(QPushButton, "wizardOther0").click()
    live.press_space_for(Action.FINISH)
    live.wait(lambda: live.can(Action.NEXT_WEARER))
    record = live.record
    assert record.is_finished
    assert record.wearer == "Ada"
    assert [alignment.eyes for alignment in record.alignments.values()] == [("left",), ("right",)]
    for eye in ("left", "right"):
        P = studio.headset.shown.projections[eye].P
        assert not np.allclose(P, live.snapshot.record.rig.eyes[eye].K @ np.eye(3, 4))
    assert live.banner == ""
    live.press_space_for(Action.NEXT_WEARER)
    assert live.program.window.page == "start"
    stored, complaint = file.load()
    assert complaint == ""
    assert "Ada" not in file.path.read_text()  # only in the session
    assert stored.sessions == (str(record.path),)
    assert stored.station == studio.settings


def test_steps_run_by_themselves_after_one_press(live: Technician, studio: Any) -> None:
    QTest.keyClick(live.program.window, Qt.Key.Key_H)  # the station is held at first
    live.press_space_for(Action.NEXT)
    for eye in ("left", "right"):
        studio.camera.shows = "cursor"
        live.wait_for_state(State.ALIGN)
        assert live.snapshot.procedure.eyes == (eye,)
        live.wait(lambda: studio.headset.shown.cursor_W_m is not None)
        studio.camera.shows = "live"
        live.wait(lambda: is_turned(live))
        studio.headset.confirm()
        live.wait_for_state(State.APPLIED)
    assert [one.eyes for one in live.record.alignments.values()] == [("left",), ("right",)]
    assert live.banner == ""


def test_an_eye_is_verified_by_keys_and_the_error_found_is_shown(
    technician: Technician, studio: Any
) -> None:
    technician.program.start_calibration(studio.settings, "Ada")
    technician.wait_for_page("live")
    technician.wait(lambda: technician.snapshot.link.connected)
    plan = technician.child(QComboBox, "wizardPlan")
    plan.setCurrentText("Left eye only")
    align(technician, studio)
    solve_and_apply(technician)
    technician.press_space_for(Action.VERIFY)
    technician.wait_for_state(State.VERIFY)
    technician.wait(lambda: technician.can(Action.VERIFIED))
    before_m = technician.snapshot.procedure.applied_shift_m["left"]
    for _ in range(3):
        QTest.keyClick(technician.program.window, Qt.Key.Key_Right)
    technician.wait(lambda: "3.0′ right" in technician.child(QLabel, "wizardFact").text())
    technician.child(QPushButton, "wizardOther0").click()  # undo
    technician.wait(lambda: "2.0′ right" in technician.child(QLabel, "wizardFact").text())
    assert technician.snapshot.procedure.applied_shift_m["left"][0] != before_m[0]
    technician.press_space_for(Action.VERIFIED)
    technician.wait(lambda: "left" in technician.snapshot.procedure.verifications)
    technician.wait_for_state(State.APPLIED)
    results = technician.snapshot.procedure.results
    assert results is not None
    found, _ = results.measured_arcmin["left"]
    live_text = technician.program.wizard_panel.picture.result
    technician.wait(lambda: f"Check found: {found:.1f}′" in live_text.text())
    assert technician.record.facts.verified["left"].nudge_arcmin == (2.0, 0.0)


def with_plan(settings: StationSettings) -> StationSettings:
    """Return settings with the recommended plan of one alignment of one eye.

    The tests' hand does not follow the cursor, so no other place may be in the camera's range.
    """
    placement = PlacementSettings(farthest_m=0.1, fewest=1, most=1, checks=1)
    plan = PlanSettings("recommended", ("left",), is_automatic=True, placement=placement)
    return replace(settings, plan=plan)


def begin(technician: Technician, studio: Any) -> None:
    studio.camera.shows = "cursor"
    technician.wait(lambda: technician.snapshot.link.connected)
    technician.press_space_for(Action.NEXT)


def align_shown(technician: Technician, studio: Any) -> None:
    """Align the hand with the cursor that is shown, and confirm in the headset."""
    technician.wait_for_state(State.ALIGN)
    technician.wait(lambda: studio.headset.shown.cursor_W_m is not None)
    studio.camera.shows = "live"
    technician.wait(lambda: is_turned(technician))
    studio.headset.confirm()


def test_the_station_follows_its_plan_from_begin_to_a_verification(
    technician: Technician, studio: Any
) -> None:
    """Nothing runs before Begin; then two presses, one of them for the wearer, lead to the end."""
    program = technician.program
    program.start_calibration(with_plan(studio.settings), "Ada")
    program.wizard_panel.hold(False)
    technician.wait_for_page("live")
    studio.camera.shows = "cursor"
    technician.wait(lambda: "Camera" in " ".join(shown_checks(technician)))
    technician.wait(
        lambda: (
            technician.snapshot.observation is not None
            and technician.snapshot.observation.is_steady
        )
    )
    technician.qtbot.wait(300)
    assert technician.snapshot.procedure.state is State.SHOW_HAND
    begin(technician, studio)
    program.wizard_panel.hold(False)
    align_shown(technician, studio)
    technician.wait_for_state(State.VERIFY)
    technician.press_space_for(Action.VERIFIED)
    technician.wait(lambda: technician.can(Action.NEXT))
    solved_m = technician.snapshot.procedure.applied_shift_m["left"]
    assert solved_m.any()

    fact = technician.child(QLabel, "wizardFact")
    QTest.keyClick(program.window, Qt.Key.Key_G, Qt.KeyboardModifier.ShiftModifier)
    technician.wait(lambda: not technician.snapshot.procedure.applied_shift_m["left"].any())
    technician.wait(lambda: "another φ" in fact.text())
    assert program.wizard_panel.wizard.is_held
    QTest.keyClick(program.window, Qt.Key.Key_G)
    technician.wait(
        lambda: bool((technician.snapshot.procedure.applied_shift_m["left"] == solved_m).all())
    )
    technician.press_space_for(Action.NEXT)
    technician.press_space_for(Action.FINISH)
    technician.wait(lambda: technician.can(Action.NEXT_WEARER))
    path = technician.snapshot.session_path
    assert technician.record.facts.plan == "recommended"

    button(program.window, QPushButton, "Headset &slipped").click()
    technician.wait_for_page("live")
    technician.wait(lambda: technician.snapshot.session_path != path)
    assert technician.record.facts.former == path.name
    assert technician.record.wearer == "Ada"
    begin(technician, studio)
    program.wizard_panel.hold(False)
    technician.wait_for_state(State.VERIFY)
    assert technician.snapshot.procedure.alignments == {}


def test_each_step_of_a_held_plan_is_taken_by_a_press(technician: Technician, studio: Any) -> None:
    technician.program.start_calibration(with_plan(studio.settings), "Ada")
    technician.wait_for_page("live")
    begin(technician, studio)
    technician.wait(lambda: technician.can(Action.TAKE_STEP))
    assert technician.snapshot.procedure.state is State.SHOW_HAND
    technician.press_space_for(Action.TAKE_STEP)
    align_shown(technician, studio)
    for state in (State.ALIGNED, State.SOLVED, State.APPLIED):
        technician.wait_for_state(state)
        technician.press_space_for(Action.TAKE_STEP)
    technician.wait_for_state(State.VERIFY)
    technician.child(QPushButton, "wizardOther1").click()  # skip
    technician.wait(lambda: technician.can(Action.NEXT))
    assert technician.record.facts.verified == {}
    technician.wait(
        lambda: (
            technician.snapshot.observation is not None
            and technician.snapshot.observation.is_steady
        )
    )
    button(technician.program.window, QPushButton, "Check l&eft eye").click()
    technician.wait_for_state(State.VERIFY)


def test_back_and_a_key_hold_the_steps_that_run_by_themselves(
    live: Technician, studio: Any, file: PreferencesFile
) -> None:
    ring = live.child(QWidget, "wizardRing")
    QTest.keyClick(live.program.window, Qt.Key.Key_H)
    assert file.load()[0].runs_itself
    live.press_space_for(Action.NEXT)  # no hand is shown yet
    live.wait(lambda: ring.share == 0.0)
    live.child(QPushButton, "wizardOther0").click()
    live.wait(lambda: live.can(Action.NEXT))
    studio.camera.shows = "cursor"
    live.press_space_for(Action.NEXT)
    live.wait(lambda: "Hand found" in shown_checks(live))
    live.qtbot.wait(1000)
    assert live.program.wizard_panel.shown is not None
    assert live.program.wizard_panel.shown.step is Step.SHOW_HAND
    assert ring.share is None
    assert file.load()[0].runs_itself  # going back is for this wearer only
    QTest.keyClick(live.program.window, Qt.Key.Key_H)
    live.wait_for_state(State.ALIGN)


def test_space_never_discards_wherever_tab_leads(live: Technician, studio: Any) -> None:
    window = live.program.window
    handle = window.windowHandle()
    align(live, studio)
    live.wait(lambda: live.can(Action.SOLVE))
    live.wait(live.child(QPushButton, "wizardOther0").isEnabled)
    live.child(QPushButton, "wizardMain").setEnabled(False)  # as when there is no hand
    for _ in range(40):
        QTest.keyClick(handle, Qt.Key.Key_Tab)
        if live.program.window.focusWidget() is not live.child(QPlainTextEdit, ""):
            QTest.keyClick(handle, Qt.Key.Key_Space)
    live.qtbot.wait(300)
    assert live.snapshot.procedure.state is State.ALIGNED
    assert len(live.record.alignments) == 1
    live.child(QPushButton, "wizardMain").setEnabled(True)
    QTest.keyClick(handle, Qt.Key.Key_Space)
    live.wait_for_state(State.SOLVED)


def test_an_alignment_is_discarded_by_its_own_key_only(live: Technician, studio: Any) -> None:
    align(live, studio)
    live.wait(lambda: live.can(Action.SOLVE))
    live.wait(live.child(QPushButton, "wizardOther0").isEnabled)
    QTest.keyClick(
        live.program.window.windowHandle(), Qt.Key.Key_D, Qt.KeyboardModifier.AltModifier
    )
    live.wait_for_state(State.SHOW_HAND)
    live.wait(lambda: not live.record.alignments)


def shown_checks(technician: Technician) -> list[str]:
    """Return what the wizard says that there is, and is not."""
    shown = technician.program.wizard_panel.shown
    return [check.text for check in shown.checks] if shown else []


def test_a_hand_lost_is_said_and_nothing_can_be_made_of_it(live: Technician, studio: Any) -> None:
    studio.camera.shows = "cursor"
    live.press_space_for(Action.NEXT)
    live.press_space_for(Action.NEXT)
    live.wait(lambda: live.can(Action.MAKE_CURSOR))
    studio.camera.shows = "nothing"
    live.wait(lambda: not live.can(Action.MAKE_CURSOR))
    shown = live.program.wizard_panel.shown
    assert shown is not None
    assert shown.step is Step.MAKE_CURSOR
    assert "hand" in shown.checks[0].text
    assert not shown.checks[0].holds
    assert not live.child(QPushButton, "wizardMain").isEnabled()
    QTest.keyClick(live.program.window, Qt.Key.Key_Space)
    live.qtbot.wait(200)
    assert live.snapshot.procedure.state is State.SHOW_HAND


def test_a_turned_hand_is_refused_then_taken(live: Technician, studio: Any) -> None:
    make_cursor(live, studio)
    studio.camera.shows = "turned"
    live.wait(
        lambda: live.snapshot.observation is not None and live.snapshot.observation.is_over_limit
    )
    studio.headset.confirm()
    live.wait(lambda: live.snapshot.procedure.refused == 1)
    assert "more than 9°" in live.child(QLabel, "wizardNote").text()
    assert live.record.alignments == {}
    studio.camera.shows = "live"
    live.wait(
        lambda: (
            live.snapshot.observation is not None and not live.snapshot.observation.is_over_limit
        )
    )
    live.qtbot.wait(300)
    studio.headset.confirm()
    live.wait_for_state(State.ALIGNED)
    live.wait(lambda: len(live.record.alignments) == 1)
    assert live.child(QLabel, "wizardNote").text() == ""


def test_a_silent_headset_is_reported_and_sending_repeated(live: Technician, studio: Any) -> None:
    align(live, studio)
    live.press_space_for(Action.SOLVE)
    live.wait(lambda: live.can(Action.APPLY))
    studio.headset.fall_silent()
    live.press_space_for(Action.APPLY)
    live.wait_for_state(State.APPLYING)
    live.wait_for_state(State.SOLVED)
    live.wait(lambda: "no headset is connected" in live.snapshot.link_problem)
    assert "acknowledge" in live.banner
    assert "acknowledge" in live.child(QLabel, "wizardNote").text()
    live.program.window.docks["link"].raise_()
    state = live.child(QLabel, "link-state")
    live.wait(lambda: state.text().startswith("Not connected"))
    studio.headset.come_back()
    live.wait(lambda: state.text() == "Connected")
    live.wait(lambda: not live.snapshot.link_problem)
    live.press_space_for(Action.APPLY)
    live.wait_for_state(State.APPLIED)
    live.wait(lambda: live.banner == "")


def test_a_camera_unplugged_comes_back_to_the_same_session(live: Technician, studio: Any) -> None:
    make_cursor(live, studio)
    studio.camera.is_plugged = False
    live.wait(lambda: "unplugged" in live.banner or "plug one in" in live.banner)
    studio.camera.is_plugged = True
    live.wait(lambda: live.banner == "")
    assert live.snapshot.procedure.state is State.ALIGN
    studio.camera.shows = "live"
    live.wait(lambda: live.snapshot.observation is not None)
    live.qtbot.wait(300)
    studio.headset.confirm()
    live.wait_for_state(State.ALIGNED)


def test_a_full_disk_costs_nothing_once_there_is_space(live: Technician, studio: Any) -> None:
    make_cursor(live, studio)
    path = live.snapshot.session_path
    away = path.with_name("away")
    path.rename(away)  # as good as a full disk
    studio.camera.shows = "live"
    live.wait(lambda: is_turned(live))
    studio.headset.confirm()
    live.wait_for_state(State.ALIGNED)
    live.wait(lambda: "cannot write" in live.banner)
    live.press_space_for(Action.SOLVE)
    live.wait_for_state(State.SOLVED)
    assert live.snapshot.record.alignments == {}
    live.wait(lambda: "1 alignment confirmed" in shown_checks(live))
    away.rename(path)
    live.wait(lambda: live.banner == "")
    live.wait(lambda: live.snapshot.record.is_solved)
    assert len(live.record.alignments) == 1


def test_alignments_are_deleted_and_restored(live: Technician, studio: Any) -> None:
    align(live, studio)
    solve_and_apply(live)
    session = live.program.window.panels.session
    session.delete_requested.emit("alignment", 1)
    live.wait(lambda: live.snapshot.record.alignments == {})
    assert live.snapshot.procedure.results is None
    session.restore_requested.emit("alignment", 1)
    live.wait(lambda: len(live.snapshot.record.alignments) == 1)
    live.press_space_for(Action.SOLVE)
    live.wait_for_state(State.SOLVED)
    session.delete_requested.emit("alignment", 7)
    live.wait(lambda: live.banner.startswith("Could not delete the alignment: "))
    QTest.keyClick(live.program.window, Qt.Key.Key_Escape)
    assert live.banner == ""


def test_fine_tuning_streams_is_recorded_and_judged_by_trials(
    live: Technician, studio: Any
) -> None:
    align(live, studio)
    solve_and_apply(live)
    window = live.program.window
    solved_m = live.snapshot.procedure.applied_shift_m["left"]
    before = studio.headset.shown.projections["left"].P
    window.docks["fine_tune"].raise_()
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
    tuned = live.snapshot.record.fine_tuned
    assert tuned is not None
    np.testing.assert_allclose(tuned["left"], solved_m + np.array([step_m, 0.0, 0.0]))
    assert sum(event.name == "fine_tuned" for event in live.record.events) == 1

    [shows_target] = window.panels.trials.findChildren(QCheckBox)
    shows_target.click()
    live.wait(lambda: studio.headset.shown.target is not None)
    target = studio.headset.shown.target
    assert target.eye == "left"

    QTest.keyClick(window, Qt.Key.Key_T)
    live.wait(lambda: len(live.snapshot.record.trials) == 1)
    (trial,) = live.snapshot.record.trials.values()
    t_C0_V_m = live.snapshot.record.rig.eyes["left"].t_C0_V_m
    np.testing.assert_allclose(target.corners_V_m + t_C0_V_m, trial.corners_E_m)
    # It would be the right eye's turn, which has not been aligned.
    live.wait(lambda: studio.headset.shown.target is None)
    np.testing.assert_allclose(trial.adjusted_shift_m - trial.calibrated_shift_m, [step_m, 0, 0])
    assert trial.eye == "left"
    assert trial.error_px.min() > 0.0


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
    window.docks["session"].raise_()
    live.wait(lambda: live.child(QPlainTextEdit, "").isEnabled())
    live.child(QPlainTextEdit, "").setPlainText("wears glasses")
    window.docks["fine_tune"].raise_()
    panel = window.panels.fine_tune
    live.wait(lambda: panel.isVisible() and panel.isEnabled())
    live.wait(lambda: "In the headset" in live.child(QLabel, "status").text())
    panel.setFocus()
    QTest.keyClick(panel, Qt.Key.Key_Left)
    window.close()
    record = Session.open(path)
    assert record.notes == "wears glasses"
    assert record.fine_tuned is not None
    np.testing.assert_allclose(record.fine_tuned["left"], [panel.step_m, 0.0, 0.0])


def test_notes_outlive_an_engine_that_breaks_down(
    live: Technician, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = live.snapshot.session_path
    live.program.window.docks["session"].raise_()
    live.wait(lambda: live.child(QPlainTextEdit, "").isEnabled())
    live.child(QPlainTextEdit, "").setPlainText("wears glasses")

    def break_down(_station: Station) -> Snapshot:
        raise ZeroDivisionError("oh")

    monkeypatch.setattr(Station, "step", break_down)
    live.wait_for_page("start")
    assert "unexpected error" in live.banner
    assert Session.open(path).notes == "wears glasses"


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

    monkeypatch.setattr("handcal_gui.program.Station", open_slowly)
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
    second.program.start.resume_requested.emit(path)
    second.wait_for_page("live")
    assert second.snapshot.session_path == path
    assert second.snapshot.procedure.state is State.ALIGNED
    second.wait(lambda: second.snapshot.link.connected)
    solve_and_apply(second)
    assert second.record.is_applied


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
        technician.press_space_for(Action.SOLVE)
        technician.wait(lambda: technician.can(Action.APPLY))
        studio.headset.fall_silent()
        technician.press_space_for(Action.APPLY)
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


def test_an_unexpected_error_is_logged_and_shown(
    technician: Technician, caplog: pytest.LogCaptureFixture
) -> None:
    error = ZeroDivisionError("oh")
    launch._report_error(technician.program, type(error), error, error.__traceback__)
    assert "ZeroDivisionError: oh" in technician.banner
    assert "unexpected error" in caplog.text
    technician.program.show_start()
    technician.wait(lambda: can_start(technician))
