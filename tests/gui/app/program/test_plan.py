"""The program with a station that follows its plan."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QPushButton

from handcal.calibration.plan import PlanSettings
from handcal.calibration.states import State
from handcal.register.placement import PlacementSettings
from handcal.station.settings import StationSettings
from handcal_gui.calibrate.guide.view import Action
from handcal_gui.widgets.times import session_time
from tests.gui.app.program.technician import Technician, is_turned, shown_preconditions
from tests.gui.helpers import button, child


def with_plan(settings: StationSettings) -> StationSettings:
    """Return settings with the recommended plan of one alignment of one eye.

    The tests' hand does not follow the cursor, so no other place may be in the camera's range.
    """
    placement = PlacementSettings(farthest_m=0.1, fewest=1, most=1, verifications=1)
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
    technician.wait(lambda: "Camera" in " ".join(shown_preconditions(technician)))
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
    technician.wait(lambda: technician.can(Action.VERIFIED))
    QTest.keyClick(program.window, Qt.Key.Key_Right)
    wizard_fact = technician.child(QLabel, "wizardFact")
    technician.wait(lambda: "1.0′ right" in wizard_fact.text())
    technician.press_space_for(Action.VERIFIED)
    technician.wait(lambda: technician.can(Action.ANOTHER))  # once is not enough
    solved_m = technician.snapshot.procedure.applied_shift_m["left"]
    assert solved_m.any()

    final = child(program.wizard_panel, QLabel, "card-drawn-left")
    QTest.keyClick(program.window, Qt.Key.Key_G, Qt.KeyboardModifier.ShiftModifier)
    technician.wait(lambda: not technician.snapshot.procedure.applied_shift_m["left"].any())
    technician.wait(lambda: final.text().startswith("Final φ: offline"))
    assert program.wizard_panel.wizard.is_held
    QTest.keyClick(program.window, Qt.Key.Key_G)
    technician.wait(
        lambda: bool((technician.snapshot.procedure.applied_shift_m["left"] == solved_m).all())
    )
    technician.wait(lambda: technician.can(Action.ANOTHER))
    button(program.window, QPushButton, "Finish a&s it is").click()
    technician.press_space_for(Action.FINISH)
    technician.wait(lambda: technician.can(Action.NEXT_WEARER))
    path = technician.snapshot.session_path
    assert technician.record.facts.plan == "recommended"

    button(program.window, QPushButton, "Headset &slipped").click()
    technician.wait_for_page("live")
    technician.wait(lambda: technician.snapshot.session_path != path)
    assert technician.record.facts.former == path.name
    assert technician.record.wearer == "Ada"
    assert f"The former result is used again ({session_time(path.name)})" in wizard_fact.text()
    assert path.name not in wizard_fact.text()
    begin(technician, studio)
    program.wizard_panel.hold(False)
    technician.wait_for_state(State.VERIFY)
    assert technician.snapshot.record.alignments == {}


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
    technician.wait(lambda: technician.can(Action.ANOTHER))
    assert technician.record.facts.verified == {}
    session = technician.program.window.panels.session
    session.submit("delete the alignment", lambda s: s.delete("alignment", 1))
    technician.wait(lambda: not technician.snapshot.record.alignments)
    session.submit("restore the alignment", lambda s: s.restore("alignment", 1))
    technician.wait(lambda: technician.can(Action.TAKE_STEP))  # not waiting for a hand for good
    for state in (State.SOLVED, State.APPLIED):
        technician.press_space_for(Action.TAKE_STEP)
        technician.wait_for_state(state)
    technician.wait(lambda: technician.can(Action.ANOTHER))
    button(technician.program.window, QPushButton, "Verify l&eft eye").click()
    technician.wait_for_state(State.VERIFY)
