"""A person at the program's window, and the steps that several tests take."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QPushButton, QWidget
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.session.session import Session, SessionRecord
from handcal.station.snapshot import Snapshot
from handcal_gui.app.program import Program
from handcal_gui.calibrate.guide.view import Action

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

    def press_space_to(self, do: str) -> None:
        """Press the space bar once the wizard's main button has this label."""
        self.wait(lambda: self.can_take(do))
        QTest.keyClick(self.program.window, Qt.Key.Key_Space)

    def can_take(self, label: str) -> bool:
        shown = self.program.wizard_panel.shown
        return shown is not None and shown.main.label == label and shown.main.is_enabled

    def wait_for_state(self, state: State) -> None:
        self.wait(lambda: self.snapshot.procedure.state is state)

    def child(self, kind: type[Any], name: str) -> Any:
        found = self.program.window.findChild(kind, name)
        assert isinstance(found, QWidget)
        return found


def can_start(technician: Technician) -> bool:
    """Return whether the start page allows starting a calibration."""
    return bool(technician.child(QPushButton, "start").isEnabled())


def make_cursor(technician: Technician, studio: Any, *, is_first: bool = True) -> None:
    """Get from Connect, or from the alignment before, to a cursor."""
    studio.camera.shows = "cursor"
    if is_first:
        technician.press_space_for(Action.NEXT)
    technician.press_space_to("Make cursor")
    technician.wait_for_state(State.ALIGN)
    technician.wait(lambda: studio.headset.shown.cursor_W_m is not None)


def is_turned(technician: Technician) -> bool:
    """Return whether the visible hand is not the cursor's, and is held still."""
    seen = technician.snapshot.observation
    if seen is None or seen.rotation_rad is None or not seen.is_steady:
        return False
    return bool(np.linalg.norm(seen.rotation_rad) > 0.02)


def align(technician: Technician, studio: Any, *, is_first: bool = True) -> None:
    make_cursor(technician, studio, is_first=is_first)
    studio.camera.shows = "live"
    technician.wait(lambda: is_turned(technician))
    studio.headset.confirm()
    technician.wait_for_state(State.ALIGNED)


def solve_and_apply(technician: Technician) -> None:
    technician.press_space_to("Solve")
    technician.wait_for_state(State.SOLVED)
    technician.press_space_for(Action.TAKE_STEP)
    technician.wait_for_state(State.APPLIED)


def shown_preconditions(technician: Technician) -> list[str]:
    """Return what the wizard says that there is, and is not."""
    shown = technician.program.wizard_panel.shown
    return [check.text for check in shown.preconditions] if shown else []
