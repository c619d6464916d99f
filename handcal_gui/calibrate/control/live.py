"""Controller of a running calibration: passes snapshots to the panels and commands back."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Literal

import numpy as np
from PySide6.QtCore import QObject, QTimer, Signal

from handcal.bridge.bridges import BridgeSettings
from handcal.calibration.procedure import Calibration
from handcal.calibration.states import ProcedureError, State
from handcal.camera.clock import INFORM_NS
from handcal.core.errors import FileError
from handcal.core.types import EyePlan
from handcal.link.server import HeadsetServer
from handcal.register.results import SolveSettings
from handcal.session.session import Session
from handcal.station.snapshot import Snapshot
from handcal.station.station import Station
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.control.conditions import Conditions
from handcal_gui.calibrate.guide.steps import Wizard
from handcal_gui.calibrate.guide.view import ACTION_NAMES, Action
from handcal_gui.calibrate.guide.wizard import WizardPanel
from handcal_gui.calibrate.sections import Panel
from handcal_gui.calibrate.trials.panel import RECORD
from handcal_gui.calibrate.window import MainWindow
from handcal_gui.engine.engine_thread import Command, EngineThread, calibrating

_LOG = logging.getLogger(__name__)

_POLL_MS = 25
"""A snapshot is shown as soon as it arrives; this is for one that was too early and stays."""
_SLOW_EVERY = 2
"""On a slow computer, panels show only every such snapshot of those that the guide shows."""
_NO_BRIDGES = BridgeSettings()
_CHOOSING = tr("choose the eyes")
_SAVING = tr("save the notes")
_SAVING_S = 1.0
"""Longest wait for the notes to be saved before a session is left."""
_SAVE_AGAIN_MS = 3000


class CalibrationController(QObject):
    """Connects the engine with the window during calibrations, one at a time.

    Parameters
    ----------
    window : MainWindow
    wizard_panel : WizardPanel

    Attributes
    ----------
    opened : Signal(Path)
        A station is running; its session's folder.
    ended : Signal(str)
        The engine ended; the reason, empty if it was closed.
    polled : Signal(Snapshot)
        The snapshot now shown.
    on : dict of Action to callable
        What the program does at actions that are not the engine's: *Export*, *Next wearer* and
        *Headset slipped*.
    """

    opened = Signal(object)
    ended = Signal(str)
    polled = Signal(object)

    def __init__(self, window: MainWindow, wizard_panel: WizardPanel) -> None:
        super().__init__(window)
        self.on: dict[Action, Callable[[], object]] = {}
        self._window = window
        self._wizard_panel = wizard_panel
        self._solve_settings = SolveSettings()
        self._engine: EngineThread | None = None
        self._link: HeadsetServer | None = None
        self._is_broken = False
        self._snapshot: Snapshot | None = None
        self._is_watching = self._is_plan_held = False
        self._conditions = Conditions()
        panels = window.panels
        self._turns: deque[Panel] = deque((*panels.shown("in turn"), wizard_panel.picture))
        # Numbers of commands: the wizard's last one, and those in the snapshot shown.
        self._doing = self._shown = 0
        self._failed_command = self._failure = self._notes_problem = ""
        self._shown_ns = self._count = 0  # time of the snapshot shown, and number of those shown
        self._timer = QTimer(self)
        self._timer.setInterval(_POLL_MS)
        self._timer.timeout.connect(self._poll)
        self._saving = QTimer(self, interval=_SAVE_AGAIN_MS, singleShot=True)
        self._saving.timeout.connect(self._save_notes_again)
        self._connect()

    @property
    def snapshot(self) -> Snapshot | None:
        """The snapshot shown; None while no calibration is running."""
        return self._snapshot

    @property
    def link(self) -> HeadsetServer | None:
        """The link of the running calibration; None while none is running."""
        return self._link

    def start(
        self,
        open_station: Callable[[], Station],
        *,
        bridges: BridgeSettings = _NO_BRIDGES,
        is_held: bool = True,
    ) -> None:
        """End the present calibration and open a station; if held, no step runs automatically."""
        self.stop()
        self._is_watching = self._is_broken = False
        self._notes_problem = ""
        self._is_plan_held = True
        self._doing = self._shown = 0
        self._conditions = Conditions()
        self._wizard_panel.start(Wizard(), is_held=is_held)
        self._engine = EngineThread(lambda: _held(open_station()), self, bridges)
        self._engine.arrived.connect(self._poll)
        self._engine.told.connect(self._window.banner.show_message)
        self._engine.opened.connect(self._on_opened)
        self._engine.command_done.connect(self._on_command_done)
        self._engine.failed.connect(self._on_command_failed)
        self._engine.ended.connect(self._on_ended)
        self._engine.start()

    def save_notes(self) -> str:
        """Save the notes now; return why they could not be saved, empty if they were."""
        if self._engine is None or self._window.panels.session.notes.are_saved:
            return ""
        self._window.panels.session.notes.save_now()
        self._engine.settle(_SAVING_S)
        return self._notes_problem

    def cancel(self) -> None:
        """Cancel opening the station without waiting; `ended` follows once it is closed."""
        if self._engine is not None:
            self._engine.opened.disconnect(self._on_opened)
            self._engine.request_stop()

    def stop(self) -> None:
        """End the calibration and wait for it; safe to call twice."""
        self._timer.stop()  # no snapshot that is still on its way is shown
        self._saving.stop()
        self._window.panels.results.comparison.cancel()
        engine = self._engine
        if engine is not None:
            self._window.panels.fine_tune.settle()
            self._window.panels.session.notes.flush()
            engine.close()
            engine.deleteLater()
        self._engine = None
        self._snapshot = self._link = None
        self._window.banner.show_condition("")

    def do(self, action: Action) -> None:
        """Perform an action of the wizard, unless the previous one is still in progress."""
        if action in self.on:
            self.on[action]()
        elif self._snapshot is not None and self._shown >= self._doing:
            if action is Action.BACK:
                self._wizard_panel.hold(True)  # or the step would run again
            if action in (Action.NEXT, Action.BACK, Action.FINISH):
                self._wizard_panel.wizard.move(action)
                # Before the plan can take another step.
                self._hold_plan(self._wizard_panel.wizard.holds_plan)
                self._wizard_panel.show_snapshot(self._snapshot)
            is_skip = action is Action.SKIP
            command = skipping(self._snapshot) if is_skip else _COMMANDS.get(action)
            if command is not None:
                self._doing = self._submit(action.value, command)

    def choose_eyes(self, eyes: EyePlan) -> None:
        """Have the plan align other eyes, or in another order."""
        self._submit(_CHOOSING, lambda station: station.plan.choose(eyes))

    def _nudge(self, right_arcmin: float, down_arcmin: float, size: float) -> None:
        """Move the drawing of the eye that is verified."""
        verifying = self._snapshot.procedure.verifying if self._snapshot is not None else None
        if verifying is not None:
            eye = verifying.eye
            self._submit(
                tr("move the outline"),
                calibrating(lambda c: c.nudge(eye, right_arcmin, down_arcmin, size)),
            )

    def _go_back(self, to: Literal["offline", "former"]) -> None:
        """Have the headset draw with another φ."""
        self._hold_plan(self._wizard_panel.wizard.holds_plan)  # or it would send the newest again
        self._submit(tr("go back"), lambda station: _go_back(station, to))

    def _connect(self) -> None:
        panels = self._window.panels
        self._wizard_panel.bar.do = self.do
        self._wizard_panel.nudge = self._nudge
        self._wizard_panel.go_back = self._go_back
        self._wizard_panel.step_changed.connect(self._on_step)
        comparing = self._wizard_panel.comparison, panels.trials.comparison
        for asking in (panels.fine_tune, panels.trials, panels.session, *comparing):
            asking.submit = self._submit
        panels.session.notes.save = self._save_notes
        panels.trials.fine_tune = panels.fine_tune
        panels.trials.doubted.connect(self._on_doubted)
        panels.link.restart_headset.clicked.connect(
            lambda: self._submit(tr("restart the headset"), Station.restart_headset)
        )

    def _submit(self, name: str, command: Command) -> int:
        return self._engine.submit(name, command) if self._engine is not None else 0

    def _poll(self) -> None:
        if self._engine is None or not self._timer.isActive():
            return
        snapshot, shown = self._engine.newest()
        if snapshot is None or self._is_shown(snapshot) or self._is_early(snapshot):
            return
        self._shown, self._shown_ns = shown, time.monotonic_ns()
        self._count += 1
        condition = self._conditions.condition(
            snapshot, needs_frames=self._wizard_panel.wizard.needs_frames(snapshot)
        )
        snapshot = self._conditions.calm(snapshot)
        if self._snapshot is None or snapshot.record is not self._snapshot.record:
            self._window.panels.results.comparison.use(snapshot.record, self._solve_settings)
            self._window.show_wearer(snapshot.record.wearer)
        self._snapshot = snapshot
        panels = self._window.panels
        always: set[object] = {*panels.shown("always")}
        # The guide and the rotation panel advise the same: they never show different frames.
        always |= {panels.rotation} if panels.rotation.isVisible() else set()
        # Panels that are slow to paint take turns, so that the window never waits for all of them.
        self._wizard_panel.show_snapshot(snapshot)
        # Otherwise, on a slow computer, some panels would never have a turn.
        shows = not self._conditions.is_slow or self._count % _SLOW_EVERY == 0
        if shows:
            self._turns.rotate()
        picture = self._wizard_panel.picture
        turns = [one for one in self._turns if one.isVisible()] or [picture]
        for panel in (*panels.all(), picture):
            is_due = panel is turns[0] if panel in self._turns else panel.isVisible()
            if panel in always or (is_due and shows):
                panel.show_snapshot(snapshot)
        self._window.follow(snapshot)
        self._window.banner.show_condition(condition)
        self._hold_plan(self._wizard_panel.wizard.holds_plan)
        self._watch_views(picture.wants_views or panels.wearer_view.isVisible())
        self.polled.emit(snapshot)

    def _is_shown(self, snapshot: Snapshot) -> bool:
        return self._snapshot is not None and snapshot.number == self._snapshot.number

    def _is_early(self, snapshot: Snapshot) -> bool:
        """Return True for a frame soon after the one shown, until one in time would have come."""
        last = self._snapshot and self._snapshot.frame
        if last is None or snapshot.frame is None:
            return False
        is_soon = 0 <= snapshot.frame.t_host_ns - last.t_host_ns < INFORM_NS
        return is_soon and time.monotonic_ns() - self._shown_ns < 2 * INFORM_NS

    def _watch_views(self, wanted: bool) -> None:
        """Have the wearer's views rendered only while they are visible."""
        if wanted != self._is_watching:
            self._is_watching = wanted
            self._submit("watch", lambda station: setattr(station, "watch_views", wanted))

    def _hold_plan(self, wanted: bool) -> None:
        """Let the station follow its plan automatically, or hold it."""
        if wanted != self._is_plan_held:
            self._is_plan_held = wanted
            self._submit("hold", lambda station: setattr(station, "holds_plan", wanted))

    def _on_opened(self, station: Station) -> None:
        self._link = station.link
        _LOG.info("camera: %s, headset: %s", station.settings.source, station.settings.headset)
        self._conditions = Conditions(
            is_usb=station.settings.source == "realsense",
            is_virtual=station.settings.headset == "virtual",
        )
        panels = self._window.panels
        self._solve_settings = station.settings.calibration.solve
        host, port = station.address
        host = f"[{host}]" if ":" in host else host
        panels.camera.begin(station.settings.calibration.segment)
        panels.cloud.clear()
        self._wizard_panel.picture.begin()
        panels.fine_tune.set_rig(station.rig)
        panels.results.show_results(None, None)
        panels.session.set_read_only(False)
        panels.trials.set_read_only(False)
        panels.link.show_pairing(
            f"{host}:{port}", station.pairing_key, is_virtual=station.settings.headset == "virtual"
        )
        self._window.show_page("live")
        self._timer.start()
        self.opened.emit(station.session.path)

    def _on_step(self) -> None:
        if self._failure and self._window.banner.text == self._failure:
            self._window.banner.clear()  # the action has been taken elsewhere, or is obsolete

    def _on_command_done(self, name: str, _answer: object) -> None:
        if name == _SAVING:
            self._notes_problem = ""
        # A message about a failed action of the wizard is obsolete once another has succeeded.
        if name == self._failed_command or {name, self._failed_command} <= set(Action):
            self._window.banner.clear()

    def _on_command_failed(self, name: str, why: str) -> None:
        text = tr("Could not {}: {}").format(ACTION_NAMES.get(name, name), why)
        if name == _SAVING:
            self._saving.start()
            if text == self._notes_problem:  # said before, and perhaps closed
                return
            self._notes_problem = text
        if name == _CHOOSING:
            self._wizard_panel.show_eyes_again()
        self._failed_command = name
        self._failure = text if name in set(Action) else ""
        self._window.banner.show_message(text)

    def _on_doubted(self, why: str) -> None:
        if not why:
            if self._failed_command == RECORD:
                self._window.banner.clear()
            return
        self._failed_command = RECORD
        self._window.banner.show_message(tr("The trial is not recorded yet: {}").format(why))

    def _save_notes(self, text: str) -> None:
        """Save notes in the engine's thread, or here if the engine has failed."""
        if self._is_broken and self._snapshot is not None:
            with suppress(FileError), Session(self._snapshot.session_path) as session:
                session.save_notes(text)
        else:
            self._submit(_SAVING, lambda station: station.session.save_notes(text))

    def _save_notes_again(self) -> None:
        """Try again what could not be saved, as when a disk was full."""
        notes = self._window.panels.session.notes
        if not notes.are_saved:
            notes.save_now()

    def _on_ended(self, why: str) -> None:
        self._timer.stop()
        self._is_broken = bool(why)
        self._window.panels.session.notes.flush()  # text typed just before the end
        self.ended.emit(why)


