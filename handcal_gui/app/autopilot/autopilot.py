"""Operates the wizard in place of the technician: for demonstrations, tests and screenshots."""

from __future__ import annotations

import time
from collections.abc import Callable

from PySide6.QtCore import QObject, Signal

from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.control.live import CalibrationController
from handcal_gui.calibrate.guide.view import WEARERS, Action, WizardView
from handcal_gui.calibrate.guide.wizard import WizardPanel

_LOOK_S = 0.7
_MOST_ADDED = 4
"""Most times that more is measured, however often that is advised."""
_ADDS = Action.ANOTHER, Action.VERIFY_LEFT, Action.VERIFY_RIGHT
_PATIENCE_S = 120.0
_PATIENCE_STEPS = 600
"""Engine steps to wait for as well, for a busy machine; an idle one makes five a second or more."""


class Autopilot(QObject):
    """Presses the wizard's main button whenever it can be pressed, until the session is finished.

    Alignments and verifications are confirmed by the wearer, in the headset.

    Parameters
    ----------
    live : CalibrationController
    wizard_panel : WizardPanel
    look : callable, optional
        Called with every view that lasts, before its button is pressed; may block, or pause the
        autopilot.

    Attributes
    ----------
    finished : Signal()
        The session is finished.
    stuck : Signal(str)
        The wizard makes no progress; the step and the reason.
    """

    finished = Signal()
    stuck = Signal(str)

    def __init__(
        self,
        live: CalibrationController,
        wizard_panel: WizardPanel,
        look: Callable[[WizardView], None] = lambda _view: None,
    ) -> None:
        super().__init__(live)
        self._wizard_panel = wizard_panel
        self._look = look
        self._view: WizardView | None = None
        self._since_s = self._moved_s = time.monotonic()
        self._moved_at = self._added = 0
        self._is_paused = self._is_done = False
        live.polled.connect(self._watch)

    def pause(self) -> None:
        """Press no button until `resume`."""
        self._is_paused = True

    def resume(self) -> None:
        """Continue after a pause."""
        self._is_paused = False
        self._view = None

    def _watch(self, snapshot: Snapshot) -> None:
        view = self._wizard_panel.shown
        if view is None or self._is_paused or self._is_done:
            return
        now_s = time.monotonic()
        if self._view is None or (view.step, view.main) != (self._view.step, self._view.main):
            if self._view is None or view.step is not self._view.step:
                self._moved_s, self._moved_at = now_s, snapshot.number
            self._view, self._since_s = view, now_s
        steps = snapshot.number - self._moved_at
        if now_s - self._moved_s > _PATIENCE_S and steps > _PATIENCE_STEPS:
            self._end(lambda: self.stuck.emit(self._complaint(view)))
        elif now_s - self._since_s > _LOOK_S:
            self._act(view)

    def _act(self, view: WizardView) -> None:
        self._since_s = time.monotonic()
        self._look(view)
        if self._is_paused or not (view.main.is_enabled or view.main.action in WEARERS):
            return
        if view.main.action is Action.NEXT_WEARER:
            self._end(self.finished.emit)
        elif view.main.action in _ADDS and self._added == _MOST_ADDED:
            self._wizard_panel.asked.emit(Action.NEXT)
        elif view.main.action not in WEARERS:
            self._added += view.main.action in _ADDS
            self._wizard_panel.press_main()

    def _end(self, tell: Callable[[], None]) -> None:
        self._is_done = True
        tell()

    @staticmethod
    def _complaint(view: WizardView) -> str:
        missing = [check.text for check in view.preconditions if not check.holds]
        why = f": {'; '.join(missing)}" if missing else ""
        return f"no progress at “{view.step.value}” for {_PATIENCE_S:.0f} s{why}"
