"""The program led by the wizard, by keys and by itself."""

from __future__ import annotations

import logging
from functools import partial
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QLabel, QPlainTextEdit, QPushButton

from handcal.calibration.states import State
from handcal_gui.app.preferences import PreferencesFile
from handcal_gui.calibrate.cloud.panel import CloudView
from handcal_gui.calibrate.guide.view import Action
from tests.gui.app.program.technician import (
    Technician,
    align,
    is_turned,
    shown_preconditions,
    solve_and_apply,
)
from tests.gui.helpers import button


def test_the_wizard_one_eye_after_the_other_by_the_space_bar(
    live: Technician, studio: Any, file: PreferencesFile
) -> None:
    align(live, studio)
    assert studio.headset.shown.eyes == ("left",)
    solve_and_apply(live)
    align(live, studio, is_first=False)
    assert studio.headset.shown.eyes == ("right",)
    solve_and_apply(live)
    for label in ("Verify the left eye", "Verify the right eye"):
        live.wait(partial(live.can_take, label))
        live.child(QPushButton, "wizardOther0").click()  # skip
    live.wait(lambda: live.can(Action.ANOTHER))  # not accepted
    button(live.program.window, QPushButton, "Finish a&s it is").click()
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
    window = live.program.window
    assert window.windowTitle() == "Ada – handcal"
    window.banner.show_message("Something about Ada")
    live.press_space_for(Action.NEXT_WEARER)
    assert (window.page, window.windowTitle(), live.banner) == ("start", "handcal", "")
    stored, complaint = file.load()
    assert complaint == ""
    assert "Ada" not in file.path.read_text()  # only in the session
    assert stored.sessions == (str(record.path),)
    assert stored.station == studio.settings
    [cloud], first = window.panels.cloud.findChildren(CloudView), record.alignments[1]
    window.panels.cloud.show_alignment(first, np.zeros(len(first.hand_m)), 1.0)
    shown_first: list[str] = []
    live.program.live.opened.connect(lambda _: shown_first.append(cloud.accessibleDescription()))
    live.program.start_calibration(studio.settings, "Grace")
    live.wait_for_page("live")
    assert ["Hold a hand in front" in text for text in shown_first] == [True]  # no hand of Ada's


def test_no_name_of_a_wearer_is_logged(
    technician: Technician, studio: Any, caplog: pytest.LogCaptureFixture
) -> None:
    """The log is sent with reports of errors; names are only in the sessions."""
    caplog.set_level(logging.DEBUG)
    first, corrected = "Zdenka Quorvath", "Ilse Quorvath"
    program = technician.program
    program.start_calibration(studio.settings, first)
    technician.wait_for_page("live")
    technician.wait(lambda: technician.snapshot.link.connected)
    align(technician, studio)
    path = technician.snapshot.session_path
    technician.wait(lambda: program.window.windowTitle().startswith(first))
    program.show_start()
    technician.wait_for_page("start")
    program.open_session(path)
    technician.wait_for_page("review")
    library = program.windows.show_library(path.parent)
    technician.wait(lambda: bool(library.chosen))
    library._correct_names(library.chosen, corrected)
    technician.wait(lambda: program.window.windowTitle().startswith(corrected))
    library.reject()
    logged = "\n".join(map(logging.Formatter().format, caplog.records))
    assert "camera: realsense, headset: network" in logged
    assert "Quorvath" not in logged


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
    technician.press_space_to("Verify the left eye")
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
    technician.wait(lambda: "left" in technician.snapshot.record.facts.verified)
    technician.wait_for_state(State.APPLIED)
    results = technician.snapshot.procedure.results
    assert results is not None
    found = results.verified["left"].before_arcmin
    live_text = technician.program.wizard_panel.picture.result
    technician.wait(lambda: f"Verification found: {found:.1f}′" in live_text.text())
    assert technician.record.facts.verified["left"].nudge_arcmin == (2.0, 0.0)


def test_back_and_a_key_hold_the_steps_that_run_by_themselves(
    live: Technician, studio: Any, file: PreferencesFile
) -> None:
    QTest.keyClick(live.program.window, Qt.Key.Key_H)
    assert file.load()[0].runs_itself
    live.press_space_for(Action.NEXT)  # no hand is shown yet
    live.wait(lambda: "No hand" in " ".join(shown_preconditions(live)))
    live.child(QPushButton, "wizardOther0").click()
    live.wait(lambda: live.can(Action.NEXT))
    studio.camera.shows = "cursor"
    live.press_space_for(Action.NEXT)
    live.wait(lambda: live.can_take("Make cursor"))
    live.qtbot.wait(1500)
    assert live.snapshot.procedure.state is State.SHOW_HAND
    assert file.load()[0].runs_itself  # going back is for this wearer only
    QTest.keyClick(live.program.window, Qt.Key.Key_H)
    live.wait_for_state(State.ALIGN)


def test_space_never_discards_wherever_tab_leads(live: Technician, studio: Any) -> None:
    window = live.program.window
    handle = window.windowHandle()
    align(live, studio)
    live.wait(lambda: live.can_take("Solve"))
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
    live.wait(lambda: live.can_take("Solve"))
    live.wait(live.child(QPushButton, "wizardOther0").isEnabled)
    QTest.keyClick(
        live.program.window.windowHandle(), Qt.Key.Key_D, Qt.KeyboardModifier.AltModifier
    )
    live.wait_for_state(State.SHOW_HAND)
    live.wait(lambda: not live.record.alignments)