def _held(station: Station) -> Station:
    """Hold the plan of a station that was just opened, until the guide lets it go."""
    station.holds_plan = True
    return station


def _confirm(calibration: Calibration) -> None:
    """Confirm for the wearer, who may have done so already."""
    if calibration.state is State.ALIGN:
        calibration.confirm()


def skipping(snapshot: Snapshot) -> Command:
    """Return the command that skips the verification shown, unless the wearer has ended it."""
    verifying, step = snapshot.procedure.verifying, snapshot.next_step
    eyes = (verifying.eye,) if verifying is not None else () if step is None else step.eyes

    def skip(station: Station) -> None:
        with suppress(FileError, ProcedureError):
            station.plan.skip(eyes[0])

    return skip if eyes else lambda _: None


def _go_back(station: Station, to: Literal["offline", "former"]) -> None:
    """Have the headset draw with another φ, which is not that of a trial."""
    station.trials.hide_target()
    with suppress(FileError):
        station.calibration.go_back(to)


def _use_kept(calibration: Calibration, *, is_used: bool) -> None:
    """Draw with results that are no better than before, or with the offline calibration again."""
    results = calibration.results
    if results is None:
        raise ProcedureError("there is no result")
    kept = [eye for eye, one in results.verdicts.items() if one.name == "keep"]
    calibration.set_shift(
        {eye: results.eyes[eye].shift_m if is_used else np.zeros(3) for eye in kept}
    )
    calibration.record_shift()


_COMMANDS: dict[Action, Command] = {
    Action.TAKE_STEP: Station.take_step,
    Action.CONFIRM: calibrating(_confirm),
    Action.REDO: calibrating(Calibration.redo),
    Action.VERIFIED: calibrating(Calibration.verified),
    Action.UNDO_NUDGE: calibrating(Calibration.undo_nudge),
    Action.ANOTHER: lambda station: station.plan.request(),
    Action.REPEAT_LEFT: lambda station: station.plan.request(("left",)),
    Action.REPEAT_RIGHT: lambda station: station.plan.request(("right",)),
    Action.WITHDRAW: lambda station: station.plan.withdraw(),
    Action.VERIFY_LEFT: calibrating(lambda calibration: calibration.verify("left")),
    Action.VERIFY_RIGHT: calibrating(lambda calibration: calibration.verify("right")),
    Action.USE_ANYWAY: calibrating(partial(_use_kept, is_used=True)),
    Action.KEEP_OFFLINE: calibrating(partial(_use_kept, is_used=False)),
    Action.FINISH: Station.finish,
}
"""The engine's part of each action of the guide."""
