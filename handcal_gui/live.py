"""A running calibration: from the engine's newest snapshot to the panels, and back."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from PySide6.QtCore import QObject, QTimer, Signal

from handcal.snapshot import Snapshot
from handcal.station import Station
from handcal.types import Eye, Float64
from handcal_gui.compare import Comparison
from handcal_gui.stream import Command, Stream
from handcal_gui.window import MainWindow
from handcal_gui.wizard.steps import Action, EyePlan, Wizard
from handcal_gui.wizard.wizard import WizardPanel

_POLL_MS = 33


class Live(QObject):
    """Connects a stream with the window while a wearer is calibrated; one after the other.

    Parameters
    ----------
    window : MainWindow
    wizard_panel : WizardPanel
    comparison : Comparison

    Attributes
    ----------
    opened : Signal(Path)
        A station runs; its session's folder.
    ended : Signal(str)
        The engine ended, and why; empty if it was closed.
    polled : Signal(Snapshot)
        A new snapshot is shown.
    export_requested, next_wearer_requested : Signal()
    """

    opened = Signal(object)
    ended = Signal(str)
    polled = Signal(object)
    export_requested = Signal()
    next_wearer_requested = Signal()

    def __init__(
        self, window: MainWindow, wizard_panel: WizardPanel, comparison: Comparison
    ) -> None:
        super().__init__(window)
        self._window = window
        self._wizard_panel = wizard_panel
        self._comparison = comparison
        self._stream: Stream | None = None
        self._snapshot: Snapshot | None = None
        self._is_watching = False
        self._timer = QTimer(self)
        self._timer.setInterval(_POLL_MS)
        self._timer.timeout.connect(self._poll)
        self._connect()

    @property
    def snapshot(self) -> Snapshot | None:
        """The newest snapshot shown; None unless a calibration runs."""
        return self._snapshot

    def start(self, open_station: Callable[[], Station], plan: EyePlan) -> None:
        """Run a station, after ending the present one."""
        self.stop()
        self._is_watching = False
        self._wizard_panel.start(Wizard(plan))
        self._stream = Stream(open_station, self)
        self._stream.opened.connect(self._take_station)
        self._stream.obeyed.connect(self._take_answer)
        self._stream.failed.connect(self._take_failure)
        self._stream.ended.connect(self._take_end)
        self._stream.start()
        self._timer.start()

    def stop(self) -> None:
        """End the calibration and wait for it; safe to call twice."""
        self._timer.stop()
        self._comparison.cancel()
        stream, self._stream = self._stream, None
        if stream is not None:
            self._window.panels.session.flush()
            stream.close()
            stream.deleteLater()
        self._snapshot = None
        self._window.banner.show_condition("")

    def do(self, action: Action) -> None:
        """Do what the wizard offers."""
        snapshot = self._snapshot
        if snapshot is None:
            return
        eyes = self._wizard_panel.wizard.eyes(snapshot)
        commands: dict[Action, Command] = {
            Action.MAKE_CURSOR: lambda station: station.calibration.make_cursor(eyes),
            Action.CONFIRM: lambda station: station.calibration.confirm(),
            Action.SOLVE: lambda station: station.calibration.solve(),
            Action.APPLY: lambda station: station.calibration.apply(),
            Action.REDO: lambda station: station.calibration.redo(),
            Action.FINISH: lambda station: station.session.finish(),
        }
        if action in commands:
            self._ask(action.value, commands[action])
        elif action is Action.EXPORT:
            self.export_requested.emit()
        elif action is Action.NEXT_WEARER:
            self.next_wearer_requested.emit()
        else:
            self._wizard_panel.wizard.move(action, snapshot)
            self._wizard_panel.show_snapshot(snapshot)

    def _connect(self) -> None:
        panels = self._window.panels
        self._wizard_panel.asked.connect(self.do)
        self._window.space_pressed.connect(self._wizard_panel.press_main)
        panels.fine_tune.shift_changed.connect(self._set_shift)
        panels.fine_tune.shift_settled.connect(
            lambda: self._ask("record φ", lambda station: station.calibration.record_shift())
        )
        # What is shown for a comparison only is not the φ that a trial is about.
        panels.trials.trial_requested.connect(panels.fine_tune.settle)
        panels.trials.trial_requested.connect(
            lambda eye, depth_m: self._ask(
                "record the trial", lambda station: station.save_trial(eye, depth_m)
            )
        )
        panels.link.restart_headset_requested.connect(
            lambda: self._ask("restart the headset", lambda station: station.restart_headset())
        )
        session = panels.session
        session.delete_alignment_requested.connect(
            self._ask_number("delete the alignment", lambda s: s.calibration.delete_alignment)
        )
        session.restore_alignment_requested.connect(
            self._ask_number("restore the alignment", lambda s: s.calibration.restore_alignment)
        )
        for panel in (session, panels.trials):
            panel.delete_trial_requested.connect(
                self._ask_number("delete the trial", lambda s: s.session.delete_trial)
            )
            panel.restore_trial_requested.connect(
                self._ask_number("restore the trial", lambda s: s.session.restore_trial)
            )
        session.notes_changed.connect(
            lambda text: self._ask(
                "save the notes", lambda station: station.session.save_notes(text)
            )
        )

    def _ask(self, name: str, command: Command) -> None:
        if self._stream is not None:
            self._stream.ask(name, command)

    def _ask_number(
        self, name: str, method: Callable[[Station], Callable[[int], object]]
    ) -> Callable[[int], None]:
        """Return what asks the engine to call a method with a number."""
        return lambda number: self._ask(name, lambda station: method(station)(number))

    def _set_shift(self, shifts_m: Mapping[Eye, Float64]) -> None:
        self._ask("set φ", lambda station: station.calibration.set_shift(shifts_m))

    def _poll(self) -> None:
        snapshot = self._stream.newest() if self._stream is not None else None
        if snapshot is None or snapshot is self._snapshot:
            return
        if self._snapshot is None or snapshot.record is not self._snapshot.record:
            self._comparison.use(
                snapshot.record.alignments, snapshot.record.rig, self._solve_settings
            )
        self._snapshot = snapshot
        panels = self._window.panels
        for panel in panels.all():
            if not panel.visibleRegion().isEmpty():
                panel.show_snapshot(snapshot)
        self._wizard_panel.show_snapshot(snapshot)
        self._window.banner.show_condition(
            snapshot.problem or snapshot.camera.problem or snapshot.link_problem
        )
        self._watch_views(not panels.wearer_view.visibleRegion().isEmpty())
        self.polled.emit(snapshot)

    def _watch_views(self, wanted: bool) -> None:
        """Have the wearer's views rendered only while they are seen."""
        if wanted != self._is_watching:
            self._is_watching = wanted
            self._ask("watch", lambda station: setattr(station, "watch_views", wanted))

    def _take_station(self, station: Station) -> None:
        panels = self._window.panels
        self._solve_settings = station.settings.calibration.solve
        host, port = station.address
        panels.camera.begin(station.settings.calibration.segment)
        panels.fine_tune.set_rig(station.rig)
        panels.results.show_results(None, (), station.rig)
        panels.session.set_read_only(False)
        panels.trials.set_read_only(False)
        panels.link.show_pairing(
            f"{host}:{port}", station.pairing_key, is_virtual=station.settings.headset == "virtual"
        )
        self._window.show_page("live")
        self.opened.emit(station.session.path)

    def _take_answer(self, name: str, _answer: object) -> None:
        self._window.banner.clear()
        if name == Action.FINISH and self._snapshot is not None:
            self._wizard_panel.wizard.move(Action.FINISH, self._snapshot)

    def _take_failure(self, name: str, why: str) -> None:
        self._window.banner.show_message(f"Could not {name}: {why}")

    def _take_end(self, why: str) -> None:
        self._timer.stop()
        self.ended.emit(why)
